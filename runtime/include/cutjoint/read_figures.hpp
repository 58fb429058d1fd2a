// The figures of a run file for the rules of steps, apart from these, which are compiled without JSON.
#pragma once

#include "cutjoint/json.hpp"
#include "cutjoint/lagrangian/newton.hpp"
#include "cutjoint/run_file.hpp"
#include "cutjoint/trapezoidal.hpp"

namespace cutjoint {

/// Those of the fixed point.
inline FixedPoint read_fixed_point(const Json& file) {
  const Json& numerics = file.at("numerics");
  return {numerics.at("tolerance").get<double>(), numerics.at("iterations").get<int>(), numerics.at("multiplier_updates").get<int>(),
          is_proximal(file.at("stabilisation")), numerics.value("fixed_cost", false)};
}

/// Those of Newton's iteration; tasks without steps can do without those of steps.
inline NewtonFigures read_newton_figures(const Json& numerics) {
  return {.dt = numerics.value("dt", 0.0),
          .penalty = numerics.at("penalty").is_null() ? 0.0 : numerics.at("penalty").get<double>(),
          .tolerance = numerics.value("tolerance", 1e-6),
          .iterations = numerics.value("iterations", 100),
          .multiplier_updates = numerics.value("multiplier_updates", 4),
          .rule = numerics.contains("spectral_radius") ? generalised_alpha(numerics.at("spectral_radius").get<double>()) : StepRule{}};
}

}  // namespace cutjoint
