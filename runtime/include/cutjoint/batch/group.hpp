// Cases that run side by side.
#pragma once

#include <array>
#include <chrono>
#include <span>
#include <vector>

#include "cutjoint/batch/side_by_side.hpp"
#include "cutjoint/core/lane_steps.hpp"
#include "cutjoint/domains.hpp"
#include "cutjoint/failure_report.hpp"
#include "cutjoint/guards.hpp"
#include "cutjoint/initial_state.hpp"
#include "cutjoint/json.hpp"
#include "cutjoint/read_settings.hpp"
#include "cutjoint/run_file.hpp"
#include "cutjoint/settings.hpp"
#include "cutjoint/stop.hpp"

namespace cutjoint::batch {

/// Runs cases of a scene: what a case says stands for what the run file says otherwise.
///
/// They start one by one and take their steps together; a case that fails stays at its last state, and the others go on.
class Group {
 public:
  Group(AnyMechanism<double>& alone, Instances& instances, const RunSettings& settings, const Json& file)
      : alone_(alone), side_by_side_(alone), d_(alone.description()), settings_(settings), file_(file), probes_(instances), lanes_(instances) {
    side_by_side_.lend(probes_);
  }

  /// At most `width` cases: how each ended, with `end`, `smallest` and `largest` value of each column.  After a request to stop they have not
  /// come to their ends.
  std::vector<Json> run(std::span<const Json> cases) {
    results_.assign(cases.size(), Json::object());
    lanes_.clear();
    start(cases);
    if (lanes_.any_goes()) go();
    return results_;
  }

  /// Seconds of all steps so far.
  double seconds() const { return seconds_; }

 private:
  /// The data of a case for its instance.
  struct Case {
    std::vector<double> parameters;
    Roads<double> roads;
    RunInputs<double> inputs;
  };

  void start(std::span<const Json> cases) {
    for (std::size_t k = 0; k < cases.size() && !stop_requested(); ++k) {
      Json file = file_;
      file.update(cases[k]);
      try {
        InitialState<SideBySide> initial_state(side_by_side_, settings_, file);
        const State<double>& state = initial_state.in_motion();
        Case& own = cases_[k] = {read_parameters<double>(d_.parameters, file), Roads<double>(d_.roads, file), {d_.inputs, file}};
        lanes_.put(static_cast<int>(k), LaneStart<State<double>>{.state = state, .parameters = own.parameters.data(),
                                                                 .penalties = initial_state.penalties().data(),
                                                                 .roads = own.roads.list().data(), .inputs = own.inputs.source()});
        results_[k]["undetermined"] = initial_state.undetermined();
      } catch (const Failure& failure) {
        cutjoint::report(failure, results_[k]);
      }
    }
  }

  void go() {
    lanes_.begin(simulation_settings(settings_));
    const auto [steps, stride] = count_steps<double>(settings_);
    end_ = smallest_ = largest_ = lanes_.report();
    const Mask begun = lanes_.going();
    lanes_.watch(Real(0));
    heed(begun & ~lanes_.going(), true);
    const auto begin = std::chrono::steady_clock::now();
    for (long n = 1; n <= steps && lanes_.any_goes() && !stop_requested(); ++n) {
      const Mask going = lanes_.going();
      lanes_.step();
      heed(going & ~lanes_.going(), (n - 1) % stride == 0);
      if (n % stride == 0 || n == steps) record(lanes_.going());
    }
    seconds_ += std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    for (std::size_t k = 0; k < results_.size(); ++k) {
      if (!lanes_.goes(static_cast<int>(k))) continue;
      results_[k]["status"] = "done";
      add_columns(k);
    }
  }

  /// Heed the instances that have stopped.  Where a step has failed the state before it is the last row, unless it `is_row` already.
  void heed(Mask stopped, bool is_row) {
    if (!any(stopped)) return;
    Mask failed{};
    for (int k = 0; k < width; ++k) failed[k] = stopped[k] && lanes_.fault(k).cause != Cause::guard_violated ? -1 : 0;
    if (!is_row) record(failed);
    for (int k = 0; k < width; ++k) {
      if (!stopped[k]) continue;
      cutjoint::report(failure(k), results_[static_cast<std::size_t>(k)]);
      if (lanes_.fault(k).step > 0) add_columns(static_cast<std::size_t>(k));
    }
  }

  /// The reason that a case has stopped.  That of a step is explained by the single mechanism from the state before it.
  Failure failure(int k) {
    const Fault& fault = lanes_.fault(k);
    if (fault.cause == Cause::guard_violated) {
      std::vector<double> margins(d_.guards.size());
      take_lane(k, lanes_.margins(), margins);
      return failure_of_guards(d_.guards, margins, fault.t, fault.step);
    }
    Case& own = cases_[static_cast<std::size_t>(k)];
    State<double> state(d_);
    take_lane(k, lanes_.states(), state);
    alone_.load(own.parameters.data(), {}, own.roads.list().data());
    alone_.drive_by(own.inputs.source());
    alone_.begin_step(state.t, 1.0);
    return explain_by_domains(alone_, state, settings_.dt, failure_of(fault, d_));
  }

  /// A row of some cases.
  void record(Mask which) {
    const std::vector<Real>& values = lanes_.report();
    for (std::size_t i = 0; i < values.size(); ++i) {
      end_[i] = where(which, values[i], end_[i]);
      smallest_[i] = where(which, smaller(smallest_[i], values[i]), smallest_[i]);
      largest_[i] = where(which, larger(largest_[i], values[i]), largest_[i]);
    }
  }

  void add_columns(std::size_t k) {
    Json& result = results_[k];
    result["evaluations"] = lanes_.evaluations(static_cast<int>(k));
    const auto add = [&](const char* name, const std::vector<Real>& values) {
      for (const Real value : values) result[name].push_back(number_or_null(value[static_cast<int>(k)]));
    };
    add("end", end_);
    add("smallest", smallest_);
    add("largest", largest_);
  }

  AnyMechanism<double>& alone_;
  SideBySide side_by_side_;
  const Description& d_;
  const RunSettings& settings_;
  const Json& file_;
  std::array<Case, width> cases_;
  Probes<Instances> probes_;
  LaneSteps<Instances> lanes_;
  std::vector<Real> end_, smallest_, largest_;
  std::vector<Json> results_;
  double seconds_ = 0.0;
};

}  // namespace cutjoint::batch
