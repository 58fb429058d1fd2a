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
  return {read_positive<double>(numerics, "tolerance"), read_integer(numerics, "iterations", 1), read_integer(numerics, "multiplier_updates", 0),
          is_proximal(file.at("stabilisation")), numerics.value("fixed_cost", false)};
}

/// Those of Newton's iteration; tasks without steps can do without those of steps.
inline NewtonFigures read_newton_figures(const Json& numerics) {
  const auto has = [&](const char* key) { return numerics.contains(key); };
  return {.dt = has("dt") ? read_dt<double>(numerics) : 0.0,
          .penalty = numerics.at("penalty").is_null() ? 0.0 : read_positive<double>(numerics, "penalty"),
          .tolerance = has("tolerance") ? read_positive<double>(numerics, "tolerance") : 1e-6,
          .iterations = has("iterations") ? read_integer(numerics, "iterations", 1) : 100,
          .multiplier_updates = has("multiplier_updates") ? read_integer(numerics, "multiplier_updates", 0) : 4,
          .rule = has("spectral_radius") ? generalised_alpha(read_between<double>(numerics, "spectral_radius", 0.0, 1.0)) : StepRule{}};
}

}  // namespace cutjoint
