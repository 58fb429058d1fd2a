// A mechanism as a differential equation for explicit methods.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>
#include <utility>

#include "cutjoint/core/numbers/arrays.hpp"
#include "cutjoint/core/simulation/fault.hpp"
#include "cutjoint/core/numbers/largest.hpp"
#include "cutjoint/core/constraints/projection.hpp"
#include "cutjoint/core/roads/road.hpp"
#include "cutjoint/core/runge_kutta/solved.hpp"
#include "cutjoint/core/mechanism/state.hpp"
#include "cutjoint/core/stepping/indicator_cells.hpp"

namespace cutjoint::runge_kutta {

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
    if (cells_.empty()) return false;
    evaluate_at(t, y);
    return cells_.seek();
  }

  /// The first of them; the number of indicators if there is none.
  std::size_t found(Real t, const Vector& y) {
    if (cells_.empty()) return 0;
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
    if (cells_.empty()) return;
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
