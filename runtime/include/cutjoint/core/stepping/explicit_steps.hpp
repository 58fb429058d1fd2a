// Steps of a simulation by an explicit Runge-Kutta method.
#pragma once

#include "cutjoint/core/runge_kutta/scheme.hpp"
#include "cutjoint/core/runge_kutta/tables.hpp"
#include "cutjoint/core/runge_kutta/closed_loop_dynamics.hpp"
#include "cutjoint/core/start/start.hpp"
#include "cutjoint/core/stepping/stepped_integrator.hpp"

namespace cutjoint {

/// The integrator of a simulation (simulation.hpp) by a table of runge_kutta/tables.hpp.  Steps end where formulas change.
template <class M, class Table>
class ExplicitSteps : public stepping::SteppedIntegrator<ExplicitSteps<M, Table>, M> {
 public:
  using Real = typename M::real_type;

  using Subject = M;
  using Method = Table;

  using Scheme = runge_kutta::Scheme<runge_kutta::ClosedLoopDynamics<M>, Table>;

  static constexpr bool adaptive = Table::adaptive, knows_residuals = false;

  ExplicitSteps(M& mechanism, const SimulationSettings& settings, const Road<Real>* roads)
      : stepping::SteppedIntegrator<ExplicitSteps, M>(mechanism, settings),
        dynamics_(mechanism, {indicators_of(mechanism, settings.events), roads}, runge_kutta::tolerance_of_multipliers<Table>(Real(settings.tolerance)),
                  multipliers(settings.stabilisation.closure)),
        stepper_(dynamics_, stepping::Tolerances<Real>::of_steps(mechanism, settings.tolerance, settings.absolute_tolerance), Real(settings.end)) {
    take(settings);
  }

  /// Whether steps may leave loops open without a fault.
  static bool leaves_violations(const SimulationSettings& settings) { return settings.fixed_point.fixed_cost; }

  /// Evaluations have a fixed number of passes, or as many as they need.
  void take(const SimulationSettings& settings) { dynamics_.fix_passes(settings.fixed_point.fixed_cost ? settings.fixed_point.iterations : 0); }

  /// Loops are projected, not drawn together; a penalty that the run is given comes before those of the start.
  static StabilisationSettings stabilise(const SimulationSettings& settings, Cuts<M>& penalties) {
    StabilisationSettings stabilisation = settings.stabilisation;
    if (stabilisation.closure == Closure::penalty && settings.penalty) std::fill(penalties.begin(), penalties.end(), Real(*settings.penalty));
    stabilisation.frequency = 0.0;
    return stabilisation;
  }

  /// Take over a state, whose accelerations and multipliers it has.
  void begin(const StateOf<M>& state) {
    y_ = dynamics_.begin(state);
    stepper_.go_to(state.t, y_);
  }

  Fault start(StateOf<M>& state, Real) {
    begin(state);
    return {};
  }

  /// Forces have jumped.
  void restart_after_input_jump(StateOf<M>& state) { begin(state); }

  /// Accelerations and multipliers of a state as it is, which is taken over.
  Fault accelerate(StateOf<M>& state, Starter<M>& starter) {
    starter.accelerate(state, Real(1));
    begin(state);
    return starter.require_finite(state);
  }

  /// Close the loops of a state by moving the masses least.
  Fault close(StateOf<M>& state) { return dynamics_.projection().close(state); }

  /// The state with its accelerations and multipliers, until the next call.
  const StateOf<M>& complete(const StateOf<M>& state) { return dynamics_.complete(state.t, y_); }

  /// The largest residuals of the loops in the state that steps have come to.
  Residuals residuals(const StateOf<M>& state) { return dynamics_.residuals(state.t, y_); }

  long evaluations() const { return dynamics_.evaluations(); }
  long iterations() const { return stepper_.steps(); }
  double change() const { return static_cast<double>(dynamics_.change()); }

  using Memory = typename stepping::Stepper<Scheme>::Memory;

  Memory memory() const { return stepper_.memory(); }

  void restore(const StateOf<M>& state, const Memory& memory) {
    y_ = dynamics_.begin(state);
    stepper_.restore(memory);
  }

 private:
  friend stepping::SteppedIntegrator<ExplicitSteps, M>;

  static runge_kutta::Multipliers multipliers(Closure closure) {
    using enum runge_kutta::Multipliers;
    return closure != Closure::solved ? corrected : adaptive ? solved : completed;
  }

  void keep(StateOf<M>& state) const { state.lambda = dynamics_.multipliers(); }

  runge_kutta::ClosedLoopDynamics<M> dynamics_;
  stepping::Stepper<Scheme> stepper_;
  typename runge_kutta::ClosedLoopDynamics<M>::Vector y_;
};

}  // namespace cutjoint
