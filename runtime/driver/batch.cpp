// The driver of batches of the recursive method.
#include "cutjoint/batch/driver.hpp"

#include <mutex>

#include "cutjoint/core/stepping/lane_steps.hpp"
#include "cutjoint/guards.hpp"
#include "cutjoint/initial_state.hpp"
#include "cutjoint/program.hpp"
#include "cutjoint/read_settings.hpp"

namespace cutjoint::batch {

namespace {

const Abilities abilities{.integrators = &IntegratorRow::batch};

}  // namespace

/// A mechanism with several instances.
using Instances = AnyMechanism<Real>;

/// A mechanism that somebody else holds.
class BorrowedMechanism {
 public:
  using real_type = double;

  explicit BorrowedMechanism(AnyMechanism<double>& alone) : alone_(alone) {}

  const Description& description() const { return alone_.description(); }
  void load(const double* parameters, const Stabilisation<double>& s, const Road<double>* roads) { alone_.load(parameters, s, roads); }
  void drive_by(const InputSource<double>& source) { alone_.drive_by(source); }
  void begin_step(double t, double motion) { alone_.begin_step(t, motion); }
  void evaluate(const double* q, const double* v, const double* lambda, double* vdot, double* correction) const {
    alone_.evaluate(q, v, lambda, vdot, correction);
  }
  void constraint_residual(const double* q, const double* v, double* residual, double* rate) const { alone_.constraint_residual(q, v, residual, rate); }
  void report(const double* q, const double* v, const double* vdot, const double* lambda, double* column) const {
    alone_.report(q, v, vdot, lambda, column);
  }
  void energy(const double* q, const double* v, const double* vdot, const double* lambda, double* energy) const {
    alone_.energy(q, v, vdot, lambda, energy);
  }
  void project(const double* q, const double* violation, double* dz) const { alone_.project(q, violation, dz); }
  void domains(const double* q, const double* v, const double* lambda, double* inside) const { alone_.domains(q, v, lambda, inside); }

 private:
  AnyMechanism<double>& alone_;
};

using SideBySide = cutjoint::SideBySide<BorrowedMechanism, Instances>;

/// Runs cases of a scene: what a case says stands for what the run file says otherwise.
///
/// They start one by one and take their steps together; a case that fails stays at its last state, and the others go on.
class Group {
 public:
  Group(AnyMechanism<double>& alone, Instances& instances, const RunSettings& settings, const Json& file)
      : alone_(alone), side_by_side_(alone), d_(alone.description()), settings_(settings), file_(file), lanes_(instances) {
    side_by_side_.lend(lanes_);
  }

  /// At most `width` cases: how each ended, with `end`, `smallest` and `largest` value of each column.  After a request to stop they have not
  /// come to their ends.
  std::vector<Json> run(std::span<const Json> cases) {
    results_.assign(cases.size(), Json::object());
    lanes_.clear();
    start(cases);
    if (lanes_.any_running()) go();
    return results_;
  }

  /// Seconds of all steps so far.
  double seconds() const { return seconds_; }

 private:
  using Start = InitialState<SideBySide>;

  void start(std::span<const Json> cases) {
    std::array<const State<double>*, width> begun{};
    for (std::size_t k = 0; k < cases.size() && !stop_requested(); ++k) {
      files_[k] = file_;
      files_[k].update(cases[k]);
      try {
        Start& start = starts_[k].emplace(side_by_side_, settings_, files_[k]);
        begun[k] = &start.in_motion();
        results_[k]["undetermined"] = start.undetermined();
      } catch (const Failure& failure) {
        cutjoint::report(starts_[k]->explain(failure), results_[k]);
      }
    }
    for (std::size_t k = 0; k < begun.size(); ++k)
      if (begun[k]) put(k, *begun[k]);
  }

  void put(std::size_t k, const State<double>& state) {
    ModelData<double>& data = starts_[k]->data();
    lanes_.put(static_cast<int>(k), LaneStart<State<double>>{.state = state, .parameters = data.parameters().data(),
                                                             .penalties = starts_[k]->penalties().data(), .roads = data.roads().data(),
                                                             .inputs = data.inputs()});
  }

  void go() {
    lanes_.begin(simulation_settings(settings_));
    const auto [steps, stride] = count_steps<double>(settings_);
    end_ = smallest_ = largest_ = lanes_.report();
    const Mask begun = lanes_.running();
    lanes_.watch(Real(0));
    handle(begun & ~lanes_.running(), true);
    const auto begin = std::chrono::steady_clock::now();
    for (long n = 1; n <= steps && lanes_.any_running() && !stop_requested(); ++n) {
      const Mask running = lanes_.running();
      lanes_.step();
      handle(running & ~lanes_.running(), (n - 1) % stride == 0);
      if (n % stride == 0 || n == steps) record(lanes_.running());
    }
    seconds_ += std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    for (std::size_t k = 0; k < results_.size(); ++k) {
      if (!lanes_.is_running(static_cast<int>(k))) continue;
      results_[k]["status"] = "done";
      add_columns(k);
    }
  }

  /// Heed the instances that have stopped.  Where a step has failed the state before it is the last row, unless it `is_row` already.
  void handle(Mask stopped, bool is_row) {
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
      read_lane(k, lanes_.margins(), margins);
      return failure_of_guards(d_.guards, margins, fault.t, fault.step);
    }
    Start& start = *starts_[static_cast<std::size_t>(k)];
    State<double> state(d_);
    read_lane(k, lanes_.states(), state);
    start.data().load_mechanism(alone_, settings_.stabilisation, start.penalties());
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
    add("minimum", smallest_);
    add("maximum", largest_);
  }

  AnyMechanism<double>& alone_;
  SideBySide side_by_side_;
  const Description& d_;
  const RunSettings& settings_;
  const Json& file_;
  std::array<Json, width> files_;
  std::array<std::optional<Start>, width> starts_;
  LaneSteps<Instances> lanes_;
  std::vector<Real> end_, smallest_, largest_;
  std::vector<Json> results_;
  double seconds_ = 0.0;
};

namespace {

/// Groups of cases, taken one by one by threads.
class Batch {
 public:
  Batch(const Json& file, MakeAlone make_alone, MakeInstances make_instances)
      : file_(file), make_alone_(make_alone), make_instances_(make_instances), settings_(read_settings(file, abilities)),
        cases_(file.at("cases").get<std::vector<Json>>()), number_of_threads_(file.at("threads")) {
    file_.erase("cases");  // each case adds to a copy of the rest
  }

  /// Run all cases and return the summary; the results of each group are printed when it is done.
  Json run() {
    handle_stop_requests();
    {
      const std::size_t groups = (cases_.size() + width - 1) / width;
      std::vector<std::jthread> threads;  // joined at the end of the block
      for (std::size_t i = 0; i < std::min(groups, static_cast<std::size_t>(number_of_threads_)); ++i) threads.emplace_back([this] { work(); });
    }
    if (error_) std::rethrow_exception(error_);
    return Json{{"status", done_ < cases_.size() ? "interrupted" : "done"}, {"seconds", seconds_}};
  }

 private:
  void work() {
    try {
      const std::unique_ptr<AnyMechanism<double>> alone(make_alone_());
      const std::unique_ptr<AnyMechanism<Real>> instances(make_instances_());
      Group group(*alone, *instances, settings_, file_);
      for (std::size_t first = width * next_++; first < cases_.size(); first = width * next_++) {
        const std::size_t number = std::min<std::size_t>(width, cases_.size() - first);
        const Json results = group.run(std::span(cases_).subspan(first, number));
        const std::lock_guard lock(mutex_);
        if (stop_requested()) break;  // they may not have come to their ends
        done_ += number;
        std::cout << Json{{"first", first}, {"results", results}} << '\n'
                  << Json{{"progress", static_cast<double>(done_) / static_cast<double>(cases_.size())}} << std::endl;
      }
      const std::lock_guard lock(mutex_);
      seconds_ += group.seconds();
    } catch (...) {
      const std::lock_guard lock(mutex_);
      error_ = std::current_exception();
    }
  }

  Json file_;
  MakeAlone make_alone_;
  MakeInstances make_instances_;
  RunSettings settings_;
  std::vector<Json> cases_;
  int number_of_threads_;
  std::atomic<std::size_t> next_ = 0;
  std::mutex mutex_;
  std::size_t done_ = 0;
  double seconds_ = 0.0;
  std::exception_ptr error_;
};

}  // namespace

int run_main(int argc, char** argv, MakeAlone make_alone, MakeInstances make_instances) {
  return run_program(argc, argv, "simulator", [&](const Json& file) { return Batch(file, make_alone, make_instances).run(); });
}

}  // namespace cutjoint::batch
