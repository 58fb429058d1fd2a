// The settings of a simulation.
#pragma once

#include <optional>

#include "cutjoint/core/stabilisation.hpp"
#include "cutjoint/core/trapezoidal.hpp"

namespace cutjoint {

/// What a simulation needs to know besides its parameters: `dt` is the length of its steps, `end` that of the scene, by which rounding of times is
/// measured.  Where steps follow from errors, these are at most `absolute_tolerance` and the share `tolerance` of the value, and one call tries `most_steps` at
/// most.
struct SimulationSettings {
  StabilisationSettings stabilisation;
  FixedPoint fixed_point;
  double dt;
  double end;
  std::optional<double> penalty;
  double tolerance;
  double absolute_tolerance;
  long most_steps = 1000000;
  bool equilibrium;

  bool operator==(const SimulationSettings&) const = default;
};

}  // namespace cutjoint
