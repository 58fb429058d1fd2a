// A trimmed start for other parameters, inputs or start values than those of the model file.
#pragma once

#include "cutjoint/core/simulation/checked_simulation.hpp"

namespace cutjoint {

/// Finds the start of a `Model` by Newton's method with differences, from what the compiler has found for the values of the file.
/// Its `Trim` has the numbers that are `found`, whether each coordinate and each speed is one of them, the speeds that follow from loops, the `steady`
/// ones, whose rates vanish, and the number of `aims`.
template <class Model>
class Trimming {
  using Checked = CheckedSimulation<Model>;
  using Sim = typename Model::Sim;
  using M = typename Sim::Mechanism;
  using Real = typename Sim::Real;
  using Trim = typename Model::Trim;
  static constexpr std::size_t speeds = M::sizes.speeds, rows = speeds + Trim::aims, columns = std::size(Trim::found);
  using Left = Fixed<Real, rows>;
  using Changes = Fixed<Real, columns>;

 public:
  explicit Trimming(Checked& simulation)
      : simulation_(simulation), sim_(simulation.sim), given_(sim_.start_state()), coordinates_(sim_.given_coordinates()), speeds_(sim_.given_speeds()) {}

  /// Start with what is found; the start values of the host stay for the next start.
  Fault start() {
    const auto parameters = sim_.parameters();
    const auto inputs = sim_.inputs();
    forget_found();
    Fault fault;
    if (sim_.settings().equilibrium || !is_changed()) take_given();
    else if (!(fault = find())) disturb();
    if (!fault) fault = sim_.start();
    take_given();
    if (fault) sim_.parameters() = parameters, sim_.inputs() = inputs;
    return fault;
  }

 private:
  void take_given() { sim_.start_state() = given_, sim_.given_coordinates() = coordinates_, sim_.given_speeds() = speeds_; }

  /// Keep coordinates and speeds that the host has set although they are found.
  void disturb() {
    StateOf<M>& start = sim_.start_state();
    for (std::size_t i = 0; i < M::sizes.coordinates; ++i)
      if (given_.q[i] != base_.q[i]) start.q[i] = given_.q[i], sim_.given_coordinates()[i] = given_as_fixed;
    for (std::size_t i = 0; i < speeds; ++i)
      if (given_.v[i] != base_.v[i]) start.v[i] = given_.v[i], sim_.given_speeds()[i] = 1;
  }

  void forget_found() {
    for (const TrimmedNumber& each : Trim::found) {
      if (each.kind == TrimmedNumber::input) sim_.inputs().values[index(each)] = std::numeric_limits<Real>::quiet_NaN();
      if (each.kind == TrimmedNumber::parameter) sim_.parameters()[index(each)] = each.begin;
    }
    Checked::reset_start(&simulation_);
    base_ = sim_.start_state();
  }

  /// Take over the values of the host that are not found; whether one differs from that of the file.
  bool is_changed() {
    bool changed = false;
    const auto take = [&](Real& ours, Real given, bool is_found) {
      if (is_found || ours == given) return;
      ours = given;
      changed = true;
    };
    for (std::size_t i = 0; i < M::sizes.coordinates; ++i) take(base_.q[i], given_.q[i], Trim::coordinates[i]);
    for (std::size_t i = 0; i < speeds; ++i) take(base_.v[i], given_.v[i], Trim::speeds[i]);
    Fixed<Real, M::sizes.parameters> values;
    for (std::size_t i = 0; i < M::sizes.parameters; ++i) take(values[i] = Model::values[i], sim_.parameters()[i], false);
    for (std::size_t i = 0; i < M::sizes.inputs; ++i) changed = changed || sim_.inputs().is_given(i);
    return changed;
  }

  Fault find() {
    for (std::size_t i = 0; i < M::sizes.coordinates; ++i) sim_.given_coordinates()[i] = Trim::coordinates[i] ? given_as_guess : given_as_fixed;
    for (std::size_t i = 0; i < speeds; ++i) sim_.given_speeds()[i] = !Trim::follows[i];
    Changes x, step;
    Left left, next;
    Real length(1);
    if (const Fault fault = evaluate(x, left)) return fault;
    for (int iteration = 0; iteration < 40 && length > Real(1e-12); ++iteration) {
      if (const Fault fault = find_step(x, left, step)) return fault;
      length = largest(step);
      Real farthest(0.3);
      for (std::size_t j = 0; j < columns; ++j)
        if (Trim::found[j].kind == TrimmedNumber::move) farthest = std::max(farthest, std::abs(step[j]));
      Real fraction = Real(0.3) / farthest;
      const Real before = size_of(left);
      Changes trial;
      for (int halving = 0; halving < 12; ++halving, fraction /= 2) {
        for (std::size_t j = 0; j < columns; ++j) trial[j] = x[j] - fraction * step[j];
        if (!evaluate(trial, next) && size_of(next) < before) break;
      }
      if (!(size_of(next) < before)) break;
      x = trial, left = next;
    }
    if (const Fault fault = evaluate(x, left)) return fault;
    for (std::size_t i = 0; i < rows; ++i) left[i] /= sizes_[i];
    const std::size_t worst = index_of_largest(left, rows);
    if (!(largest(left) <= Real(1e-9))) return missed(worst < speeds ? FaultList::speeds : FaultList::aims, worst < speeds ? worst : worst - speeds, sizes_[worst] * left[worst]);
    for (std::size_t j = 0; j < columns; ++j)
      if (const Real value = Real(Trim::found[j].begin) + Real(Trim::found[j].size) * x[j]; !(value >= Trim::found[j].lower && value <= Trim::found[j].upper))
        return missed(FaultList::aims, Trim::aims + j, value);
    return {};
  }

  static Fault missed(FaultList list, std::size_t index, Real value) {
    return {.cause = Cause::no_trim, .list = list, .index = static_cast<int>(index), .value = static_cast<double>(value), .at_start = true};
  }

  static std::size_t index(const TrimmedNumber& each) { return static_cast<std::size_t>(each.index); }

  Real size_of(const Left& left) const {
    Real sum(0);
    for (std::size_t i = 0; i < rows; ++i) sum += left[i] / sizes_[i] * (left[i] / sizes_[i]);
    return sum;
  }

  /// The residuals of rates and aims with changes of what is found, in its sizes.
  Fault evaluate(const Changes& x, Left& left) {
    StateOf<M>& start = sim_.start_state();
    Speeds<M> moves(speeds);
    start = base_;
    for (std::size_t j = 0; j < columns; ++j) {
      const TrimmedNumber& each = Trim::found[j];
      const Real change = Real(each.size) * x[j], value = Real(each.begin) + change;
      switch (each.kind) {
        case TrimmedNumber::move: moves[index(each)] = change; break;
        case TrimmedNumber::rate: start.v[index(each)] += change; break;
        case TrimmedNumber::input: sim_.inputs().put(index(each), sim_.state().t, value, Real(0), Real(0)); break;
        case TrimmedNumber::parameter: sim_.parameters()[index(each)] = value; break;
      }
    }
    for (std::size_t i = 0; i < speeds; ++i)
      if (Trim::follows[i]) start.v[i] = Real(0);
    displace(charts_of(sim_.mechanism()), base_.q, moves.data(), start.q);
    StateOf<M> state = start;
    if (const Fault fault = sim_.place(state)) return fault;
    for (std::size_t i = 0; i < speeds; ++i) left[i] = Trim::steady[i] ? state.vdot[i] : Real(0);
    if constexpr (Trim::aims > 0) sim_.mechanism().aims(state.q.data(), state.v.data(), state.vdot.data(), state.lambda.data(), left.data() + speeds);
    return {};
  }

  /// The step of least norm, and the sizes of residuals: their changes by what is found.
  Fault find_step(const Changes& x, const Left& left, Changes& step) {
    Left forward, backward;
    sizes_.fill(Real(0));
    for (std::size_t j = 0; j < columns; ++j) {
      for (Left* at : {&forward, &backward}) {
        Changes beside = x;
        beside[j] += at == &forward ? Real(1e-5) : Real(-1e-5);
        if (const Fault fault = evaluate(beside, *at)) return fault;
      }
      for (std::size_t i = 0; i < rows; ++i) sizes_[i] = std::max(sizes_[i], std::abs(matrix_[j * rows + i] = (forward[i] - backward[i]) / Real(2e-5)));
    }
    Real most(0);
    for (std::size_t i = 0; i < M::sizes.joint_speeds(); ++i) most = std::max(most, sizes_[i]);
    const std::span<const double> nominals = nominals_of(sim_.mechanism());
    for (std::size_t i = 0; i < speeds; ++i)  // what rounding alone changes
      sizes_[i] = std::max(sizes_[i], i < M::sizes.joint_speeds() ? Real(1e-7) * most : Real(1e-3 * size_at(nominals, i, speeds)));
    Changes scales, scratch, one, other;
    Fixed<std::size_t, columns> order;
    Left right;
    for (std::size_t i = 0; i < rows; ++i) {
      if (!(sizes_[i] > Real(0))) sizes_[i] = std::max(Real(1), std::abs(left[i]));
      right[i] = left[i] / sizes_[i];
    }
    for (std::size_t j = 0; j < columns; ++j) {
      Real* column = matrix_.data() + j * rows;
      for (std::size_t i = 0; i < rows; ++i) scales[j] = std::max(scales[j], std::abs(column[i] /= sizes_[i]));
      if (Trim::found[j].kind == TrimmedNumber::move || !(scales[j] > Real(0))) scales[j] = Real(1);
      for (std::size_t i = 0; i < rows; ++i) column[i] /= scales[j];
    }
    dense::LeastSquares<Real> squares({matrix_.data(), rows, columns}, order.data(), one.data(), other.data());
    squares.decompose(Real(1e-7));
    squares.solve(right.data(), step.data(), scratch.data());
    for (std::size_t j = 0; j < columns; ++j) step[j] /= scales[j];
    return {};
  }

  Checked& simulation_;
  Sim& sim_;
  const StateOf<M> given_;
  const Coordinates<M, unsigned char> coordinates_;
  const SpeedFlags<M> speeds_;
  StateOf<M> base_ = given_;
  Left sizes_;
  Fixed<Real, rows * columns> matrix_;
};

}  // namespace cutjoint
