// The settings of a simulation.
#pragma once

#include "cutjoint/core/constraints/stabilisation.hpp"
#include "cutjoint/core/stepping/trapezoidal.hpp"

namespace cutjoint {

/// The settings of a simulation besides its parameters: `dt` is the length of its steps, `end` that of the scene, by which rounding of
/// times is measured.  Where steps follow from errors, these are at most `absolute_tolerance` and the share `tolerance` of the value, and
/// one call tries `most_steps` at most.  Steps end where forces change their formulas if they can, but without `events`.  The inputs up to
/// the end may be known before, as in a run: a simulation that `foresees` takes steps beyond the times that it is asked for.  These times
/// then lie between the ends of steps.  Newton's iteration with a `spectral_radius` has the generalised-alpha method in place of the
/// trapezoidal rule.
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
  bool events = true;
  bool foresees = false;
  std::optional<double> spectral_radius{};

  bool operator==(const SimulationSettings&) const = default;
};

/// The settings of a part of a simulation, which may have some of its own.
template <class Part>
struct SettingsOf {
  using type = SimulationSettings;
};

template <class Part>
  requires requires { typename Part::Settings; }
struct SettingsOf<Part> {
  using type = typename Part::Settings;
};

}  // namespace cutjoint
