// Constraint violations relative to their limits.
#pragma once

#include <cmath>
#include <cstddef>

#include "cutjoint/core/simulation/fault.hpp"
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
template <class ResidualOf>
ConstraintViolation largest_violation(std::size_t equations, const double* limits, ResidualOf residual_of) {
  ConstraintViolation largest;
  for (std::size_t i = 0; i < equations; ++i) {
    const double size = std::abs(static_cast<double>(residual_of(i)));
    if (largest.equation < 0 || size * largest.limit > largest.size * limits[i]) largest = {static_cast<int>(i), size, limits[i]};
  }
  return largest;
}

}  // namespace cutjoint
