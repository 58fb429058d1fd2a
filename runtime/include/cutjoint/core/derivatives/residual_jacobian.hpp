// Derivatives of accelerations by the linearised force residual.
#pragma once

#include "cutjoint/core/numbers/bordered.hpp"
#include "cutjoint/core/inputs/inputs.hpp"
#include "cutjoint/core/constraints/stabilisation.hpp"
#include "cutjoint/core/mechanism/transposed_charts.hpp"

namespace cutjoint {

/// The force residual and the second rates of loops, r(q, v, vdot, lambda, inputs, parameters) = 0, of a mechanism M, with the Jacobian by
/// generated code C and its sparsity by T: starts of rows, of their derivatives with respect to accelerations and multipliers, columns, and positions in the output.  Parameters enter by `loaded` values that depend on them alone.
///
/// At a state the Jacobian is evaluated and a matrix decomposed once; each seed takes products and a solution.  Constraints have a small compliance,
/// a fraction of that of their penalties, which iterative refinement removes: dependent equations get the multipliers of the augmented update.
/// The last `kept` states are cached: the beginning and the end of a step, or all that an explicit step visits for each group of seeds.
template <class M, template <class> class C, class T, std::size_t kept = 2>
class ResidualJacobian {
 public:
  template <std::size_t states>
  using Keeping = ResidualJacobian<M, C, T, states>;
  static constexpr std::size_t n = M::sizes.speeds, m = M::sizes.equations, coordinates = M::sizes.coordinates, inputs = numbers_per_input * M::sizes.inputs,
                               exogenous = inputs + M::sizes.discrete, loaded = T::loaded;
  using Places = T;
  using Changes = std::array<DualPart, n + m>;
  using Numbers = Fixed<double, n + m>;
  static constexpr std::size_t first_speed = coordinates, first_input = first_speed + n,
                               first_loaded = first_input + exogenous, first_acceleration = first_loaded + loaded,
                               first_multiplier = first_acceleration + n, width = first_multiplier + m;
  static std::span<const Chart> charts() { return M::charts; }
  static constexpr bool has_balls = coordinates > M::sizes.joint_speeds();
  using JacobianEntries = Fixed<double, T::starts[n + m]>;  ///< in the order of the output

  void drive_by([[maybe_unused]] const InputSource<double>& source) {
    if constexpr (exogenous > 0) plain_.drive_by(source);
  }

  /// The parameters of a simulation, with zero derivatives.
  void load(auto& simulation) {
    [[maybe_unused]] const auto& penalties = simulation.penalties();
    load_mechanism(plain_, simulation.parameters().data(), simulation.roads(), simulation.stabilisation(), penalties);
    for (At& x : at_) x.is_found = false;
    leaves_out_ = false;
    by_.fill({});
    are_changing_ = false;
    for (std::size_t cut = 0, i = 0; i < m; ++i) {
      while (cut + 1 < M::sizes.cuts && static_cast<std::size_t>(M::cuts[cut + 1]) <= i) ++cut;
      compliance_[i] = 1e-3 / penalties[cut];
    }
  }

  /// Their derivatives.
  template <class Roads, class Penalties>
  void load_changes([[maybe_unused]] const Dual* parameters, [[maybe_unused]] const Roads* roads, [[maybe_unused]] const StabilisationSettings& stabilisation,
                    [[maybe_unused]] const Penalties& penalties) {
    if constexpr (loaded > 0) {
      const auto changes = [](const Dual& x) { return !x.derivative.is_zero(); };
      const bool were_changing = std::exchange(are_changing_, std::any_of(parameters, parameters + M::sizes.parameters, changes));
      if (!are_changing_ && !were_changing) return;
      Fixed<Dual, loaded> values;
      load_mechanism(with_changes_, parameters, roads, stabilisation, penalties);
      with_changes_.loaded_values(values.data());
      for (std::size_t i = 0; i < loaded; ++i) by_[first_loaded + i].derivative = values[i].derivative;
    }
  }

  /// Go to a state, and evaluate the Jacobian unless it is cached.
  template <class Q, class V, class L, class Inputs>
  void find(double t, const Q& q, const V& v, const V& vdot, const L& lambda, const Inputs& u) {
    for (std::size_t i = 0; i < kept; ++i, now_ = (now_ + 1) % kept)
      if (at_[now_].is_at(t, q, v, u) && std::ranges::equal(vdot, at_[now_].vdot) && std::ranges::equal(lambda, at_[now_].lambda)) return;
    now_ = (now_ + 1) % kept;
    At& x = at_[now_];
    x.is_found = true;
    x.t = t;
    std::copy(q.begin(), q.end(), x.q.begin());
    std::copy(v.begin(), v.end(), x.v.begin());
    std::copy(vdot.begin(), vdot.end(), x.vdot.begin());
    std::copy(lambda.begin(), lambda.end(), x.lambda.begin());
    std::copy(u.begin(), u.end(), x.u.begin());
    find(x, x.derivative);
    x.decomposed_for = none;
  }

  /// Accelerations and multipliers of a state whose Jacobian is cached; false if it is not.
  bool recall(double t, const auto& q, const auto& v, const auto& u, auto& vdot, auto& lambda) const {
    const auto at = std::ranges::find_if(at_, [&](const At& x) { return x.is_at(t, q, v, u); });
    if (at == std::end(at_)) return false;
    std::copy(at->vdot.begin(), at->vdot.end(), vdot.begin());
    std::copy(at->lambda.begin(), at->lambda.end(), lambda.begin());
    return true;
  }

  /// The Jacobian at a state.
  void find(const auto& x, JacobianEntries& derivative) {
    plain_.begin_step(x.t, 1.0);
    plain_.residual_jacobian(x.q.data(), x.v.data(), x.vdot.data(), x.lambda.data(), derivative.data());
    for (std::size_t k = 0; leaves_out_ && k < length; ++k)
      if (double& x = derivative[T::derivatives[k]]; !(x - x == 0.0)) x = 0.0, is_left_out_[T::columns[k]] = true;
  }

  /// From now on leave out infinite derivatives: seeds must not change their variables.  False if they were left out before.
  bool leave_out_infinite() {
    for (At& x : at_) x.is_found = false, x.decomposed_for = none, x.derivative.fill(0.0);
    is_left_out_.fill(false);
    return !std::exchange(leaves_out_, true);
  }

  /// Try something with infinite derivatives left out, as above, and take them in again.
  bool without_infinite(auto attempt) {
    const bool left_out = leaves_out_;
    const auto columns = is_left_out_;
    leave_out_infinite();
    const bool is_found = attempt();
    for (At& x : at_) x.is_found = false;
    leaves_out_ = left_out, is_left_out_ = columns;
    return is_found;
  }

  /// Minus the Jacobian's product with derivatives of all but accelerations and multipliers, row by row; `at` has the places of rows.
  void subtract_jvp(const JacobianEntries& derivative, const auto& q, const auto& v, std::span<const Dual> inputs, DualPart* rows, const std::uint32_t* at = in_order.data()) {
    const auto put = [this](std::size_t first, const auto& numbers) {
      for (std::size_t j = 0; j < numbers.size(); ++j) by_[first + j].derivative = numbers[j].derivative;
    };
    put(0, q), put(first_speed, v), put(first_input, inputs);
    for (std::size_t i = 0; i < n + m; ++i) {
      Tangents sum{};
      for (std::size_t k = T::starts[i]; k < T::middles[i]; ++k) sum -= derivative[T::derivatives[k]] * by_[T::columns[k]].derivative;
      rows[at[i]].derivative = sum;
    }
  }

  /// Subtract the derivatives with respect to the time at a state, along `dt`: of what depends on it explicitly.
  void subtract_time_jvp([[maybe_unused]] const auto& x, [[maybe_unused]] const Tangents& dt, [[maybe_unused]] DualPart* rows, [[maybe_unused]] const std::uint32_t* at = in_order.data()) {
    if constexpr (requires { &C<double>::residual_by_time; }) {
      if (dt.is_zero()) return;
      Numbers by_time;
      plain_.begin_step(x.t, 1.0);
      plain_.residual_by_time(x.q.data(), x.v.data(), x.vdot.data(), x.lambda.data(), by_time.data());
      for (std::size_t i = 0; i < n + m; ++i) rows[at[i]].derivative -= along(by_time[i], dt);
    }
  }

  /// Solve with one or several stacked matrices over accelerations and multipliers, in place, and refine for the compliance of constraints.
  /// False if a number is not finite, or loops stay open.
  template <class Matrix, class Unknowns>
  bool solve(const Matrix& matrix, Unknowns& change) const {
    std::array<DualPart, Matrix::size> found;
    for (std::size_t i = 0; i < found.size(); ++i) found[slots<Matrix>[i]] = change[i];
    return solve(matrix, found, change);
  }

  /// Derivatives of the smallest displacement or velocity change, in the metric of the masses, that removes violations; false if they remain.
  bool close_violations(const Fixed<Dual, m>& violations, Changes& change) {
    At& x = at_[now_];
    for (std::size_t i = 0; i < n; ++i) change[i] = {};
    for (std::size_t i = 0; i < m; ++i) change[n + i].derivative = -violations[i].derivative;
    return decompose_plain(x) && solve(x.matrix, change);
  }

  /// The same for transposed matrices and plain numbers.
  template <class Matrix, std::size_t size>
  bool solve_transposed(const Matrix& matrix, Fixed<double, size>& x) const {
    const auto solve = [&matrix](Fixed<double, size>& unknowns) {
      std::array<double, size> found;
      for (std::size_t i = 0; i < size; ++i) found[slots<Matrix>[i]] = unknowns[i];
      matrix.solve_transposed(found.data());
      for (std::size_t i = 0; i < size; ++i) unknowns[i] = found[slots<Matrix>[i]];
    };
    solve(x);
    Fixed<double, size> more = x;
    double before = 1.0;
    for (int iteration = 0; m > 0 && iteration < 16; ++iteration) {
      double share[2]{}, whole[2]{};  // of the adjoints of the equations of motion, and of those of constraints
      for (std::size_t i = 0; i < size; ++i) more[i] *= i % (n + m) < n ? 0.0 : -compliance(i % (n + m) - n);
      solve(more);
      for (std::size_t i = 0; i < size; ++i) {
        x[i] += more[i];
        const std::size_t of = i % (n + m) < n ? 0 : 1;
        share[of] = std::max(share[of], std::abs(more[i])), whole[of] = std::max(whole[of], std::abs(x[i]));
      }
      const double left = std::max(share[0] / std::max(whole[0], 1e-300), share[1] / std::max(whole[1], 1e-300));
      if (left * std::min(1.0, left / before) <= 1e-15 || (iteration > 0 && !(left < before))) break;
      before = left;
    }
    return std::all_of(x.begin(), x.end(), [](double each) { return each - each == 0.0; });
  }

  /// From derivatives with respect to the result of `close_violations` to those with respect to the violations.
  bool violations_vjp(const Fixed<double, n>& by_move, Fixed<double, m>& by_violation) {
    Numbers x;
    std::copy(by_move.begin(), by_move.end(), x.begin());
    At& at = at_[now_];
    if (!decompose_plain(at) || !solve_transposed(at.matrix, x)) return false;
    for (std::size_t i = 0; i < m; ++i) by_violation[i] = -x[n + i];
    return true;
  }

  /// The transpose of `subtract_jvp`, added to `by`.
  void vjp(const JacobianEntries& derivative, const double* by_rows, Fixed<double, first_acceleration>& by) const {
    for (std::size_t i = 0; i < n + m; ++i)
      for (std::size_t k = T::starts[i]; k < T::middles[i]; ++k) by[T::columns[k]] -= derivative[T::derivatives[k]] * by_rows[i];
  }

  /// Visit each derivative of some rows with respect to accelerations and multipliers: the row, the derivative's position, and the unknown.
  static void visit_unknowns(std::size_t first, std::size_t end, auto use) {
    for (std::size_t i = first; i < end; ++i)
      for (std::size_t k = T::middles[i]; k < T::starts[i + 1]; ++k) use(i, T::derivatives[k], T::columns[k] - first_acceleration);
  }

  /// Add the entries of the first rows in a stage to a matrix over unknowns of all stages: the row, the unknown's stage, the unknown, and the value.
  template <class Formula, class Add>
  static void gather_entries(const Formula& formula, std::size_t stage, const JacobianEntries& derivative, std::size_t rows, Add add) {
    for (std::size_t i = 0; i < rows; ++i)
      for (std::size_t k = T::starts[i]; k < T::middles[i]; ++k)
        for (std::size_t j = 0; T::columns[k] < first_input && j < Formula::stages; ++j)
          formula.template visit_weights<ResidualJacobian>(T::columns[k], stage, j, [&](std::size_t unknown, double share) { add(i, j, unknown, share * derivative[T::derivatives[k]]); });
    visit_unknowns(0, rows, [&](std::size_t i, std::size_t k, std::size_t unknown) { add(i, stage, unknown, derivative[k]); });
  }

  /// Derivatives of loaded values.
  const DualPart* changes() const { return by_.data() + first_loaded; }

  double compliance(std::size_t equation) const { return compliance_[equation]; }

  // Columns of coordinates: the velocity whose integral one is (the first of three for a quaternion), whether it is of a quaternion, of which ball, and its index there.
  static constexpr std::size_t balls = coordinates - M::sizes.joint_speeds();
  static std::size_t unknown_of(std::size_t column) { return columns.unknown[column]; }
  static bool is_quaternion(std::size_t column) { return columns.number[column] > 1; }
  static std::array<std::size_t, 2> ball_of(std::size_t column) { return {columns.ball[column], columns.place[column]}; }

  /// Derivatives of accelerations and multipliers at a state, whose time may change too; false if one is not finite, or the mass matrix is singular.
  bool solve(const auto& q, const auto& v, std::span<const Dual> inputs, Changes& change, const Tangents& dt) { return decompose_plain(at_[now_]) && solve_end(q, v, inputs, change, dt); }

  /// The same at the end of a trapezoidal step, whose state depends on them; after `decompose_end`.
  bool solve_end(const auto& q, const auto& v, std::span<const Dual> inputs, Changes& change, const Tangents& dt = {}) {
    Changes found;
    subtract_jvp(at_[now_].derivative, q, v, inputs, found.data(), order.data());
    subtract_time_jvp(at_[now_], dt, found.data(), order.data());
    return solve(at_[now_].matrix, found, change);
  }

  /// The transpose of `solve_end`: the solution replaces `by_end`, and derivatives with respect to all that `subtract_jvp` reads are added to `by`.
  bool end_vjp(Numbers& by_end, Fixed<double, first_acceleration>& by) const {
    if (!solve_transposed(at_[now_].matrix, by_end)) return false;
    vjp(at_[now_].derivative, by_end.data(), by);
    return true;
  }

  /// The same of `solve`.
  bool accelerations_vjp(Numbers& by_accelerations, Fixed<double, first_acceleration>& by) { return decompose_plain(at_[now_]) && end_vjp(by_accelerations, by); }

  /// Decompose r_vdot + h/2 r_v + h^2/4 r_q of the end of a trapezoidal step, with the weights of its formula; false if it is singular.
  bool decompose_end(double h, const auto& formula) {
    At& x = at_[now_];
    if (x.decomposed_for == h) return true;
    for (std::size_t column = 0; column < first_input; ++column) {
      std::size_t place = columns.share[column];
      formula.template visit_weights<ResidualJacobian>(column, 0, 0, [&](std::size_t, double share) { weights_[place++] = share; });
    }
    return decompose(x, h);
  }

  /// Whether `correct` has a matrix for the end of a step of this length.
  bool has_matrix_for(double h) const { return at_[now_].decomposed_for == h; }

  /// Corrections of accelerations, in place of their errors `left`, and of multipliers, `vjp`.
  void correct(Fixed<double, n>& left, Fixed<double, m>& vjp) {
    At& x = at_[now_];
    std::array<double, n + m> force;
    for (std::size_t i = 0; i < n + m; ++i) {
      double sum = 0.0;
      for (std::size_t k = T::middles[i]; k < T::starts[i + 1]; ++k)
        if (T::columns[k] < first_multiplier) sum += x.derivative[T::derivatives[k]] * left[T::columns[k] - first_acceleration];
      force[order[i]] = sum;
    }
    x.matrix.solve(force.data());
    for (std::size_t i = 0; i < n; ++i) left[i] = force[order[i]];
    for (std::size_t i = 0; i < m; ++i) vjp[i] = force[order[n + i]];
  }

 private:
  static constexpr double none = -1.0;
  static constexpr std::size_t length = T::starts[n + m];

  /// The unknown that each column depends on, and its weight's position; for a quaternion the first of three of both.
  struct Columns {
    std::array<std::uint32_t, width> unknown{}, share{}, number{};
    std::array<std::uint32_t, coordinates> ball{}, place{};

    constexpr Columns() {
      for (std::size_t i = 0; i < width; ++i) share[i] = static_cast<std::uint32_t>(i), number[i] = 1;
      for (std::size_t i = 0; i < n; ++i) unknown[first_speed + i] = static_cast<std::uint32_t>(i);
      for (std::size_t i = 0; i < n + m; ++i) unknown[first_acceleration + i] = static_cast<std::uint32_t>(i);
      std::uint32_t next = first_input, balls_before = 0;
      for (const Chart& chart : M::charts) {
        for (int i = 0; i < chart.scalars; ++i) unknown[static_cast<std::size_t>(chart.q + i)] = static_cast<std::uint32_t>(chart.v + i);
        for (std::uint32_t i = 0; chart.ball && i < 4; ++i, next += 3) {
          const std::size_t column = static_cast<std::size_t>(chart.q + chart.scalars) + i;
          unknown[column] = static_cast<std::uint32_t>(chart.v + chart.scalars), share[column] = next, number[column] = 3;
          ball[column] = balls_before, place[column] = i;
        }
        balls_before += chart.ball;
      }
    }
  };
  static constexpr Columns columns{};

  /// The position of each stacked unknown in a matrix, and in that of one stage.
  template <class Matrix>
  static constexpr auto slots = [] {
    std::array<std::uint32_t, Matrix::size> found{};
    for (std::size_t i = 0; i < Matrix::size; ++i) found[i] = static_cast<std::uint32_t>(Matrix::places.slot(i));
    return found;
  }();
  static constexpr auto& order = slots<Bordered<T>>;
  static constexpr auto in_order = [] {
    std::array<std::uint32_t, n + m> found{};
    for (std::size_t i = 0; i < n + m; ++i) found[i] = static_cast<std::uint32_t>(i);
    return found;
  }();

  /// The derivatives in the matrix, with their weights and positions: `weighted` ones first, for a quaternion by each of three velocities, then those by unknowns.
  struct Entry {
    std::uint32_t derivative, share, at;
  };
  static constexpr void visit_entries(bool are_weighted, auto use) {
    for (std::size_t i = 0; i < n + m; ++i)
      for (std::size_t k = T::starts[i]; k < T::starts[i + 1]; ++k)
        for (std::size_t c = T::columns[k], j = 0; (are_weighted ? c < first_input : c >= first_acceleration) && j < columns.number[c]; ++j)
          use(Entry{T::derivatives[k], static_cast<std::uint32_t>(columns.share[c] + j), static_cast<std::uint32_t>(Bordered<T>::places.of(i, columns.unknown[c] + j))});
  }
  static constexpr std::size_t count_entries(bool are_weighted) {
    std::size_t number = 0;
    visit_entries(are_weighted, [&](const Entry&) { ++number; });
    return number;
  }
  static constexpr std::size_t weighted = count_entries(true);
  static constexpr auto entries = [] {
    std::array<Entry, weighted + count_entries(false)> list{};
    std::size_t next = 0;
    for (const bool are_weighted : {true, false}) visit_entries(are_weighted, [&](const Entry& entry) { list[next++] = entry; });
    return list;
  }();

  /// A state, the Jacobian there, and a matrix as L U for the step length, or 0, `decomposed_for`.
  struct At {
    bool is_found = false;
    double t = 0.0, decomposed_for = none;
    Fixed<double, coordinates> q;
    Fixed<double, n> v, vdot;
    Fixed<double, m> lambda;
    Fixed<double, exogenous> u;
    JacobianEntries derivative;
    Bordered<T> matrix;

    bool is_at(double time, const auto& place, const auto& speed, const auto& input) const {
      return is_found && t == time && std::ranges::equal(place, q) && std::ranges::equal(speed, v) && std::ranges::equal(input, u);
    }
  };

  /// The sparsity of the matrix.
  static constexpr auto pattern = [] {
    typename Bordered<T>::Pattern found{};
    for (const Entry& entry : entries) found[entry.at] = true;
    for (std::size_t i = n; i < n + m; ++i) found[Bordered<T>::places.of(i, i)] = true;
    return found;
  }();

  bool decompose_plain(At& x) { return x.decomposed_for == 0.0 || decompose(x, 0.0); }

  bool decompose(At& x, double h) {
    const auto fill = [&] {
      x.matrix.clear();
      auto& of = x.matrix.entries();
      for (std::size_t k = 0; h > 0.0 && k < weighted; ++k) of[entries[k].at] += x.derivative[entries[k].derivative] * weights_[entries[k].share];
      for (std::size_t k = weighted; k < entries.size(); ++k) of[entries[k].at] += x.derivative[entries[k].derivative];
      for (std::size_t i = 0; i < m; ++i) of[Bordered<T>::places.of(n + i, n + i)] -= compliance_[i];
      return x.matrix.decompose(pattern);
    };
    const bool is_regular = fill() || fill();  // with other pivots if those of an earlier matrix have become small
    x.decomposed_for = is_regular ? h : none;
    return is_regular;
  }

  /// `solve` from the order of positions.
  template <class Matrix, std::size_t size, class Unknowns>
  bool solve(const Matrix& matrix, std::array<DualPart, size>& found, Unknowns& change) const {
    matrix.solve(found.data());
    Tangents odd{};
    for (const DualPart& along : found) odd += 0.0 * along.derivative;
    double sum = 0.0;
    for (std::size_t k = 0; k < seeds_at_once; ++k) sum += odd[k];
    const bool is_found = sum == 0.0 && close(matrix, found) && (!leaves_out_ || left_out_stay<Matrix>(found));
    for (std::size_t i = 0; i < size; ++i) change[i] = found[slots<Matrix>[i]];
    return is_found;
  }

  /// Whether the variables of left-out derivatives are constant.
  template <class Matrix, std::size_t size>
  bool left_out_stay(const std::array<DualPart, size>& found) const {
    for (std::size_t c = 0; c < width; ++c)
      if (is_left_out_[c]) {
        if (c < first_acceleration && !by_[c].derivative.is_zero()) return false;
        for (std::size_t j = 0; (c < first_input || c >= first_acceleration) && j < (is_quaternion(c) ? 3 : 1); ++j)
          for (std::size_t i = columns.unknown[c] + j; i < size; i += n + m)
            if (!found[slots<Matrix>[i]].derivative.is_zero()) return false;
      }
    return true;
  }

  /// The largest derivative of accelerations, or of multipliers, along each seed.
  template <class Matrix, std::size_t size>
  static Tangents largest(const std::array<DualPart, size>& changes, bool of_multipliers) {
    Tangents most{};
    for (std::size_t i = 0; i < size; ++i)
      if ((i % (n + m) >= n) == of_multipliers) {
        const Tangents& derivative = changes[slots<Matrix>[i]].derivative;
        most = larger(larger(derivative, -derivative), most);
      }
    return most;
  }

  static double share_of(const Tangents& part, const Tangents& whole) {
    double share = 0.0;
    for (std::size_t k = 0; k < seeds_at_once; ++k) share = std::max(share, part[k] > 0.0 ? part[k] / whole[k] : 0.0);
    return share;
  }

  /// Refine for the compliance of constraints, whose error decreases as the changes of multipliers do; false if that does not
  /// converge.
  template <class Matrix, std::size_t size>
  bool close(const Matrix& matrix, std::array<DualPart, size>& change) const {
    if constexpr (m > 0) {
      std::array<DualPart, size> more;
      const std::array<DualPart, size>* last = &change;
      for (int iteration = 0; iteration < 8; ++iteration) {
        const Tangents pulled = largest<Matrix>(*last, true);
        for (std::size_t i = 0; i < size; ++i) {
          const std::size_t place = slots<Matrix>[i], of = i % (n + m);
          more[place] = of < n ? DualPart{} : (*last)[place] * -compliance_[of - n];
        }
        matrix.solve(more.data());
        for (std::size_t i = 0; i < size; ++i) change[i] += more[i];
        if (share_of(largest<Matrix>(more, false), largest<Matrix>(change, false)) * std::min(1.0, share_of(largest<Matrix>(more, true), pulled)) <= 1e-13) return true;
        last = &more;
      }
      return false;
    }
    return true;
  }

  C<double> plain_;
  C<Dual> with_changes_;
  At at_[kept];
  std::size_t now_ = 0;
  bool are_changing_ = false, leaves_out_ = false;
  Fixed<bool, width> is_left_out_;  ///< columns of left-out derivatives
  Fixed<DualPart, first_acceleration> by_;  ///< of all but accelerations and multipliers
  Fixed<double, m> compliance_;  ///< of constraints, in the matrix
  Fixed<double, first_input + 12 * balls> weights_;  ///< of columns in the matrix, for quaternions by each of three velocities
};

}  // namespace cutjoint
