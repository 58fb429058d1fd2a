// Simulation steps by an implicit method.
#pragma once

#include "cutjoint/core/radau/stages.hpp"
#include "cutjoint/core/stepping/implicit_scheme.hpp"
#include "cutjoint/core/stepping/stepped_integrator.hpp"

namespace cutjoint {

/// The integrator of simulation.hpp by Radau IIA (radau/stages.hpp) for a system in the coordinates of mechanism M: adaptive or of fixed length, split at events.
template <class M, class S, bool of_own_length, class LinearSolver = GuardedSolver<S, DenseSolver<S>>>
class RadauSteps : public stepping::SteppedIntegrator<RadauSteps<M, S, of_own_length, LinearSolver>, S> {
 public:
  using Subject = S;
  using Real = typename S::real_type;
  using Solver = LinearSolver;
  using Settings = typename SettingsOf<Solver>::type;

  static constexpr bool adaptive = of_own_length, knows_residuals = true;

  RadauSteps(S& system, const Settings& settings, const Road<Real>* roads)
      : stepping::SteppedIntegrator<RadauSteps, S>(system, settings), solver_(solver_for<Solver>(system, settings)), other_(solver_for<Solver>(system, settings)),
        stages_(system, solver_, other_, indicators_of(system, settings.events), roads),
        stepper_(stages_, stepping::Tolerances<Real>::of_steps(system, settings.tolerance, settings.absolute_tolerance), Real(settings.end), adaptive), y_(stages_.size()), row_(design_state(system)) {}

  /// Loops are closed by projection, without stabilisation.
  static StabilisationSettings stabilise(const SimulationSettings& settings, Cuts<M>&) {
    StabilisationSettings stabilisation = settings.stabilisation;
    stabilisation.frequency = 0.0;
    return stabilisation;
  }

  /// Take a state with accelerations and multipliers.
  void begin(const StateOf<S>& state) {
    stages_.resume(state);
    stepper_.go_on();
  }

  Fault start(StateOf<S>& state, Real) {
    const Fault fault = stages_.begin(state);
    state = stages_.present();
    return fault;
  }

  void restart_after_input_jump(StateOf<S>&) { stages_.restart_after_input_jump(); }

  /// Accelerations and multipliers of a state, which becomes the present one.
  Fault accelerate(StateOf<S>& state, auto&) {
    const Fault fault = stages_.go_on(state);
    stepper_.go_on();
    return fault;
  }

  /// Project a state: close its loops by the smallest displacement in the mass metric.
  Fault close(StateOf<S>& state) { return stages_.assemble(state); }

  /// The state with its accelerations and multipliers, valid until the next call; at a singular pose those of the stages.
  const StateOf<S>& complete(const StateOf<S>& state) {
    row_ = state;
    return stages_.complete(row_) ? state : row_;
  }

  /// Residuals of the loops in the present state.
  const Residuals& residuals(const StateOf<S>&) const { return stepper_.scheme().residuals(); }

  long evaluations() const { return stages_.evaluations(); }
  long iterations() const { return stages_.iterations(); }
  long factorisations() const { return stages_.factorisations(); }
  double smallest_pivot() const requires requires { S::pivot_columns; } { return solver_.smallest_pivot(stages_.tangent().data()); }

  using Scheme = stepping::ImplicitScheme<radau::Stages<S, Solver>>;
  using Stepper = stepping::Stepper<Scheme>;
  using Memory = typename Stepper::Memory;

  Memory memory() const { return stepper_.memory(); }
  void restore(const StateOf<S>&, const Memory& memory) { stepper_.restore(memory); }

 private:
  friend stepping::SteppedIntegrator<RadauSteps, S>;

  Solver solver_, other_;
  radau::Stages<S, Solver> stages_;
  Stepper stepper_;
  typename Stepper::Vector y_;
  StateOf<S> row_;
};

}  // namespace cutjoint
