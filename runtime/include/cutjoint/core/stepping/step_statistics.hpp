// What a step did: constraint violations, statistics, and limits of these.
#pragma once

#include <algorithm>
#include <string_view>

#include "cutjoint/core/simulation/simulation_settings.hpp"

namespace cutjoint {

/// The violation (m or rad) of the equation with the largest one relative to its limit; zero without equations.
struct ConstraintViolation {
  int equation = -1;
  double size = 0.0, limit = 0.0;

  bool is_torn() const { return !(size <= limit); }

  /// Whether loops are closed after a jump of a guide.
  bool is_closed() const { return size <= 1e-3 * limit; }

  /// Steps until violations are measured again.  That costs a seventh of an evaluation, and small violations grow slowly.
  long next_measurement() const { return size < 0.1 * limit ? 16 : 1; }

  Fault fault(double t, long step) const {
    return {.cause = Cause::loops_violated, .list = FaultList::equations, .index = equation, .t = t, .step = step, .value = size, .size = limit};
  }
};

/// The time (s) in which stabilisation closes a violation, over which its rate counts.
inline double closing_time(const SimulationSettings& settings) {
  return settings.stabilisation.frequency > 0.0 ? 1.0 / settings.stabilisation.frequency : settings.dt;
}

/// The largest violation of equations; `residual_of(i)` is that of one.
ConstraintViolation largest_violation(std::size_t equations, const double* limits, auto residual_of) {
  ConstraintViolation largest;
  for (std::size_t i = 0; i < equations; ++i) {
    const double size = std::abs(static_cast<double>(residual_of(i)));
    if (largest.equation < 0 || size * largest.limit > largest.size * limits[i]) largest = {static_cast<int>(i), size, limits[i]};
  }
  return largest;
}

/// What the last step did: the violation (m or rad) of the `equation` that stands open by the largest share of its limit; the largest rate (m/s or rad/s) at
/// which one opens; what the last iteration still changed the accelerations by, as a share of 1 + the largest of them; the smallest pivot of the
/// factors, as a share of the largest entry of its column, infinity where there are none; iterations and evaluations.
struct StepStatistics {
  double violation = 0.0, violation_rate = 0.0, change = 0.0, pivot = std::numeric_limits<double>::infinity();
  long iterations = 0, evaluations = 0;
  int equation = -1;
};

/// The numbers that have limits: those of `StepStatistics`, in that order.
inline constexpr const char* limit_names[] = {"violation", "violation_rate", "change", "pivot", "iterations", "evaluations"};

/// Limits that a host sets: of pivots the least, of all others the most.
class Limits {
 public:
  static constexpr int number = std::size(limit_names);

  Limits() {
    values_.fill(std::numeric_limits<double>::infinity());
    values_[pivot_] = 0.0;
  }

  /// Whether there are any, and some of what has to be measured.
  bool any() const { return any_; }
  bool of_loops() const { return std::isfinite(values_[0]) || std::isfinite(values_[1]); }
  bool of_pivots() const { return values_[pivot_] > 0.0; }

  void set(int which, double value) {
    values_[static_cast<std::size_t>(which)] = value;
    any_ = of_pivots();
    for (std::size_t i = 0; i < number; ++i) any_ = any_ || (i != pivot_ && std::isfinite(values_[i]));
  }

  /// Which limit a step exceeds, and by what; nothing where none.
  Fault watch(const StepStatistics& statistics, double t, long step) const {
    const double numbers[] = {statistics.violation, statistics.violation_rate, statistics.change, statistics.pivot, static_cast<double>(statistics.iterations), static_cast<double>(statistics.evaluations)};
    for (std::size_t i = 0; i < number; ++i)
      if (i == pivot_ ? !(numbers[i] >= values_[i]) : !(numbers[i] <= values_[i]))
        return {.cause = Cause::limit_exceeded, .list = FaultList::limits, .index = static_cast<int>(i), .t = t, .step = step, .value = numbers[i], .size = values_[i],
                .equation = i == 0 ? statistics.equation : -1};
    return {};
  }

 private:
  static constexpr std::size_t pivot_ = static_cast<std::size_t>(std::ranges::find(limit_names, std::string_view("pivot")) - std::ranges::begin(limit_names));

  std::array<double, number> values_;
  bool any_ = false;
};

}  // namespace cutjoint
