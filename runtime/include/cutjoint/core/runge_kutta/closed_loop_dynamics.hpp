// A mechanism as a differential equation for explicit methods.
#pragma once

#include "cutjoint/core/constraints/projection.hpp"
#include "cutjoint/core/mechanism/relative.hpp"
#include "cutjoint/core/stepping/indicator_cells.hpp"

namespace cutjoint::runge_kutta {

/// Multipliers are `corrected` from evaluation to evaluation, or `solved` for in each by passes from zero, so that they depend on the state alone.
/// Near singular poses, in nearly unconstrained directions, passes leave part of the forces missing.  `solved` accepts this: a single
/// evaluation with more passes would look like a jump to an error estimate.  `completed` is for rules without one.
enum class Multipliers { corrected, solved, completed };

/// The differential equation of a mechanism.  Near a singular pose completed multipliers are found by GCR (projection.hpp) in the nearest
/// consistent state, since violations would cause large accelerations there.
template <Mechanism M>
class Solved : public Relative<M, Solved<M>> {
 public:
  using Base = Relative<M, Solved<M>>;
  using typename Base::Real;

  Solved(M& mechanism, Real tolerance, Multipliers multipliers)
      : Base(mechanism, tolerance), projection_(mechanism), multipliers_(multipliers), first_lambda_(correction_), trial_(correction_), left_(correction_),
        first_vdot_(correction_.empty() ? 0 : state_.v.size()) {}

  Projection<M>& projection() { return projection_; }

  /// Take so many passes in each evaluation, and one iteration of each projection; 0: as many as needed.
  void fix_passes(int number) { fixed_ = number; }

  /// The largest change of the accelerations by the last of so many passes, relative to 1 + the largest of them; infinite for one pass.
  Real change() const { return change_; }

  /// Find accelerations and multipliers of the state.
  void find_multipliers() {
    if (fixed_ > 0 && !correction_.empty()) take_passes();
    else if (multipliers_ == Multipliers::corrected) this->correct_multipliers();
    else if (experience_.weak) settle();
    else solve_multipliers();
  }

 protected:
  using Base::correction_, Base::experience_, Base::mechanism_, Base::state_, Base::tolerance_;

  Projection<M> projection_;
  const Multipliers multipliers_;
  int fixed_ = 0;
  Real change_{0};

 private:
  static constexpr int trusted = 32, soon = 4, most = 4;

  Real enough() const { return std::max(tolerance_, Real(1e-9)) * acceleration_size(state_.vdot, scaled_nominals_of(mechanism_)); }

  /// From zero multipliers by as many passes as the last check found sufficient.  A check takes one more, and further ones as long as each changes
  /// the accelerations much less than the one before.  Completed ones are checked more often, near a singular pose always, since a step may
  /// cross it.
  void solve_multipliers() {
    const bool checks = experience_.age >= trusted, completes = multipliers_ == Multipliers::completed;
    forget();
    Real last = std::numeric_limits<Real>::infinity();
    for (int pass = 1; pass <= most; ++pass) {
      this->add_pass();
      if (correction_.empty()) return;
      if (!checks && pass == experience_.passes) break;
      if (!checks) continue;
      if (pass == 1) {
        keep();
        continue;
      }
      const Real change = this->largest_change();
      const bool falls = change < last / Real(100);
      if (!falls && completes) return settle();
      experience_.passes = falls ? pass - 1 : 1;
      if (pass == 2) experience_.age = !completes ? 0 : change > enough() / Real(10) ? trusted : trusted - soon;
      if (!falls) {
        std::copy_n(first_vdot_.begin(), first_vdot_.size(), state_.vdot.begin());
        state_.lambda = first_lambda_;
      }
      if (!falls || change <= enough()) break;
      last = change;
    }
    ++experience_.age;
  }

  void take_passes() {
    forget();
    for (int pass = 0; pass < fixed_; ++pass) this->add_pass();
    const Real change = fixed_ > 1 ? this->largest_change() / acceleration_size(state_.vdot, scaled_nominals_of(mechanism_)) : std::numeric_limits<Real>::infinity();
    if (!(change <= change_)) change_ = change;
  }

  void keep() {
    std::copy_n(state_.vdot.begin(), first_vdot_.size(), first_vdot_.begin());
    first_lambda_ = state_.lambda;
  }

  void forget() { std::fill(state_.lambda.begin(), state_.lambda.end(), Real(0)); }

  /// Near a singular pose; left when passes suffice again.
  void settle() {
    projection_.close_fully(true);
    (void)projection_.positions(state_), (void)projection_.velocities(state_);
    projection_.close_fully(false);
    forget();
    experience_.age = trusted;
    experience_.weak = !is_enough();
    if (!experience_.weak) return;
    for (std::size_t i = 0; i < correction_.size(); ++i) state_.lambda[i] -= correction_[i];
    Real rest = largest(correction_), share(1e-6);
    for (int round = 0; round < 4; ++round) {
      const Real moved = solve_left(share), next = largest(correction_), owed = moved * (next / rest);
      if (owed <= enough() || !(next < rest / Real(2))) break;
      share = std::max(Real(1e-6), Real(0.3) * enough() / owed);
      rest = next;
    }
  }

  /// Passes from zero multipliers as elsewhere; whether they converge quickly enough.
  bool is_enough() {
    Real last = std::numeric_limits<Real>::infinity();
    for (int pass = 1; pass <= most; ++pass) {
      this->add_pass();
      if (pass == 1) continue;
      const Real change = this->largest_change();
      experience_.passes = pass - 1;
      if (change <= enough()) return true;
      if (!(change < last / Real(100))) break;
      last = change;
    }
    return false;
  }

  /// A correction of the multipliers, which leaves a fraction of their error; returns the change of the accelerations.
  Real solve_left(Real share) {
    keep();
    left_ = correction_;
    auto& solver = projection_.solver();
    solver.solve(left_, Real(1e-4), share, true, [this](const Equations<M>& w, Speeds<M>& step, Equations<M>& closed) {
      for (std::size_t i = 0; i < w.size(); ++i) trial_[i] = first_lambda_[i] + w[i];
      evaluate(trial_);
      for (std::size_t i = 0; i < w.size(); ++i) closed[i] = left_[i] - correction_[i];
      for (std::size_t i = 0; i < step.size(); ++i) step[i] = state_.vdot[i] - first_vdot_[i];
    });
    for (std::size_t i = 0; i < left_.size(); ++i) state_.lambda[i] = first_lambda_[i] + solver.found()[i];
    evaluate(state_.lambda);
    for (std::size_t i = 0; i < first_vdot_.size(); ++i) first_vdot_[i] -= state_.vdot[i];
    return largest(first_vdot_, scaled_nominals_of(mechanism_));
  }

  void evaluate(const Equations<M>& lambda) {
    mechanism_.evaluate(state_.q.data(), state_.v.data(), lambda.data(), state_.vdot.data(), correction_.data());
    ++experience_.evaluations;
  }

  Equations<M> first_lambda_, trial_, left_;
  Array<M, static_sizes<M>().equations == 0 ? 0 : static_sizes<M>().speeds> first_vdot_;
};

/// The differential equation of a mechanism; all or none of its event indicators are evaluated at each stage, and loops are projected after each step.
template <Mechanism M>
class ClosedLoopDynamics : public Solved<M> {
 public:
  using Real = typename M::real_type;
  using typename Solved<M>::Vector;

  ClosedLoopDynamics(M& mechanism, const stepping::IndicatorCells<M>& cells, Real tolerance, Multipliers multipliers)
      : Solved<M>(mechanism, tolerance, multipliers), cells_(cells), history_{state_.lambda, state_.lambda}, residual_(state_.lambda),
        rate_(state_.lambda), speeds_(state_.v) {}

  /// Take over a start in its present mode.
  Vector begin(const StateOf<M>& start) {
    Vector y = Solved<M>::begin(start);
    adopt(start.t, y);
    history_.last = start.lambda;
    return y;
  }

  /// Begin an attempt of a step from t with the multipliers of the last step, not those of a rejected attempt.
  void begin_attempt(Real t) {
    cells_.begin(t);
    this->change_ = Real(0);
    if (history_.known < 2) state_.lambda = history_.last;
  }

  /// The derivative at a stage. Unless it is required, it is skipped if the attempt has left the mode. Returns whether it was found.
  bool derive(Real t, const Vector& y, Vector& derivative, bool by_all_means = true) {
    this->begin_at(t, y);
    if (!cells_.empty()) {
      evaluate_indicators();
      cells_.look(t);
      cells_.pass(t);
      if (!by_all_means && cells_.crossed()) return false;
    }
    predict(t);
    this->find_derivative(derivative);
    return true;
  }

  /// The derivative at a stage of the interpolant: it does not affect later evaluations, and indicators are not evaluated.
  void derive_between(Real t, const Vector& y, Vector& derivative) {
    const auto before = this->experience_;
    complete_ = state_;
    predict(t);
    Solved<M>::derive(t, y, derivative);
    std::swap(complete_, state_);
    const long evaluations = this->experience_.evaluations;
    this->experience_ = before;
    this->experience_.evaluations = evaluations;
  }

  /// Normalise quaternions, and project positions and velocities onto the loops.
  Fault project(Real t, Vector& y) {
    Solved<M>::project(t, y);
    if (state_.lambda.empty()) return {};
    if (this->fixed_ > 0) {
      this->begin_at(t, y);
      projection_.approach(state_);
      this->put(state_, y);
      return {};
    }
    this->take(t, y);
    projection_.close_fully(this->experience_.weak);
    speeds_ = state_.v;
    const Fault fault = projection_.close(state_);
    projection_.close_fully(false);
    if (fault) return fault;
    if (leaps()) state_.v = speeds_;
    this->put(state_, y);
    return {};
  }

  /// The largest residuals of the loops in a state.
  Residuals residuals(Real t, const Vector& y) {
    this->begin_at(t, y);
    mechanism_.constraint_residual(state_.q.data(), state_.v.data(), residual_.data(), rate_.data());
    return {static_cast<double>(largest(residual_)), static_cast<double>(largest(rate_)), 0.0};
  }

  /// Put y into a state, with accelerations and multipliers if guides need them.
  void inspect(Real t, const Vector& y, StateOf<M>& state) {
    if (mechanism_.description().driven) {
      state = this->complete(t, y);
      return;
    }
    state.t = t;
    const auto middle = y.begin() + static_cast<std::ptrdiff_t>(state.q.size());
    std::copy(y.begin(), middle, state.q.begin());
    std::copy(middle, y.end(), state.v.begin());
  }

  /// Collect the indicators by which a state has left the mode; return whether there are any.
  bool seek(Real t, const Vector& y) {
    evaluate_at(t, y);
    return cells_.seek();
  }

  /// The first of them; the number of indicators if there is none.
  std::size_t found(Real t, const Vector& y) {
    evaluate_at(t, y);
    return cells_.found();
  }

  /// Accept a step that ended at t with its last stage; the mode continues.
  void advance(Real t) {
    cells_.advance();
    history_.last.swap(history_.before_last);
    std::swap(history_.last_time, history_.before_last_time);
    history_.last = state_.lambda;
    history_.last_time = t;
    history_.known = std::min(history_.known + 1, 2);
  }

  /// Enter the mode of a state.
  void adopt(Real t, const Vector& y) {
    history_.known = 0;
    evaluate_at(t, y);
    cells_.adopt();
  }

  stepping::IndicatorCells<M>& cells() { return cells_; }

  /// Multipliers at the ends of the last two steps.
  struct History {
    Equations<M> last, before_last;
    Real last_time{0}, before_last_time{0};
    int known = 0;  ///< steps
  };

  /// Memory of the next steps.
  struct Memory {
    typename stepping::IndicatorCells<M>::Memory cells;
    History history;
    typename Solved<M>::Experience experience;
    Equations<M> lambda;
  };

  Memory memory() const {
    return {.cells = cells_.memory(), .history = history_, .experience = this->experience_, .lambda = state_.lambda};
  }

  void restore(const Memory& memory) {
    cells_.restore(memory.cells);
    history_ = memory.history;
    this->experience_ = memory.experience;
    state_.lambda = memory.lambda;
  }

 private:
  using Solved<M>::complete_, Solved<M>::mechanism_, Solved<M>::projection_, Solved<M>::state_;

  /// Whether the projection moved velocities far, as near a singular pose.  In a direction that loops constrain by 1e-6, rounding of positions
  /// rotates projected velocities; steps that end there would lose energy, those that cross the pose do not.
  bool leaps() {
    using std::abs;
    if (this->multipliers_ != Multipliers::solved) return false;
    const std::span<const double> nominals = scaled_nominals_of(mechanism_);
    const std::size_t n = speeds_.size();
    Real moved(0);
    for (std::size_t i = 0; i < n; ++i) moved = std::max(moved, abs(state_.v[i] - speeds_[i]) / Real(size_at(nominals, i, n)));
    if (!(moved > Real(1e-6) * speed_size(speeds_, arm_of(mechanism_), nominals))) return false;
    mechanism_.constraint_residual(state_.q.data(), speeds_.data(), residual_.data(), rate_.data());
    return largest(rate_) < Real(1e-5) * moved;
  }

  /// Initial multipliers: extrapolated linearly from the ends of the last two steps, or those of the previous stage.
  void predict(Real t) {
    const auto& [last, before_last, last_time, before_last_time, known] = history_;
    if (known < 2 || this->multipliers_ != Multipliers::corrected) return;
    const Real share = (t - last_time) / (last_time - before_last_time);
    for (std::size_t i = 0; i < last.size(); ++i) state_.lambda[i] = last[i] + share * (last[i] - before_last[i]);
  }

  void evaluate_at(Real t, const Vector& y) {
    if (cells_.empty()) return;
    this->begin_at(t, y);
    evaluate_indicators();
  }

  void evaluate_indicators() {
    if constexpr (stepping::IndicatorCells<M>::has_indicators) mechanism_.events(state_.q.data(), state_.v.data(), cells_.values());
  }

  stepping::IndicatorCells<M> cells_;
  History history_;
  Equations<M> residual_, rate_;
  Speeds<M> speeds_;  ///< before the projection
};

}  // namespace cutjoint::runge_kutta
