// Cases that run side by side.
#pragma once

#include <chrono>
#include <cmath>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "cutjoint/batch/side_by_side.hpp"
#include "cutjoint/core/trapezoidal.hpp"
#include "cutjoint/domains.hpp"
#include "cutjoint/failure_report.hpp"
#include "cutjoint/guards.hpp"
#include "cutjoint/json.hpp"
#include "cutjoint/initial_state.hpp"
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
      : alone_(alone), side_by_side_(alone, instances), instances_(instances), d_(instances.description()), settings_(settings), file_(file), lanes_(instances), state_(d_),
        parameters_(d_.parameters.size()), penalty_(1.0), margin_(d_.guards.size()), values_(d_.columns.size()), end_(values_), smallest_(values_),
        largest_(values_) {}

  /// At most `width` cases: how each ended, with `end`, `smallest` and `largest` value of each column.  After a request to stop they have not
  /// come to their ends.
  std::vector<Json> run(std::span<const Json> cases) {
    results_.assign(cases.size(), Json::object());
    going_ = Mask{};
    start(cases);
    if (any(going_)) go();
    return results_;
  }

  /// Seconds of all steps so far.
  double seconds() const { return seconds_; }

 private:
  /// What a case gives its instance.
  struct Case {
    std::vector<double> parameters;
    Roads<double> roads;
    RunInputs<double> inputs;
  };

  void start(std::span<const Json> cases) {
    cases_.clear();
    cases_.resize(width);
    for (std::size_t k = 0; k < cases.size() && !stop_requested(); ++k) {
      Json own = file_;
      own.update(cases[k]);
      try {
        InitialState<SideBySide> initial_state(side_by_side_, settings_, own);
        const State<double> state = initial_state.in_motion();
        // the first to start also stands in for those that do not
        for (std::size_t lane = any(going_) ? k : 0; lane < width; ++lane) {
          SideBySide::put(state, static_cast<int>(lane), state_);
          if (!initial_state.penalties().empty()) penalty_.v[lane] = initial_state.penalties().front();
          cases_[lane] = {read_parameters<double>(d_.parameters, own), Roads<double>(d_.roads, own), {d_.inputs, own}};
        }
        results_[k]["undetermined"] = initial_state.undetermined();
        going_[static_cast<int>(k)] = -1;
      } catch (const Failure& failure) {
        cutjoint::report(failure, results_[k]);
      }
    }
  }

  void load() {
    roads_.clear();
    for (std::size_t i = 0; i < d_.roads.size(); ++i) {
      Road<Real>& all = roads_.emplace_back();
      for (int k = 0; k < width; ++k) all.put(k, cases_[static_cast<std::size_t>(k)].roads.list()[i]);
    }
    for (std::size_t i = 0; i < parameters_.size(); ++i)
      for (int k = 0; k < width; ++k) parameters_[i].v[k] = cases_[static_cast<std::size_t>(k)].parameters[i];
    const StabilisationSettings& s = settings_.stabilisation;
    instances_.load(parameters_.data(), {.penalty = penalty_, .damping_ratio = Real(s.damping_ratio), .frequency = Real(s.frequency)},
                    roads_.data());
    lanes_.drive(instances_, [this](int k) { return cases_[static_cast<std::size_t>(k)].inputs.source(); });
    instances_.begin_step(state_.t, Real(1));
  }

  void go() {
    load();
    const double dt = settings_.dt;
    const auto [steps, stride] = count_steps<double>(settings_);
    integrator_.emplace(instances_, Real(dt), fixed_point_of(settings_));
    report();
    end_ = smallest_ = largest_ = values_;
    watch(0);
    const auto begin = std::chrono::steady_clock::now();
    for (long n = 1; n <= steps && any(going_) && !stop_requested(); ++n) {
      const Mask failed = integrator_->step_of(state_, going_);
      state_.t = where(going_ & ~failed, Real(static_cast<double>(n) * dt), state_.t);
      if (any(failed)) {
        instances_.begin_step(state_.t, Real(1));  // back to the last state of those that failed
        if ((n - 1) % stride != 0) record(failed);
        for (int k = 0; k < width; ++k)
          if (failed[k]) stop(k, explained(k, dt, failure_of(integrator_->fault(k, n), d_)));
      }
      watch(n);
      if (n % stride == 0 || n == steps) record(going_);
    }
    seconds_ += std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    for (int k = 0; k < width; ++k) {
      if (!going_[k]) continue;
      results_[static_cast<std::size_t>(k)]["status"] = "done";
      add_columns(k);
    }
  }

  /// The failure of a step, explained by the single mechanism from the state before it.
  Failure explained(int k, double dt, const Failure& failure) {
    State<double> state(d_);
    take_alone(k, state);
    return explain_by_domains(alone_, state, dt, failure);
  }

  /// The state of a case, and the mechanism alone with its inputs.
  void take_alone(int k, State<double>& state) {
    Case& own = cases_[static_cast<std::size_t>(k)];
    SideBySide::take(state_, k, state);
    alone_.load(own.parameters.data(), {}, own.roads.list().data());
    alone_.drive_by(own.inputs.source());
    alone_.begin_step(state.t, 1.0);
  }

  /// Stop the cases whose guards are violated.  The single mechanism finds which guard it is, and by how much.
  void watch(long number) {
    if (margin_.empty()) return;
    instances_.guard(state_.q.data(), state_.v.data(), margin_.data());
    Mask violated{};
    for (const Real margin : margin_) violated |= going_ & ~(margin.v >= Real(0).v);
    for (int k = 0; k < width; ++k) {
      if (!violated[k]) continue;
      State<double> state(d_);
      take_alone(k, state);
      try {
        Guards<AnyMechanism<double>>(alone_).check(state, number);
      } catch (const Failure& failure) {
        stop(k, failure);
      }
    }
  }

  void report() { instances_.report(state_.q.data(), state_.v.data(), state_.vdot.data(), state_.lambda.data(), values_.data()); }

  /// A row of some cases.
  void record(Mask which) {
    report();
    for (std::size_t i = 0; i < values_.size(); ++i) {
      end_[i] = where(which, values_[i], end_[i]);
      smallest_[i] = where(which, smaller(smallest_[i], values_[i]), smallest_[i]);
      largest_[i] = where(which, larger(largest_[i], values_[i]), largest_[i]);
    }
  }

  void stop(int k, const Failure& failure) {
    going_[k] = 0;
    cutjoint::report(failure, results_[static_cast<std::size_t>(k)]);
    if (failure.step > 0) add_columns(k);
  }

  void add_columns(int k) {
    Json& result = results_[static_cast<std::size_t>(k)];
    result["evaluations"] = integrator_->evaluations()[k];
    const auto add = [&](const char* name, const std::vector<Real>& values) {
      for (const Real value : values) result[name].push_back(number_or_null(value[k]));
    };
    add("end", end_);
    add("smallest", smallest_);
    add("largest", largest_);
  }

  AnyMechanism<double>& alone_;
  SideBySide side_by_side_;
  Instances& instances_;
  const Description& d_;
  const RunSettings& settings_;
  const Json& file_;
  std::vector<Case> cases_;
  LaneInputs<Instances> lanes_;
  State<Real> state_;
  std::vector<Real> parameters_;
  Real penalty_;
  std::vector<Road<Real>> roads_;
  std::optional<Trapezoidal<Instances>> integrator_;
  Mask going_{};
  std::vector<Real> margin_, values_, end_, smallest_, largest_;
  std::vector<Json> results_;
  double seconds_ = 0.0;
};

}  // namespace cutjoint::batch
