// How cut joints are held together.
#pragma once

#include <optional>

#include "cutjoint/core/mechanism/mechanism.hpp"
#include "cutjoint/core/roads/road.hpp"

namespace cutjoint {

/// By one penalty and a stabilisation; by a penalty for each cut joint and projections, with multipliers that are corrected from one evaluation
/// to the next, or that each evaluation solves for.
enum class Closure { penalty, proximal, solved };

/// Whether each cut joint has a penalty of its own, and steps end with a projection.
constexpr bool is_projected(Closure closure) { return closure != Closure::penalty; }

/// How the recursive equations, which start every run, hold cut joints.  Without a `penalty` it follows from the
/// masses that the cut joints feel at the start; a projected closure has one for each cut joint, up to this one if there is one.
struct StabilisationSettings {
  Closure closure;
  std::optional<double> penalty;
  double damping_ratio;
  double frequency;

  bool operator==(const StabilisationSettings&) const = default;
};

/// Load a mechanism whose cut joints are held by `penalties`, one for each, the same for all with the closure `penalty`; a system holds its own.
template <class M, class Penalties>
void load_mechanism(M& mechanism, const typename M::real_type* parameters, const Road<typename M::real_type>* roads,
                    const StabilisationSettings& stabilisation, const Penalties& penalties) {
  using Real = typename M::real_type;
  if constexpr (requires { mechanism.load(parameters, roads); })
    mechanism.load(parameters, roads);
  else if (is_projected(stabilisation.closure))
    mechanism.load(parameters, {.penalties = penalties.data()}, roads);
  else
    mechanism.load(parameters,
                   {.penalty = penalties.empty() ? Real(1) : penalties.front(),
                    .damping_ratio = Real(stabilisation.damping_ratio),
                    .frequency = Real(stabilisation.frequency)},
                   roads);
}

}  // namespace cutjoint
