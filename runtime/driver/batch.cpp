// The driver of batches of the recursive method.
#include "cutjoint/batch/driver.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <cstddef>
#include <exception>
#include <memory>
#include <mutex>
#include <string_view>
#include <thread>
#include <vector>

#include "cutjoint/batch/group.hpp"
#include "cutjoint/program.hpp"
#include "cutjoint/read_settings.hpp"
#include "cutjoint/stop.hpp"

namespace cutjoint::batch {

namespace {

const Abilities abilities{.tasks = {Task::batch}, .integrators = {Integrator::trapezoidal}};

/// The keys that a case may have of its own.
constexpr auto keys_of_cases = std::to_array<std::string_view>({"parameters", "inputs", "positions", "rates", "roads"});

/// Groups of cases, taken one by one by threads.
class Batch {
 public:
  Batch(const Json& file, MakeAlone make_alone, MakeInstances make_instances)
      : file_(file), make_alone_(make_alone), make_instances_(make_instances), settings_(read_settings<double>(file, abilities)),
        cases_(value_of(file, "cases").get<std::vector<Json>>()), number_of_threads_(read_integer(file, "threads", 1, 4096)) {
    file_.erase("cases");  // each case adds to a copy of the rest
    for (const Json& own : cases_) require_keys(own, keys_of_cases);
  }

  /// Run all cases and return the summary; the results of each group are printed when it is done.
  Json run() {
    heed_stop_requests();
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
