// Steps of a simulation by an explicit Runge-Kutta method.
#pragma once

#include <algorithm>
#include <cstddef>
#include <optional>

#include "cutjoint/core/fault.hpp"
#include "cutjoint/core/mechanism.hpp"
#include "cutjoint/core/road.hpp"
#include "cutjoint/core/runge_kutta/scheme.hpp"
#include "cutjoint/core/runge_kutta/tables.hpp"
#include "cutjoint/core/runge_kutta/watched.hpp"
#include "cutjoint/core/simulation_settings.hpp"
#include "cutjoint/core/start.hpp"
#include "cutjoint/core/state.hpp"
#include "cutjoint/core/stepping/stepper.hpp"

namespace cutjoint {

/// The integrator of a simulation (simulation.hpp) by a table of runge_kutta/tables.hpp.  Steps end where formulas change.
template <Sized M, class Table>
class ExplicitSteps {
 public:
  using Real = typename M::real_type;

  using Subject = M;

  static constexpr bool adaptive = Table::adaptive;
  static constexpr bool finds_events = true;

  /// The length of steps with a fixed point, which penalties follow: there is none.
  static Real fixed_point_step(const SimulationSettings&) { return Real(0); }

  ExplicitSteps(M& mechanism, const SimulationSettings& settings, const Road<Real>* roads)
      : dynamics_(mechanism, {switches_of<M>(), roads}, runge_kutta::tolerance_of_multipliers<Table>(Real(settings.tolerance))),
        stepper_(dynamics_, {Real(settings.tolerance), Real(settings.absolute_tolerance)}, Real(settings.end)) {}

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

  /// Inputs are others from now on.
  void heed_inputs(const StateOf<M>& state) { begin(state); }

  /// Accelerations and multipliers of a state as it is, which is taken over.
  Fault accelerate(StateOf<M>& state, Starter<M>& starter) {
    starter.accelerate(state, Real(1));
    begin(state);
    return starter.require_finite(state);
  }

  /// Close the loops of a state by moving the masses least.
  Fault close(StateOf<M>& state) { return dynamics_.projection().close(state); }

  /// From the state to a time; without new accelerations.
  Fault step(StateOf<M>& state, const SimulationSettings& settings, Real, Real until, long number) {
    get_ready(settings, until);
    const Fault fault = stepper_.advance(state.t, until, y_, number);
    return finish(state, until, fault);
  }

  /// The same, or to where a force changes its formula, if that is earlier.
  Fault step_to_event(StateOf<M>& state, const SimulationSettings& settings, Real until, long number) {
    get_ready(settings, until);
    const Fault fault = stepper_.advance_to_event(state.t, until, y_, number);
    return finish(state, stepper_.time(), fault);
  }

  /// The switch of the last event.
  std::size_t last_event() const { return stepper_.last_event(); }
  long events() const { return stepper_.counts().events; }

  /// The state with its accelerations and multipliers, until the next call.
  const StateOf<M>& complete(const StateOf<M>& state) { return dynamics_.complete(state.t, y_); }

  using Memory = typename stepping::Stepper<runge_kutta::Scheme<runge_kutta::Watched<M>, Table>>::Memory;

  Memory memory() const { return stepper_.memory(); }

  void restore(const StateOf<M>& state, const Memory& memory) {
    y_ = dynamics_.begin(state);
    stepper_.restore(memory);
  }

 private:
  void get_ready(const SimulationSettings& settings, Real until) {
    stepper_.limit(until);
    if constexpr (adaptive) stepper_.bound(settings.most_steps);
  }

  Fault finish(StateOf<M>& state, Real t, const Fault& fault) {
    if (fault) {
      begin(state);
      return fault;
    }
    const auto middle = y_.begin() + state.q.size();
    std::copy(y_.begin(), middle, state.q.begin());
    std::copy(middle, y_.end(), state.v.begin());
    state.t = t;
    state.lambda = dynamics_.multipliers();
    return {};
  }

  runge_kutta::Watched<M> dynamics_;
  stepping::Stepper<runge_kutta::Scheme<runge_kutta::Watched<M>, Table>> stepper_;
  typename runge_kutta::Watched<M>::Vector y_;
};

}  // namespace cutjoint
