// The trapezoidal rule of several instances side by side.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include "cutjoint/batch/real.hpp"
#include "cutjoint/mechanism.hpp"
#include "cutjoint/core/retraction.hpp"
#include "cutjoint/state.hpp"
#include "cutjoint/core/trapezoidal.hpp"

namespace cutjoint::batch {

using Instances = AnyMechanism<Real>;

/// What `cutjoint::Trapezoidal` does with the penalty closure, for each instance as if it were alone: its accelerations stay when they have
/// converged, while those of others still change.
class Trapezoidal {
 public:
  Trapezoidal(Instances& instances, double dt, FixedPoint fixed_point)
      : instances_(instances), d_(instances.description()), dt_(dt), fixed_point_(fixed_point), v_hat_(d_.speeds.size()), z_hat_(v_hat_),
        delta_(v_hat_), vdot_(v_hat_), correction_(d_.equations.size()), before_(d_) {}

  /// One step of the instances in `going`; a state is then that at its end, of all others it stays.  Returns those whose iteration does not
  /// end or goes to infinity.
  Mask step(State<Real>& state, Mask going) {
    before_ = state;
    for (std::size_t i = 0; i < v_hat_.size(); ++i) {
      v_hat_[i] = state.v[i] + dt_ / 2 * state.vdot[i];
      z_hat_[i] = dt_ * state.v[i] + dt_ * dt_ / 4 * state.vdot[i];
    }
    const Real t = state.t + dt_;
    instances_.begin_step(t, Real(1));
    Mask open = going, failed{};
    for (int iteration = 1; any(open); ++iteration) {
      follow(state);
      instances_.evaluate(state.q.data(), state.v.data(), state.lambda.data(), vdot_.data(), correction_.data());
      evaluations_ -= open;
      if (iteration <= fixed_point_.multiplier_updates)
        for (std::size_t i = 0; i < correction_.size(); ++i) choose(open, state.lambda[i] + correction_[i], state.lambda[i]);
      compare(state);
      const Mask infinite = open & ((change_ - change_).v != Real(0).v);
      const Mask late = iteration >= fixed_point_.iterations ? open & ~(change_ <= Real(fixed_point_.tolerance) * size_) : Mask{};
      note(infinite | late, state, t);
      failed |= infinite | late;
      for (std::size_t i = 0; i < vdot_.size(); ++i) choose(open, vdot_[i], state.vdot[i]);
      open &= ~(failed | (change_ <= Real(fixed_point_.tolerance) * size_));
    }
    follow(state);
    state.t = t;
    restore(state, ~(going & ~failed));
    return failed;
  }

  /// Why an instance's last step failed.
  Failure failure(int k, long number) const {
    const Stop& stop = stops_[static_cast<std::size_t>(k)];
    return failure_of(not_reached(fixed_point_.iterations, stop.change, stop.size, stop.t, number, stop.worst), d_);
  }

  /// How often an instance was evaluated until it had converged.
  long evaluations(int k) const { return evaluations_[k]; }

 private:
  /// Where an instance stopped: the time, how much its accelerations change, their size, and the speed whose one changes most.
  struct Stop {
    double t = 0.0, change = 0.0, size = 1.0;
    std::size_t worst = 0;
  };

  static void choose(Mask mask, Real yes, Real& kept) { kept = where(mask, yes, kept); }

  void follow(State<Real>& state) {
    for (std::size_t i = 0; i < v_hat_.size(); ++i) {
      state.v[i] = dt_ / 2 * state.vdot[i] + v_hat_[i];
      delta_[i] = dt_ * dt_ / 4 * state.vdot[i] + z_hat_[i];
    }
    retract<Real>(d_.charts, before_.q.data(), delta_.data(), state.q.data());
  }

  /// How much the accelerations change, and how large they are.
  void compare(const State<Real>& state) {
    change_ = size_ = Real(0);
    for (std::size_t i = 0; i < vdot_.size(); ++i) {
      change_ = larger(change_, abs(vdot_[i] - state.vdot[i]));
      size_ = larger(size_, abs(vdot_[i]));
    }
    size_ = size_ + Real(1);
  }

  void note(Mask failed, const State<Real>& state, Real t) {
    if (!any(failed)) return;
    for (int k = 0; k < width; ++k) {
      if (!failed[k]) continue;
      Stop stop{t[k], change_[k], size_[k], 0};
      double most = -1.0;
      for (std::size_t i = 0; i < vdot_.size(); ++i)
        if (const double change = std::abs(vdot_[i][k] - state.vdot[i][k]); change > most || change != change) most = change, stop.worst = i;
      stops_[static_cast<std::size_t>(k)] = stop;
    }
  }

  void restore(State<Real>& state, Mask which) const {
    if (!any(which)) return;
    choose(which, before_.t, state.t);
    for (std::size_t i = 0; i < state.q.size(); ++i) choose(which, before_.q[i], state.q[i]);
    for (std::size_t i = 0; i < state.v.size(); ++i) choose(which, before_.v[i], state.v[i]);
    for (std::size_t i = 0; i < state.v.size(); ++i) choose(which, before_.vdot[i], state.vdot[i]);
    for (std::size_t i = 0; i < state.lambda.size(); ++i) choose(which, before_.lambda[i], state.lambda[i]);
  }

  Instances& instances_;
  const Description& d_;
  Real dt_;
  FixedPoint fixed_point_;
  std::vector<Real> v_hat_, z_hat_, delta_, vdot_, correction_;
  State<Real> before_;
  Real change_{0}, size_{1};
  Mask evaluations_{};
  std::array<Stop, width> stops_;
};

}  // namespace cutjoint::batch
