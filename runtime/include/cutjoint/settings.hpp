// The settings of a run.
#pragma once

#include <string>

#include "cutjoint/core/simulation/simulation_settings.hpp"
#include "cutjoint/integrator_table.hpp"

namespace cutjoint {

enum class Task { simulate, realtime, equilibrium };
enum class Pose { design, equilibrium };

/// The settings of a run as its run file has them, each within its range; what has no value is found by the run, or not used by it.
///
/// An `added` integrator is one of another package (extension.hpp).  Steps have the length `dt`, those of an adaptive integrator end at its
/// multiples; the table has a row each `output_step`.  `solver` is the name of a linear solver.  With `fixed_cost` a step has `iterations`
/// iterations, else so many at most.  `events` is whether steps end where forces change their formulas, `energy` whether work and energy are
/// balanced beside the motion.  Columns that jump within `jumps_within` (s) of a row are looked for, if it is given.
struct RunSettings {
  Task task;
  Pose pose;
  double end;
  double output_step;
  Integrator integrator;
  std::optional<std::string> solver;
  double dt;
  std::optional<double> penalty;
  double tolerance;
  int iterations;
  int multiplier_updates;
  bool fixed_cost;
  bool events;
  std::optional<double> absolute_tolerance;
  std::optional<double> spectral_radius;
  bool energy;
  std::optional<double> jumps_within;
  StabilisationSettings stabilisation;
};

/// The settings of a simulation whose inputs are known up to its end.
inline SimulationSettings simulation_settings(const RunSettings& settings) {
  const FixedPoint fixed_point{settings.tolerance, settings.iterations, settings.multiplier_updates, is_projected(settings.stabilisation.closure), settings.fixed_cost};
  return {.stabilisation = settings.stabilisation, .fixed_point = fixed_point, .dt = settings.dt, .end = settings.end,
          .penalty = settings.penalty, .tolerance = settings.tolerance, .absolute_tolerance = settings.absolute_tolerance.value_or(0.0),
          .most_steps = std::numeric_limits<long>::max(), .equilibrium = settings.pose == Pose::equilibrium, .events = settings.events, .foresees = true,
          .spectral_radius = settings.spectral_radius};
}

}  // namespace cutjoint
