// A mechanism in relative coordinates as an ordinary differential equation.
#pragma once

#include <limits>

#include "cutjoint/core/mechanism/retraction.hpp"
#include "cutjoint/core/mechanism/state.hpp"

namespace cutjoint {

/// y = (q, v).  Each evaluation corrects the multipliers until the remaining error of accelerations is at most the fraction `tolerance`.
/// Then no penalty affects them, and loops drift by the integrator's error alone.  A derived class `Solving` may find them another way.
template <Mechanism M, class Solving = void>
class Relative {
 public:
  using Real = typename M::real_type;
  using Subject = M;
  using Vector = Array<M, static_sizes<M>().coordinates + static_sizes<M>().speeds>;  ///< y and its derivative

  Relative(M& mechanism, Real tolerance)
      : mechanism_(mechanism), state_(design_state(mechanism)), complete_(state_),
        tolerance_(std::max(tolerance, 16 * std::numeric_limits<Real>::epsilon())), correction_(state_.lambda.size()), before_(state_.v.size()) {}

  const M& subject() const { return mechanism_; }
  std::size_t size() const { return state_.q.size() + state_.v.size(); }

  /// Take over coordinates, velocities, and initial multipliers.
  Vector begin(const StateOf<M>& start) {
    state_ = start;
    Vector y(size());
    put(state_, y);
    return y;
  }

  void derive(Real t, const Vector& y, Vector& derivative) {
    begin_at(t, y);
    find_derivative(derivative);
  }

  /// Normalise quaternions.
  void project(Real, Vector& y) const { normalise<Real>(charts_of(mechanism_), y.data()); }

  /// Multipliers of the last evaluation.
  const Equations<M>& multipliers() const { return state_.lambda; }

  /// The state with its accelerations and multipliers.
  const StateOf<M>& solve(Real t, const Vector& y) {
    begin_at(t, y);
    accelerate();
    return state_;
  }

  /// Find accelerations and multipliers of a state.
  void find_accelerations(StateOf<M>& state) {
    state_ = state;
    mechanism_.begin_step(state_.t, Real(1));
    accelerate();
    state = state_;
  }

  /// The state for an observer: later evaluations and counts are unaffected.
  const StateOf<M>& complete(Real t, const Vector& y) {
    const Experience experience = experience_;
    complete_ = state_;
    solve(t, y);
    std::swap(complete_, state_);
    experience_ = experience;
    return complete_;
  }

  long evaluations() const { return experience_.evaluations; }

  /// Memory of the next evaluation, besides multipliers.
  struct Experience {
    Real effect{0};        ///< of a unit correction on the accelerations
    int passes = 1;        ///< that solve for the multipliers
    int weak = 0;          ///< whether a direction is nearly unconstrained, 0 or 1
    long age = 1000;       ///< evaluations since this was measured
    long evaluations = 0;
  };

 protected:
  /// Coordinates and velocities of a state, concatenated.
  static void put(const StateOf<M>& state, Vector& y) {
    std::copy(state.v.begin(), state.v.end(), std::copy(state.q.begin(), state.q.end(), y.begin()));
  }

  void take(Real t, const Vector& y) {
    state_.t = t;
    std::copy(y.begin(), y.begin() + middle(), state_.q.begin());
    std::copy(y.begin() + middle(), y.end(), state_.v.begin());
  }

  /// Accept a state with its values at the beginning of a step.
  void begin_at(Real t, const Vector& y) {
    take(t, y);
    mechanism_.begin_step(t, Real(1));
  }

  /// The derivative at that state.
  void find_derivative(Vector& derivative) {
    accelerate();
    coordinate_rates<Real>(charts_of(mechanism_), state_.q.data(), state_.v.data(), derivative.data());
    std::copy(state_.vdot.begin(), state_.vdot.end(), derivative.begin() + middle());
  }

  M& mechanism_;
  StateOf<M> state_, complete_;
  Experience experience_;
  Real tolerance_;
  Equations<M> correction_;

  /// Each pass adds its correction to the multipliers; its effect on accelerations is known from a recent pass.
  void correct_multipliers() {
    constexpr int most = 40, fresh = 8;
    Real last = std::numeric_limits<Real>::infinity(), owed(0);
    for (int pass = 0; pass < most; ++pass) {
      add_pass();
      if (correction_.empty()) return;
      const Real size = acceleration_size(state_.vdot, scaled_nominals_of(mechanism_)), change = pass > 0 ? largest_change() : Real(0);
      if (pass == 1 && owed > Real(0)) {
        experience_.effect = change / owed;
        experience_.age = 0;
      }
      owed = largest(correction_);
      if (experience_.age < fresh && Real(10) * experience_.effect * owed <= tolerance_ * size) break;
      if (pass > 1 && !(change < last)) break;  // the rest is rounding
      if (pass > 0) last = change;
    }
    ++experience_.age;
  }

  void add_pass() {
    if constexpr (Sized<M>) before_ = state_.vdot;
    else before_.swap(state_.vdot);
    mechanism_.evaluate(state_.q.data(), state_.v.data(), state_.lambda.data(), state_.vdot.data(), correction_.data());
    ++experience_.evaluations;
    for (std::size_t i = 0; i < correction_.size(); ++i) state_.lambda[i] += correction_[i];
  }

  /// By the last pass, whose accelerations before it are gone then.
  Real largest_change() {
    for (std::size_t i = 0; i < before_.size(); ++i) before_[i] -= state_.vdot[i];
    return largest(before_, scaled_nominals_of(mechanism_));
  }

 private:
  std::ptrdiff_t middle() const { return static_cast<std::ptrdiff_t>(state_.q.size()); }

  void accelerate() {
    if constexpr (std::is_void_v<Solving>) correct_multipliers();
    else static_cast<Solving*>(this)->find_multipliers();
  }

  Speeds<M> before_;
};

}  // namespace cutjoint
