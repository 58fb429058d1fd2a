// The trapezoidal rule with fixed-point iteration on the accelerations (Cuadrado et al. 2000, eqs. 43-44).
#pragma once

#include <cmath>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

#include "cutjoint/largest.hpp"
#include "cutjoint/mechanism.hpp"
#include "cutjoint/projection.hpp"
#include "cutjoint/retraction.hpp"
#include "cutjoint/settings.hpp"
#include "cutjoint/state.hpp"

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

/// The fixed point of a run.
inline FixedPoint fixed_point_of(const RunSettings& settings) {
  return {settings.tolerance, settings.iterations, settings.multiplier_updates, settings.stabilisation.closure == Closure::proximal,
          settings.fixed_cost};
}

/// A fixed point that is not reached: what the accelerations still change by, how large they are, and the speed whose one changes most.
inline Failure not_reached(int iterations, double change, double size, double t, long number, std::string_view speed) {
  const std::string what = std::isfinite(change) ? "the fixed point did not converge in " + std::to_string(iterations) + " iterations"
                                                 : "the fixed point diverged to infinity";
  const char* advice = change <= 1e-4 * size ? "what is left may be rounding; not tried: a larger tolerance" : "not tried: a smaller dt";
  return Failure(what, t, number, std::string(speed), change, advice);
}

/// Integrates a mechanism with steps of a given length.
template <Mechanism M>
class Trapezoidal {
 public:
  using Real = typename M::real_type;

  Trapezoidal(M& mechanism, Real dt, FixedPoint fixed_point)
      : mechanism_(mechanism), charts_(mechanism.description().charts), dt_(dt), fixed_point_(fixed_point),
        v_hat_(mechanism.description().speeds.size()), z_hat_(v_hat_.size()), delta_(v_hat_.size()), vdot_(v_hat_.size()),
        difference_(v_hat_.size()), correction_(mechanism.description().equations.size()), before_(mechanism.description()), projection_(mechanism) {}

  /// One step; `state` is that at its end.
  ///
  ///     v = dt/2 vdot + v_hat           v_hat = v_n + dt/2 vdot_n
  ///     z = dt^2/4 vdot + z_hat         z_hat = dt v_n + dt^2/4 vdot_n,  z counted from q_n
  ///
  /// Throws Failure when the iteration diverges to infinity or does not end; `state` is then the last one that converged, and the
  /// mechanism is at its time.
  [[gnu::noinline]] void step(State<Real>& state, long number) {
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
      if (!std::isfinite(static_cast<double>(change_))) give_up(state, number, t, iteration);
      if (fixed_point_.fixed_cost ? last : close) break;
      if (last) give_up(state, number, t, iteration);
    }
    follow(state);
    state.t = t;
    if (fixed_point_.proximal) project(state, number);
  }

  /// Go on with steps of another length.
  void set_step(Real dt) { dt_ = dt; }

  long evaluations() const { return evaluations_; }

 private:
  /// Coordinates and speeds that belong to the state's accelerations.
  void follow(State<Real>& state) {
    const Real half = dt_ / 2, quarter = dt_ * dt_ / 4;
    for (std::size_t i = 0; i < v_hat_.size(); ++i) {
      state.v[i] = half * state.vdot[i] + v_hat_[i];
      delta_[i] = quarter * state.vdot[i] + z_hat_[i];
    }
    retract<Real>(charts_, before_.q.data(), delta_.data(), state.q.data());
  }

  void project(State<Real>& state, long number) {
    if (fixed_point_.fixed_cost) return projection_.approach(state);
    try {
      projection_.positions(state, number);
      projection_.velocities(state, number);
    } catch (const Failure&) {
      go_back(state);
      throw;
    }
  }

  void go_back(State<Real>& state) {
    state = before_;
    mechanism_.begin_step(state.t, Real(1));
  }

  bool converged(const State<Real>& state, const std::vector<Real>& previous) {
    for (std::size_t i = 0; i < previous.size(); ++i) difference_[i] = state.vdot[i] - previous[i];
    change_ = largest(difference_);
    size_ = Real(1) + largest(state.vdot);
    return change_ <= Real(fixed_point_.tolerance) * size_;
  }

  [[noreturn]] void give_up(State<Real>& state, long number, Real t, int iteration) {
    go_back(state);
    std::size_t worst = 0;
    using std::abs;
    for (std::size_t i = 0; i < difference_.size(); ++i)
      if (abs(difference_[i]) > abs(difference_[worst]) || difference_[i] != difference_[i]) worst = i;
    const auto change = static_cast<double>(change_), size = static_cast<double>(size_);
    throw not_reached(iteration, change, size, static_cast<double>(t), number, mechanism_.description().speeds[worst]);
  }

  M& mechanism_;
  std::vector<Chart> charts_;
  Real dt_;
  FixedPoint fixed_point_;
  std::vector<Real> v_hat_, z_hat_, delta_, vdot_, difference_, correction_;
  State<Real> before_;
  Projection<M> projection_;
  Real change_{0}, size_{1};
  long evaluations_ = 0;
};

}  // namespace cutjoint
