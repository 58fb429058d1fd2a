// The common base of integrators with a stepper.
#pragma once

#include "cutjoint/core/constraints/impacts.hpp"
#include "cutjoint/core/simulation/simulation_settings.hpp"

namespace cutjoint::stepping {

/// Steps of an integrator (simulation.hpp) over coordinates and velocities of S.  `Own` has the `stepper_` of stepper.hpp, memory `y_` for its values, `begin`, and
/// `stages_`, or a `keep` of its own.
template <class Own, class S>
class SteppedIntegrator {
 public:
  using Real = typename S::real_type;

  static constexpr bool finds_events = true;

  SteppedIntegrator(S& subject, const SimulationSettings& settings) : impacts_(subject, settings.end) {}

  /// The step length that limits penalties: none without fixed-point iteration.
  static Real fixed_point_step(const SimulationSettings&) { return Real(0); }

  /// Integrate the state to a time; unchanged on failure.
  Fault step(StateOf<S>& state, const SimulationSettings& settings, Real, Real until, long number) {
    get_ready(settings, until);
    const Fault fault = own().stepper_.advance(state.t, until, own().y_, number);
    return finish(state, until, fault);
  }

  /// Step to a time, or to an event if that is earlier.
  Fault step_to_event(StateOf<S>& state, const SimulationSettings& settings, Real until, long number) {
    get_ready(settings, until);
    const Fault fault = own().stepper_.advance_to_event(state.t, until, own().y_, number);
    return finish(state, own().stepper_.time(), fault);
  }

  /// The end of the run, if known in advance.
  void run_to(Real end) { own().stepper_.run_to(end); }

  /// Report impacts to an observer.
  void watch_impacts(const ImpactWatch<S>& watch) { watch_ = watch; }

  auto& stepper() { return own().stepper_; }
  const auto& stepper() const { return own().stepper_; }

  /// The indicator of the last event.
  std::size_t last_event() const { return own().stepper_.last_event(); }
  long events() const { return own().stepper_.counts().events; }

 protected:
  /// Put accelerations and multipliers of the steps into a state.
  void keep(StateOf<S>& state) const {
    state.vdot = own().stages_.present().vdot;
    state.lambda = own().stages_.present().lambda;
  }

 private:
  Own& own() { return static_cast<Own&>(*this); }
  const Own& own() const { return static_cast<const Own&>(*this); }

  void get_ready(const SimulationSettings& settings, Real until) {
    if constexpr (requires { own().take(settings); }) own().take(settings);
    if (!settings.foresees) own().stepper_.limit(until);
    if constexpr (can_jump<S>) own().stepper_.strike_by({&SteppedIntegrator::strike<typename Own::Scheme>, this});
    if constexpr (Own::adaptive) own().stepper_.bound(settings.most_steps);
  }

  /// Apply the impulses of jumps of a guide's rate.
  template <class Scheme>
  static void strike(void* who, Scheme& scheme, std::size_t which, Real since) {
    SteppedIntegrator* const own = static_cast<SteppedIntegrator*>(who);
    own->impacts_.meet(scheme, which, since, own->watch_);
  }

  Fault finish(StateOf<S>& state, Real t, const Fault& fault) {
    if (fault) {
      own().begin(state);
      return fault;
    }
    const auto& y = own().y_;
    const auto middle = y.begin() + state.q.size();
    std::copy(y.begin(), middle, state.q.begin());
    std::copy(middle, y.end(), state.v.begin());
    state.t = t;
    own().keep(state);
    return {};
  }

  [[no_unique_address]] std::conditional_t<can_jump<S>, Impacts<S>, NoImpacts> impacts_;
  [[no_unique_address]] ImpactWatch<S> watch_;
};

}  // namespace cutjoint::stepping
