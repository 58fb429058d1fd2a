// Enforcement of cut joints.
#pragma once

#include <optional>

#include "cutjoint/core/mechanism/mechanism.hpp"
#include "cutjoint/core/roads/road.hpp"

namespace cutjoint {

/// By one penalty and stabilisation; or by a penalty for each cut joint and projections, with multipliers corrected from evaluation to
/// evaluation, or solved for in each.
enum class Closure { penalty, proximal, solved };

/// Whether each cut joint has its own penalty, and steps end with a projection.
constexpr bool is_projected(Closure closure) { return closure != Closure::penalty; }

/// Enforcement of cut joints in the recursive equations, which start every run.  Without a `penalty` it is computed from the
/// effective masses of the cut joints at the start; a projected closure has one for each cut joint, at most the given one.
struct StabilisationSettings {
  Closure closure;
  std::optional<double> penalty;
  double damping_ratio;
  double frequency;

  bool operator==(const StabilisationSettings&) const = default;
};

/// Load a mechanism with `penalties` of its cut joints, one for each, all equal with the closure `penalty`; a system has its own.
template <class M, class Penalties>
void load_mechanism(M& mechanism, const typename M::real_type* parameters, const Road<typename M::real_type>* roads,
                    const StabilisationSettings& stabilisation, const Penalties& penalties) {
  using Real = typename M::real_type;
  if constexpr (requires { mechanism.load(parameters, roads); }) mechanism.load(parameters, roads);
  else if (is_projected(stabilisation.closure)) mechanism.load(parameters, {.penalties = penalties.data()}, roads);
  else mechanism.load(parameters, {.penalty = penalties.empty() ? Real(1) : penalties.front(), .damping_ratio = Real(stabilisation.damping_ratio),
                                   .frequency = Real(stabilisation.frequency)}, roads);
}

}  // namespace cutjoint
