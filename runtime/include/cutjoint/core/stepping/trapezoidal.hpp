// The trapezoidal rule with fixed-point iteration on the accelerations (Cuadrado et al. 2000, eqs. 43-44).
#pragma once

#include "cutjoint/core/stepping/fixed_point.hpp"
#include "cutjoint/core/constraints/projection.hpp"

namespace cutjoint {

/// The fixed-point iteration: starts from extrapolated accelerations, with Anderson mixing.
///
/// It has converged when the accelerations change by at most `tolerance` times (1 + the largest of them); rates of states are relative to
/// their `nominals`.  The multipliers are
/// corrected in the first `multiplier_updates` iterations of a step and constant then: the penalty carries the rest.  Near a singular
/// pose the multipliers of the vanishing direction are unbounded, and further corrections would not converge.
///
/// With the proximal closure positions and velocities are projected at the end of a step.  A step of fixed cost has exactly `iterations`
/// iterations.
struct FixedPoint {
  double tolerance;
  int iterations;
  int multiplier_updates;
  bool proximal = false;
  bool fixed_cost = false;

  bool operator==(const FixedPoint&) const = default;
};

/// A fixed point that is not reached: the last change of accelerations, their size, and the velocity whose acceleration changes most.
inline Fault not_reached(int iterations, double change, double size, double t, long number, std::size_t speed) {
  return {.cause = std::isfinite(change) ? Cause::not_converged : Cause::diverged, .list = FaultList::speeds, .index = static_cast<int>(speed),
          .t = t, .step = number, .value = change, .size = size, .iterations = iterations};
}

/// Integrates a mechanism with steps of a given length.  Its reals may have lanes for several instances: each iterates as if
/// alone, and converged accelerations stay while those of others still change.
template <Mechanism M>
class Trapezoidal {
 public:
  using Real = typename M::real_type;
  using Instances = Selection<Real>;
  using Mask = typename Instances::Mask;

  Trapezoidal(M& mechanism, Real dt, FixedPoint fixed_point)
      : mechanism_(mechanism), dt_(dt), fixed_point_(fixed_point), v_hat_(sizes_of(mechanism).speeds), z_hat_(v_hat_.size()),
        delta_(v_hat_.size()), vdot_(v_hat_.size()), difference_(v_hat_.size()), correction_(sizes_of(mechanism).equations),
        before_(design_state(mechanism)), expected_(v_hat_.size()), mixing_(v_hat_.size()), damped_(v_hat_.size()),
        projection_(mechanism) {}

  /// One step of a mechanism alone; `state` is that at its end.  Fault: the iteration diverges or does not converge, or loops
  /// stay open; `state` is then the last converged one, and the mechanism is at its time.
  [[gnu::noinline]] Fault step(StateOf<M>& state, long number) {
    if (!step_of(state, true) || advance_damped(state)) return {};
    mechanism_.begin_step(state.t, Real(1));
    return fault(0, number);
  }

  /// One step of the instances in `running`; states of others are unchanged.  Returns those that fail; the mechanism is at the
  /// end of the step.
  Mask step_of(StateOf<M>& state, Mask running) {
    const Mask failed = advance(state, running);
    return fixed_point_.proximal ? Instances::either(failed, project(state, Instances::without(running, failed))) : failed;
  }

  /// Accelerations and multipliers of a state whose inputs have jumped, in as many evaluations as a step has at most.  Corrections of multipliers, over
  /// the penalties of their cut joints, are the accelerations by which loops open: they end where these are small.
  void restart(StateOf<M>& state, const Cuts<M>& penalties, Mask open = Instances::all_if(true)) {
    using std::abs;
    mechanism_.begin_step(state.t, Real(1));
    const auto& cuts = cuts_of(mechanism_);
    for (Real& x : state.lambda) Instances::take(Instances::without(open, Instances::finite(x)), Real(0), x);  // of infinite accelerations
    for (int iteration = 0; iteration < fixed_point_.iterations && Instances::any(open); ++iteration) {
      mechanism_.evaluate(state.q.data(), state.v.data(), state.lambda.data(), vdot_.data(), correction_.data());
      Real opens(0);
      for (std::size_t i = 0, cut = 0; i < correction_.size(); ++i) {
        while (cut + 1 < cuts.size() && static_cast<std::size_t>(cuts[cut + 1]) <= i) ++cut;
        opens = larger(opens, abs(correction_[i]) / penalties[cut]);
        Instances::take(open, state.lambda[i] + correction_[i], state.lambda[i]);
      }
      const Mask close = opens <= Real(1e-2 * fixed_point_.tolerance) * (Real(1) + largest(vdot_, nominals_of(mechanism_)));
      Instances::take_all(open, vdot_, state.vdot);
      open = Instances::without(open, close);
    }
  }

  /// The fault of an instance's last step.
  Fault fault(int instance, long number) const {
    Fault fault = faults_[static_cast<std::size_t>(instance)];
    fault.step = number;
    return fault;
  }

  Projection<M>& projection() { return projection_; }

  /// Memory of the next steps: accelerations at the ends of the last ones.
  Extrapolation<M>& expected() { return expected_; }
  const Extrapolation<M>& expected() const { return expected_; }

  /// Continue with steps of another length.
  void set_step(Real dt) { dt_ = dt; }

  /// Change the settings of the iteration.
  void set_fixed_point(const FixedPoint& fixed_point) { fixed_point_ = fixed_point; }

  /// Evaluations of each instance until it converged.
  const typename Instances::Count& evaluations() const { return evaluations_; }

  /// The change of a single mechanism's accelerations by the last iteration, relative to 1 + the largest of them.
  double change() const { return static_cast<double>(change_ / size_); }

  /// Count evaluations from 0.
  void reset_count() { evaluations_ = typename Instances::Count{}; }

 private:
  /// Whether failed steps are tried by damped iterations: of a mechanism alone, with first-order states.
  static constexpr bool may_damp = Instances::number == 1 && [] {
    if constexpr (requires { M::sizes.states; }) return M::sizes.states > 0;
    else return true;
  }();
  struct None {
    explicit None(std::size_t) {}
  };

  /// Advance without the projection of the proximal closure.
  ///
  ///     v = dt/2 vdot + v_hat           v_hat = v_n + dt/2 vdot_n
  ///     z = dt^2/4 vdot + z_hat         z_hat = dt v_n + dt^2/4 vdot_n,  z counted from q_n
  Mask advance(StateOf<M>& state, Mask running) {
    before_ = state;
    const Real dt = dt_, half = dt_ / 2, quarter = dt_ * dt_ / 4;
    for (std::size_t i = 0; i < v_hat_.size(); ++i) {
      v_hat_[i] = state.v[i] + half * state.vdot[i];
      z_hat_[i] = dt * state.v[i] + quarter * state.vdot[i];
    }
    const Real t = state.t + dt_;
    mechanism_.begin_step(t, Real(1));
    const std::span<const double> nominals = nominals_of(mechanism_);
    expected_.expect(state.vdot, dt, nominals);
    mixing_.begin();
    // the first accelerations belong to the last step's multipliers: they are used neither for mixing nor as convergence
    const int first_sure = correction_.empty() ? 1 : 2;
    Mask open = running, failed{};
    for (int iteration = 1; Instances::any(open); ++iteration) {
      follow(state);
      mechanism_.evaluate(state.q.data(), state.v.data(), state.lambda.data(), vdot_.data(), correction_.data());
      Instances::count(open, evaluations_);
      if (iteration <= fixed_point_.multiplier_updates)
        for (std::size_t i = 0; i < correction_.size(); ++i) Instances::take(open, state.lambda[i] + correction_[i], state.lambda[i]);
      const bool last = iteration >= fixed_point_.iterations;
      const Mask close = Instances::both(compare(state), Instances::all_if(iteration >= first_sure || last)),
                 late = Instances::all_if(last && !fixed_point_.fixed_cost);
      const Mask lost = Instances::both(open, Instances::either(Instances::without(late, close), Instances::without(open, Instances::finite(change_))));
      if (Instances::any(lost)) note(lost, t, iteration);
      failed = Instances::either(failed, lost);
      const Mask done = Instances::either(failed, fixed_point_.fixed_cost ? Instances::all_if(last) : close), next = Instances::without(open, done);
      if (iteration >= first_sure && Instances::any(next)) mixing_.mix(difference_, change_, nominals, next, vdot_);
      Instances::take_all(open, vdot_, state.vdot);
      open = next;
    }
    expected_.keep(state.vdot, Instances::without(running, failed));
    follow(state);
    state.t = t;
    restore(state, Instances::without(Instances::all_if(true), Instances::without(running, failed)));
    return failed;
  }

  /// The step of a mechanism alone whose fixed point was not found, again by Newton's iteration; the state stays where it fails.  For first-order
  /// states, whose rates may be stiff.  Multipliers are corrected between solutions.
  [[gnu::noinline, gnu::cold]] bool advance_damped(StateOf<M>& state) {
    if constexpr (!may_damp) return false;
    else {
      const Cause cause = faults_[0].cause;
      if (fixed_point_.fixed_cost || number_of_states(mechanism_) == 0 || (cause != Cause::not_converged && cause != Cause::diverged)) return false;
      const auto solve = [&] { return damped_.solve(state.vdot, nominals_of(mechanism_), Real(fixed_point_.tolerance), fixed_point_.iterations, [&](Speeds<M>& residual) {
        follow(state);
        mechanism_.evaluate(state.q.data(), state.v.data(), state.lambda.data(), vdot_.data(), correction_.data());
        Instances::count(true, evaluations_);
        for (std::size_t i = 0; i < vdot_.size(); ++i) residual[i] = vdot_[i] - state.vdot[i];
      }); };
      bool found = solve();
      for (int update = 0; found && !correction_.empty() && update < fixed_point_.multiplier_updates; ++update) {
        for (std::size_t i = 0; i < correction_.size(); ++i) state.lambda[i] += correction_[i];
        found = solve();
      }
      follow(state);
      state.t = before_.t + dt_;
      found = found && follows_loops(state);
      restore(state, !found);
      if (found) expected_.keep(state.vdot, true);
      return found;
    }
  }

  /// Whether velocities are those of closed loops but for a hundredth.  Loops have other solutions, with links turned over, which a damped iteration may find.
  bool follows_loops(const StateOf<M>& state) {
    if (correction_.empty()) return true;
    Equations<M> phi = correction_, phid = correction_;
    mechanism_.constraint_residual(state.q.data(), state.v.data(), phi.data(), phid.data());
    return largest(phid) <= largest(std::span<const Real>(state.v.data(), state.v.size() - number_of_states(mechanism_))) / 100;
  }

  /// Coordinates and velocities from the state's accelerations.
  void follow(StateOf<M>& state) {
    const Real half = dt_ / 2, quarter = dt_ * dt_ / 4;
    for (std::size_t i = 0; i < v_hat_.size(); ++i) {
      state.v[i] = half * state.vdot[i] + v_hat_[i];
      delta_[i] = quarter * state.vdot[i] + z_hat_[i];
    }
    retract<Real>(charts_of(mechanism_), before_.q.data(), delta_.data(), state.q.data());
  }

  /// Project positions and velocities; returns the instances that fail, which are reset to the state before the step.
  Mask project(StateOf<M>& state, Mask running) {
    Mask failed = Instances::all_if(false);
    if (fixed_point_.fixed_cost) projection_.approach(state);
    else failed = projection_.close(state, running);
    for (int k = 0; k < Instances::number; ++k)
      if (Instances::has(failed, k)) faults_[static_cast<std::size_t>(k)] = projection_.fault(k, 0);
    restore(state, Instances::without(Instances::all_if(true), Instances::without(running, failed)));
    return failed;
  }

  /// Which new accelerations are close to those of the state.
  Mask compare(const StateOf<M>& state) {
    for (std::size_t i = 0; i < vdot_.size(); ++i) difference_[i] = vdot_[i] - state.vdot[i];
    const std::span<const double> nominals = nominals_of(mechanism_);
    change_ = largest(difference_, nominals);
    size_ = Real(1) + largest(vdot_, nominals);
    return change_ <= Real(fixed_point_.tolerance) * size_;
  }

  /// Record the faults of instances that fail.
  void note(Mask lost, Real t, int iteration) {
    for (int k = 0; k < Instances::number; ++k) {
      if (!Instances::has(lost, k)) continue;
      const std::size_t worst = index_of_largest(difference_.size(), [&](std::size_t i) { return std::abs(Instances::of(difference_[i], k)); });
      faults_[static_cast<std::size_t>(k)] =
          not_reached(iteration, Instances::of(change_, k), Instances::of(size_, k), Instances::of(t, k), 0, worst);
    }
  }

  /// Reset instances to the state before the step.
  void restore(StateOf<M>& state, Mask which) const {
    if (!Instances::any(which)) return;
    const auto back = [&](auto& values, const auto& before) {
      for (std::size_t i = 0; i < values.size(); ++i) Instances::take(which, before[i], values[i]);
    };
    Instances::take(which, before_.t, state.t);
    back(state.q, before_.q), back(state.v, before_.v), back(state.vdot, before_.vdot), back(state.lambda, before_.lambda);
  }

  M& mechanism_;
  Real dt_;
  FixedPoint fixed_point_;
  Speeds<M> v_hat_, z_hat_, delta_, vdot_, difference_;
  Equations<M> correction_;
  StateOf<M> before_;
  Extrapolation<M> expected_;
  Mixing<M> mixing_;
  [[no_unique_address]] std::conditional_t<may_damp, DampedNewton<M>, None> damped_;
  Projection<M> projection_;
  Real change_{0}, size_{1};
  typename Instances::Count evaluations_{};
  std::array<Fault, Instances::number> faults_{};
};

}  // namespace cutjoint
