// Steps of a simulation by Newton's iteration.
#pragma once

#include "cutjoint/core/stepping/crossed_impacts.hpp"
#include "cutjoint/core/newton/newton.hpp"
#include "cutjoint/core/simulation/simulation_settings.hpp"

namespace cutjoint {

/// The settings of Newton's iteration, by those of a simulation.
inline NewtonSettings newton_settings(const SimulationSettings& settings) {
  return {.dt = settings.dt, .penalty = settings.penalty, .tolerance = settings.fixed_point.tolerance, .iterations = settings.fixed_point.iterations,
          .multiplier_updates = settings.fixed_point.multiplier_updates,
          .rule = settings.spectral_radius ? generalised_alpha(*settings.spectral_radius) : StepRule{}};
}

/// Accelerations and multipliers of single states by a `Method`, with factors of their own; a singular pose keeps the accelerations that it has.
template <class S, class Method, class LinearSolver>
struct SingleStates {
  using Settings = typename SettingsOf<LinearSolver>::type;

  LinearSolver solver;
  Method newton;
  StateOf<S> completed;

  SingleStates(S& system, const Settings& settings)
      : solver(solver_for<LinearSolver>(system, settings)),
        newton(system, solver, {.dt = 1.0, .penalty = std::nullopt, .tolerance = 1e-9, .iterations = 100, .multiplier_updates = 4}),
        completed(design_state(system)) {}

  void accelerate(StateOf<S>& state) {
    completed = state;
    if (!newton.go_on(completed)) state = completed;
  }

  const StateOf<S>& with_reactions(const StateOf<S>& state) {
    completed = state;
    return newton.begin(completed, Real(1)) ? state : completed;
  }

 private:
  using Real = typename S::real_type;
};

/// The same of a system that is driven, as its description says; other states are as they are.
template <class S, class Method, class LinearSolver>
struct SingleStatesOfDriven {
  std::optional<SingleStates<S, Method, LinearSolver>> single;

  SingleStatesOfDriven(S& system, const typename SettingsOf<LinearSolver>::type& settings) {
    if (system.description().driven) single.emplace(system, settings);
  }

  void accelerate(StateOf<S>& state) { single->accelerate(state); }
  const StateOf<S>& with_reactions(const StateOf<S>& state) { return single ? single->with_reactions(state) : state; }
};

/// The integrator of a simulation (simulation.hpp) by the trapezoidal rule of a `Method` with its solver, over a system S in whatever coordinates;
/// the mechanism M starts.  Steps go over events.
template <class M, class S, class Method, class LinearSolver, bool with_means = false>
class NewtonSteps {
 public:
  using Subject = S;
  using Newton = Method;
  using Solver = LinearSolver;
  using Real = typename S::real_type;
  using Settings = typename SettingsOf<Solver>::type;

  static constexpr bool adaptive = false;
  static constexpr bool finds_events = false, knows_residuals = true;
  static constexpr bool averages = with_means;  ///< by a rule with accelerations beside those of states, for derivatives

  /// The length of steps with a fixed point, which the penalties of the start follow: as for a run of the command line.
  static Real fixed_point_step(const SimulationSettings& settings) { return Real(settings.dt); }

  NewtonSteps(S& system, const Settings& settings, const Road<Real>*)
      : system_(system), solver_(solver_for<Solver>(system, settings)), newton_(system, solver_, newton_settings(settings)), h_(settings.dt),
        shift_(sizes_of(system).speeds), single_(system, settings), impacts_(system, settings.end) {
    fix(settings);
  }

  static StabilisationSettings stabilise(const SimulationSettings& settings, Cuts<M>&) { return settings.stabilisation; }

  /// Take over a state that has accelerations and multipliers; inputs are others from now on.
  void begin(const StateOf<S>& state) { newton_.resume(state); }

  Fault start(StateOf<S>& state, Real motion) { return newton_.begin(state, motion); }

  /// Forces have jumped: the next step begins with the accelerations that they give.
  void restart_after_input_jump(StateOf<S>& state) { newton_.follow_jump(state); }

  void restart_after_sample(StateOf<S>& state) { newton_.follow_sample(state); }

  /// Accelerations and multipliers of a state as it is, which is taken over.
  Fault accelerate(StateOf<S>& state, auto&) { return newton_.go_on(state); }

  /// Close the loops of a state by moving the masses least.
  Fault close(StateOf<S>& state) { return newton_.assemble(state); }

  /// From the state to that at the end of a step of length h; the state stays where it fails.
  Fault step(StateOf<S>& state, const SimulationSettings& settings, Real h, Real, long number) {
    if constexpr (can_jump<S>) {
      bool struck = false;
      const Fault fault = impacts_.over(state, h, [this](StateOf<S>& at) { single_.accelerate(at); }, watch_, [&](bool met) {
        if ((struck = met)) take(state);
        return step_within(state, settings, h, number);
      });
      if (fault && struck) take(state);
      return fault;
    } else {
      return step_within(state, settings, h, number);
    }
  }

  /// The state with its accelerations and multipliers.
  const StateOf<S>& complete(const StateOf<S>& state) const { return state; }

  /// The state, where guides need them with accelerations and multipliers that those of a step only come near to.
  const StateOf<S>& with_reactions(const StateOf<S>& state) { return single_.with_reactions(state); }

  /// Tell a watch of impacts.
  void watch_impacts(const ImpactWatch<S>& watch) { watch_ = watch; }

  /// The residuals of the loops in the state that steps have come to.
  const Residuals& residuals(const StateOf<S>&) const { return newton_.residuals(); }

  const Newton& newton() const { return newton_; }
  Solver& solver() { return solver_; }
  const Solver& solver() const { return solver_; }
  long iterations() const { return newton_.iterations(); }
  long evaluations() const { return newton_.evaluations(); }
  long factorisations() const { return newton_.factorisations(); }

  /// What the last iteration still changed the accelerations by, as a share of 1 + the largest of them.
  double change() const { return newton_.change(); }
  double smallest_pivot() const requires requires { S::pivot_columns; } { return solver_.smallest_pivot(newton_.tangent().data()); }

  struct Memory {
    typename Newton::Memory newton;
    [[no_unique_address]] typename Solver::Memory solver;
    Real h;
    [[no_unique_address]] typename CrossedIf<S>::Memory impacts;
  };

  Memory memory() const { return {newton_.memory(), solver_.memory(), h_, impacts_.memory()}; }

  void restore(const StateOf<S>&, const Memory& memory) {
    h_ = memory.h;
    newton_.restore(memory.newton);
    if (newton_.has_factors()) solver_.restore(memory.solver, newton_.tangent().data());
    impacts_.restore(memory.impacts);
  }

 private:
  using SingleOf = std::conditional_t<!Sized<S>, SingleStatesOfDriven<S, Newton, Solver>,
                                      std::conditional_t<can_jump<S>, SingleStates<S, Newton, Solver>, NoImpacts>>;

  /// The next step goes on from a state with accelerations and multipliers.
  void take(const StateOf<S>& state) {
    newton_.stay(state);
    newton_.take_means(state.vdot);
  }

  /// A step where no guide jumps.
  Fault step_within(StateOf<S>& state, const SimulationSettings& settings, Real h, long number) {
    fix(settings);
    if constexpr (requires { newton_.close_loops(state); })
      if (h < Real(1e-4) * Real(settings.dt)) return pass(state, h);
    if (h != h_) {
      newton_.stay(state);
      newton_.set_step(h_ = h);
    }
    const Fault fault = newton_.step(state, number);
    if (fault || !(h < Real(settings.dt) / 100)) return fault;
    return newton_.go_on(state);  // the square of a short step, by which penalties are divided, leaves accelerations few digits
  }

  /// Steps have a fixed number of iterations or as many as they need.
  void fix(const SimulationSettings& settings) {
    newton_.settings().iterations = settings.fixed_point.iterations;
    newton_.settings().fixed_cost = settings.fixed_point.fixed_cost;
    if constexpr (requires { solver_.pivot_always(true); }) solver_.pivot_always(settings.fixed_point.fixed_cost);
  }

  /// So short a time along the parabola of the accelerations, with new ones at its end: the rule, which divides by the square of its step, would keep no digits.
  Fault pass(StateOf<S>& state, Real h) {
    const StateOf<S> from = state;
    taylor_step(charts_of(system_), from, h, shift_, state);
    Fault fault = newton_.close_loops(state);
    if (!fault) fault = newton_.go_on(state);
    if (!fault) return {};
    state = from;
    newton_.resume(state);
    return fault;
  }

  S& system_;
  Solver solver_;
  Newton newton_;
  Real h_;
  Speeds<S> shift_;
  [[no_unique_address]] SingleOf single_;
  [[no_unique_address]] CrossedIf<S> impacts_;
  [[no_unique_address]] ImpactWatch<S> watch_;
};

}  // namespace cutjoint
