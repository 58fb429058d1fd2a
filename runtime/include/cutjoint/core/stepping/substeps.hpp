// Equal steps of a simulation, divided into substeps at events.
#pragma once

#include "cutjoint/core/stepping/equal_steps.hpp"
#include "cutjoint/core/stepping/implicit_scheme.hpp"
#include "cutjoint/core/stepping/stepped_integrator.hpp"

namespace cutjoint {

/// The integrator of a run (simulation.hpp) by a rule of stepping/equal_steps.hpp: a step of the settings' length, divided into substeps at events.  If a run
/// fails, the state is the last valid one.
template <class Rule>
class SplitSteps : public stepping::SteppedIntegrator<SplitSteps<Rule>, typename Rule::Subject> {
 public:
  using Subject = typename Rule::Subject;
  using Real = typename Subject::real_type;
  using Settings = typename SettingsOf<Rule>::type;
  using Scheme = stepping::ImplicitScheme<stepping::EqualSteps<Rule>>;

  static constexpr bool adaptive = false, knows_residuals = requires(const Rule& rule) { rule.newton(); };

  SplitSteps(Subject& subject, const Settings& settings, const Road<Real>* roads)
      : stepping::SteppedIntegrator<SplitSteps, Subject>(subject, settings), rule_(subject, settings),
        stages_(rule_, indicators_of(subject, settings.events), roads, Real(settings.dt)), stepper_(stages_, {}, Real(settings.end), false), y_(stages_.size()) {}

  static StabilisationSettings stabilise(const SimulationSettings& settings, Cuts<Subject>&) { return settings.stabilisation; }

  Fault start(StateOf<Subject>& state, Real) { return stages_.begin(state); }

  /// Handle a failed step.
  void begin(StateOf<Subject>& state) { state = stages_.enter(); }

  /// Restart after a jump of forces; a singular pose keeps its accelerations.
  void restart_after_input_jump(StateOf<Subject>& state) {
    stages_.adopt();
    stages_.restart();
    this->keep(state);
  }

  const StateOf<Subject>& complete(const StateOf<Subject>& state) const { return state; }

  /// The residuals of the loops in the present state.
  const Residuals& residuals(const StateOf<Subject>&) const requires knows_residuals { return rule_.newton().residuals(); }

  /// The largest residuals of all substeps.
  const Residuals& worst_residuals() const requires knows_residuals { return rule_.worst(); }

  const auto& newton() const requires knows_residuals { return rule_.newton(); }
  const auto& solver() const requires knows_residuals { return rule_.solver(); }
  long factorisations() const requires knows_residuals { return rule_.newton().factorisations(); }
  long iterations() const { return rule_.iterations(); }
  long evaluations() const { return rule_.evaluations(); }

 private:
  friend stepping::SteppedIntegrator<SplitSteps, Subject>;

  Rule rule_;
  stepping::EqualSteps<Rule> stages_;
  stepping::Stepper<Scheme> stepper_;
  typename stepping::Stepper<Scheme>::Vector y_;
};

}  // namespace cutjoint
