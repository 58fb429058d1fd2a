// Steps of a simulation by the trapezoidal rule.
#pragma once

#include "cutjoint/core/stepping/crossed_impacts.hpp"
#include "cutjoint/core/mechanism/relative.hpp"
#include "cutjoint/core/inputs/sampling.hpp"
#include "cutjoint/core/simulation/simulation_settings.hpp"
#include "cutjoint/core/start/start.hpp"

namespace cutjoint {

/// The integrator of a simulation (simulation.hpp) by the fixed point of the trapezoidal rule.  Steps cross events.
template <class M>
class FixedPointSteps {
 public:
  using Real = typename M::real_type;

  using Subject = M;

  static constexpr bool adaptive = false;
  static constexpr bool finds_events = false, knows_residuals = false;

  /// Whether steps may leave loops open without a fault.
  static bool leaves_violations(const SimulationSettings& settings) { return !settings.fixed_point.proximal || settings.fixed_point.fixed_cost; }

  /// The step length that limits penalties.
  static Real fixed_point_step(const SimulationSettings& settings) { return Real(settings.dt); }

  FixedPointSteps(M& mechanism, const SimulationSettings& settings, const Road<Real>*)
      : mechanism_(mechanism), steps_(mechanism, Real(settings.dt), settings.fixed_point),
        relative_(mechanism, Real(1e-12)), impacts_(mechanism, settings.end) {}

  static StabilisationSettings stabilise(const SimulationSettings& settings, Cuts<M>&) { return settings.stabilisation; }

  /// Give the penalties of the cut joints, which outlive the steps.
  void take_penalties(const Cuts<M>& penalties) { penalties_ = &penalties; }

  /// Take over a state.
  void begin(const StateOf<M>&) { steps_.expected().forget(true); }

  Fault start(StateOf<M>&, Real) { return {}; }

  /// Restart after a jump of inputs or a controller's sample: the next step begins with new accelerations and multipliers.
  void restart_after_input_jump(StateOf<M>& state) { steps_.restart(state, *penalties_); }

  /// Accelerations and multipliers of a state as it is.
  Fault accelerate(StateOf<M>& state, Starter<M>& starter) {
    starter.accelerate(state, Real(1));
    return starter.require_finite(state);
  }

  /// Close the loops of a state by moving the masses least.
  Fault close(StateOf<M>& state) { return steps_.projection().close(state); }

  /// Take a step of length h; the state is unchanged on failure.
  Fault step(StateOf<M>& state, const SimulationSettings& settings, Real h, Real, long number) {
    steps_.set_step(h);
    steps_.set_fixed_point(settings.fixed_point);
    if constexpr (can_jump<M>)
      return impacts_.over(state, h, [this](StateOf<M>& at) { relative_.find_accelerations(at); }, watch_, [&](bool) { return steps_.step(state, number); });
    else return steps_.step(state, number);
  }

  /// The state with its accelerations and multipliers.
  const StateOf<M>& complete(const StateOf<M>& state) const { return state; }

  /// Report impacts to an observer.
  void watch_impacts(const ImpactWatch<M>& watch) { watch_ = watch; }

  long iterations() const { return steps_.evaluations(); }
  long evaluations() const {
    if constexpr (can_jump<M>) return steps_.evaluations() + relative_.evaluations();
    else return steps_.evaluations();
  }

  /// The change of accelerations by the last iteration, relative to 1 + the largest of them.
  double change() const { return steps_.change(); }

  /// The accelerations extrapolated to the next step.
  Extrapolation<M>& expected() { return steps_.expected(); }

  struct Memory {
    Extrapolation<M> expected;
    [[no_unique_address]] typename CrossedIf<M>::Memory impacts;
  };

  Memory memory() const { return {steps_.expected(), impacts_.memory()}; }
  void restore(const StateOf<M>&, const Memory& memory) {
    steps_.expected() = memory.expected;
    impacts_.restore(memory.impacts);
  }

 private:
  M& mechanism_;
  const Cuts<M>* penalties_ = nullptr;
  Trapezoidal<M> steps_;
  [[no_unique_address]] std::conditional_t<can_jump<M>, Relative<M>, NoImpacts> relative_;
  [[no_unique_address]] CrossedIf<M> impacts_;
  [[no_unique_address]] ImpactWatch<M> watch_;
};

}  // namespace cutjoint
