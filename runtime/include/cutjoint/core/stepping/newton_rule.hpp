// The rules of `recursive-newton` for steps that are split at events.
#pragma once

#include "cutjoint/core/newton/recursive_newton.hpp"

namespace cutjoint::stepping {

/// The rule of equal_steps.hpp over `RecursiveNewton`.
template <class S, class LinearSolver>
class NewtonRule {
 public:
  using Real = typename S::real_type;
  using Subject = S;
  using Solver = LinearSolver;
  using Newton = RecursiveNewton<S, Solver>;
  using Settings = typename SettingsOf<Solver>::type;

  static constexpr double least = 1e-4;

  NewtonRule(S& system, const Settings& settings)
      : system_(system), solver_(solver_for<Solver>(system, settings)), newton_(system, solver_, newton_settings(settings)), dt_(settings.dt), h_(dt_),
        restarted_(design_state(system)), means_(restarted_.v), single_(system, settings) {}

  const S& subject() const { return system_; }

  Fault start(StateOf<S>& state) { return restart(state); }

  /// A state whose accelerations are not found keeps those it has.
  Fault restart(StateOf<S>& state) {
    restarted_ = state;
    if (const Fault fault = newton_.begin(restarted_, Real(1))) return fault;
    state = restarted_;
    newton_.stay(state);
    return {};
  }

  Fault step(StateOf<S>& state, Real h, long number) {
    using std::abs;
    const Real rounding = 16 * std::numeric_limits<Real>::epsilon() * (abs(state.t) + h);  // of times, whose difference h is
    if (abs(h - h_) > h_ * Real(1e-9) + rounding) {
      newton_.stay(state);
      newton_.set_step(h_ = h);
    }
    const Fault fault = newton_.step(state, number);
    if (fault || !(h < dt_ / 100)) return fault;
    return restart(state);  // the square of a short step, by which penalties are divided, leaves accelerations few digits
  }

  void keep() {
    means_ = newton_.means();
    worst_ = worst_of(worst_, newton_.residuals());
  }

  void go_back(const StateOf<S>& state) {
    newton_.stay(state);
    newton_.take_means(means_);
  }

  Fault project(StateOf<S>& state) { return newton_.close_loops(state); }

  /// A state gets the accelerations and multipliers that guides need: those of a step only come near to them.
  void complete(StateOf<S>& state) {
    if constexpr (!Sized<S>) state = single_.with_reactions(state);
  }

  void enter(Real t) { system_.begin_step(t, Real(1)); }

  void events(const StateOf<S>& state, Real* values) {
    system_.begin_step(state.t, Real(1));
    system_.events(state.q.data(), state.v.data(), values);
  }

  const Newton& newton() const { return newton_; }
  const Residuals& worst() const { return worst_; }  ///< residuals of all states that count
  const Solver& solver() const { return solver_; }
  long iterations() const { return newton_.iterations(); }
  long evaluations() const { return newton_.evaluations(); }

 private:
  S& system_;
  Solver solver_;
  Newton newton_;
  Real dt_, h_;
  StateOf<S> restarted_;
  Speeds<S> means_;
  [[no_unique_address]] std::conditional_t<Sized<S>, NoImpacts, SingleStatesOfDriven<S, Newton, Solver>> single_;
  Residuals worst_;
};

}  // namespace cutjoint::stepping
