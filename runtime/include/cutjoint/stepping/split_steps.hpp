// A rule of equal steps that end at events too, as the driver sees it.
#pragma once

#include <array>
#include <string_view>
#include <vector>

#include "cutjoint/json.hpp"
#include "cutjoint/row_by_row.hpp"
#include "cutjoint/run_file.hpp"
#include "cutjoint/stepping/equal_steps.hpp"
#include "cutjoint/core/stepping/implicit_scheme.hpp"
#include "cutjoint/core/stepping/stepper.hpp"
#include "cutjoint/stepping/summarise.hpp"

namespace cutjoint::stepping {

/// Parts made before their base: a rule of stepping/equal_steps.hpp, whose `load` gives its mechanism or system its data and settings.
template <class Subject, class Rule>
struct Parts {
  using Real = typename Rule::Real;

  Parts(Subject& subject, const RunSettings& settings, const Json& file)
      : data(subject.description(), file), rule(subject, settings), steps(rule, data.roads(), Real(settings.dt)) {
    rule.load(data, settings.stabilisation);
  }

  ModelData<Real> data;
  Rule rule;
  EqualSteps<Rule> steps;
};

/// Goes on with a step a row of the run, in parts where events lie.
template <class Subject, class Rule>
class SplitSteps : private Parts<Subject, Rule>, public RowByRow<EqualSteps<Rule>, Stepper<ImplicitScheme<EqualSteps<Rule>>>, Subject> {
  using Base = RowByRow<EqualSteps<Rule>, Stepper<ImplicitScheme<EqualSteps<Rule>>>, Subject>;

 public:
  using Real = typename Rule::Real;

  SplitSteps(Subject& subject, const RunSettings& settings, const Json& file)
      : Parts<Subject, Rule>(subject, settings, file), Base(subject, this->steps, settings) {}

  void begin(const State<double>& start, double) { Base::begin(State<Real>(start)); }

  void load_penalties(const std::vector<double>& penalties)
    requires requires(Rule rule, ModelData<Real> data, StabilisationSettings s) { rule.load_penalties(data, s, std::vector<double>()); }
  {
    this->rule.load_penalties(this->data, this->settings().stabilisation, penalties);
  }

  void prepare() {
    Base::prepare(Tolerances<Real>{}, this->origin() + Real(this->settings().end), false);
  }

  /// Throws Failure; the last row is then that of the last part that counts.
  void step(long number) {
    try {
      Base::step(number);
      this->check_beside([this] { this->rule.measure(this->steps.present()); });
    } catch (const Failure&) {
      this->stop_at(this->steps.enter());
      throw;
    }
  }

  static constexpr std::array<std::string_view, 3> step_columns{"steps", "position", "velocity"};

  /// The parts of a row's step, and its residuals.
  const std::vector<double>& measure_step() {
    const Residuals row = this->rule.measure(this->steps.present());
    measured_ = {static_cast<double>(this->stepper()->steps() - steps_), row.position, row.velocity};
    steps_ = this->stepper()->steps();
    return measured_;
  }

  void summarise(Json& summary) const {
    Base::summarise(summary);
    this->rule.summarise(summary);
    if (this->stepper()) stepping::summarise(this->stepper()->counts(), this->rule.description().switches, summary);
  }

 private:
  std::vector<double> measured_;
  long steps_ = 0;
};

}  // namespace cutjoint::stepping
