// The recursive method's trapezoidal rule for steps that are split at events.
#pragma once

#include "cutjoint/core/mechanism/relative.hpp"
#include "cutjoint/core/simulation/simulation_settings.hpp"

namespace cutjoint::stepping {

/// The rule of equal_steps.hpp over `Trapezoidal`.
template <Mechanism M>
class TrapezoidalRule {
 public:
  using Real = typename M::real_type;
  using Subject = M;

  static constexpr double least = 0;

  TrapezoidalRule(M& mechanism, const SimulationSettings& settings)
      : mechanism_(mechanism), proximal_(settings.fixed_point.proximal), steps_(mechanism, Real(settings.dt), settings.fixed_point),
        relative_(mechanism, Real(1e-12)), probe_(design_state(mechanism)) {}

  const M& subject() const { return mechanism_; }

  Fault start(StateOf<M>& state) {
    mechanism_.begin_step(state.t, Real(1));
    return {};
  }

  Fault restart(StateOf<M>& state) {
    probe_ = state;
    relative_.find_accelerations(probe_);
    if (const Real most = largest(probe_.vdot); !std::isfinite(static_cast<double>(most)))
      return {.cause = Cause::accelerations_not_finite, .list = FaultList::speeds, .index = 0, .t = static_cast<double>(state.t),
              .value = static_cast<double>(most)};
    state.vdot = probe_.vdot;
    state.lambda = probe_.lambda;
    return {};
  }

  Fault step(StateOf<M>& state, Real h, long number) {
    steps_.set_step(h);
    return steps_.step(state, number);
  }

  void keep() {}
  void go_back(const StateOf<M>&) {}

  Fault project(StateOf<M>& state) { return proximal_ ? steps_.projection().close(state) : Fault{}; }

  void enter(Real t) { mechanism_.begin_step(t, Real(1)); }

  void events(const StateOf<M>& state, Real* values) {
    mechanism_.begin_step(state.t, Real(1));
    mechanism_.events(state.q.data(), state.v.data(), values);
  }

  long iterations() const { return steps_.evaluations(); }
  long evaluations() const { return steps_.evaluations() + relative_.evaluations(); }

 private:
  M& mechanism_;
  bool proximal_;
  Trapezoidal<M> steps_;
  Relative<M> relative_;
  StateOf<M> probe_;
};

}  // namespace cutjoint::stepping
