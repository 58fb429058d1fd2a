// The trapezoidal rule with fixed-point iteration on the accelerations (Cuadrado et al. 2000, eqs. 43-44).
#pragma once

#include <cmath>
#include <cstddef>

#include "cutjoint/core/arrays.hpp"
#include "cutjoint/core/fault.hpp"
#include "cutjoint/core/largest.hpp"
#include "cutjoint/core/mechanism.hpp"
#include "cutjoint/core/projection.hpp"
#include "cutjoint/core/retraction.hpp"
#include "cutjoint/core/state.hpp"

namespace cutjoint {

/// How the fixed point is sought.
///
/// It counts as reached when the accelerations change by at most `tolerance` times (1 + the largest of them).  The multipliers are
/// corrected in the first `multiplier_updates` iterations of a step and stay the same then: the penalty carries what is left.  Near a singular
/// pose the multipliers of the vanishing direction have no limit, and correcting them further would never end.
///
/// With the proximal closure positions and speeds are projected at the end of a step.  A step of fixed cost has `iterations` of them, no
/// less and no more, whatever they leave.
struct FixedPoint {
  double tolerance;
  int iterations;
  int multiplier_updates;
  bool proximal = false;
  bool fixed_cost = false;
};

/// A fixed point that is not reached: what the accelerations still change by, how large they are, and the speed whose one changes most.
inline Fault not_reached(int iterations, double change, double size, double t, long number, std::size_t speed) {
  return {.cause = std::isfinite(change) ? Cause::not_converged : Cause::diverged, .list = FaultList::speeds, .index = static_cast<int>(speed),
          .t = t, .step = number, .value = change, .size = size, .iterations = iterations};
}

/// Integrates a mechanism with steps of a given length.
template <Mechanism M>
class Trapezoidal {
 public:
  using Real = typename M::real_type;

  Trapezoidal(M& mechanism, Real dt, FixedPoint fixed_point)
      : mechanism_(mechanism), dt_(dt), fixed_point_(fixed_point), v_hat_(sizes_of(mechanism).speeds), z_hat_(v_hat_.size()),
        delta_(v_hat_.size()), vdot_(v_hat_.size()), difference_(v_hat_.size()), correction_(sizes_of(mechanism).equations),
        before_(blank(mechanism)), projection_(mechanism) {}

  /// One step; `state` is that at its end.
  ///
  ///     v = dt/2 vdot + v_hat           v_hat = v_n + dt/2 vdot_n
  ///     z = dt^2/4 vdot + z_hat         z_hat = dt v_n + dt^2/4 vdot_n,  z counted from q_n
  ///
  /// There is a fault when the iteration diverges to infinity or does not end; `state` is then the last one that converged, and the
  /// mechanism is at its time.
  [[gnu::noinline]] Fault step(StateOf<M>& state, long number) {
    before_ = state;
    const Real dt = dt_, half = dt_ / 2, quarter = dt_ * dt_ / 4;
    for (std::size_t i = 0; i < v_hat_.size(); ++i) {
      v_hat_[i] = state.v[i] + half * state.vdot[i];
      z_hat_[i] = dt * state.v[i] + quarter * state.vdot[i];
    }
    const Real t = state.t + dt_;
    mechanism_.begin_step(t, Real(1));
    for (int iteration = 1;; ++iteration) {
      follow(state);
      mechanism_.evaluate(state.q.data(), state.v.data(), state.lambda.data(), vdot_.data(), correction_.data());
      if (iteration <= fixed_point_.multiplier_updates)
        for (std::size_t i = 0; i < correction_.size(); ++i) state.lambda[i] += correction_[i];
      state.vdot.swap(vdot_);
      ++evaluations_;
      const bool close = converged(state, vdot_), last = iteration >= fixed_point_.iterations;
      if (!std::isfinite(static_cast<double>(change_))) return give_up(state, number, t, iteration);
      if (fixed_point_.fixed_cost ? last : close) break;
      if (last) return give_up(state, number, t, iteration);
    }
    follow(state);
    state.t = t;
    return fixed_point_.proximal ? project(state, number) : Fault{};
  }

  Projection<M>& projection() { return projection_; }

  /// Go on with steps of another length.
  void set_step(Real dt) { dt_ = dt; }

  /// Seek the fixed point another way.
  void set_fixed_point(const FixedPoint& fixed_point) { fixed_point_ = fixed_point; }

  long evaluations() const { return evaluations_; }

 private:
  /// Coordinates and speeds that belong to the state's accelerations.
  void follow(StateOf<M>& state) {
    const Real half = dt_ / 2, quarter = dt_ * dt_ / 4;
    for (std::size_t i = 0; i < v_hat_.size(); ++i) {
      state.v[i] = half * state.vdot[i] + v_hat_[i];
      delta_[i] = quarter * state.vdot[i] + z_hat_[i];
    }
    retract<Real>(charts_of(mechanism_), before_.q.data(), delta_.data(), state.q.data());
  }

  Fault project(StateOf<M>& state, long number) {
    if (fixed_point_.fixed_cost) {
      projection_.approach(state);
      return {};
    }
    Fault fault = projection_.positions(state, number);
    if (!fault) fault = projection_.velocities(state, number);
    if (fault) go_back(state);
    return fault;
  }

  void go_back(StateOf<M>& state) {
    state = before_;
    mechanism_.begin_step(state.t, Real(1));
  }

  bool converged(const StateOf<M>& state, const Speeds<M>& previous) {
    for (std::size_t i = 0; i < previous.size(); ++i) difference_[i] = state.vdot[i] - previous[i];
    change_ = largest(difference_);
    size_ = Real(1) + largest(state.vdot);
    return change_ <= Real(fixed_point_.tolerance) * size_;
  }

  Fault give_up(StateOf<M>& state, long number, Real t, int iteration) {
    go_back(state);
    std::size_t worst = 0;
    using std::abs;
    for (std::size_t i = 0; i < difference_.size(); ++i)
      if (abs(difference_[i]) > abs(difference_[worst]) || difference_[i] != difference_[i]) worst = i;
    return not_reached(iteration, static_cast<double>(change_), static_cast<double>(size_), static_cast<double>(t), number, worst);
  }

  M& mechanism_;
  Real dt_;
  FixedPoint fixed_point_;
  Speeds<M> v_hat_, z_hat_, delta_, vdot_, difference_;
  Equations<M> correction_;
  StateOf<M> before_;
  Projection<M> projection_;
  Real change_{0}, size_{1};
  long evaluations_ = 0;
};

}  // namespace cutjoint
