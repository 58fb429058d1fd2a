// Reads a run's settings; the compiler's run/settings.py has checked them.
#pragma once

#include "cutjoint/read_json.hpp"
#include "cutjoint/settings.hpp"

namespace cutjoint {

/// The integrators of a program: the mark in their rows, and whether an extension adds one.
struct Abilities {
  bool IntegratorRow::*integrators;
  bool (*added)(const std::string& integrator) = nullptr;
};

inline Integrator read_integrator(const std::string& name, const Abilities& abilities) {
  if (abilities.added != nullptr && abilities.added(name)) return Integrator::added;
  for (std::size_t i = 0; i < integrator_rows.size(); ++i)
    if (integrator_rows[i].*abilities.integrators && integrator_rows[i].name == name) return Integrator(i);
  throw std::runtime_error("run file: this program has no integrator " + name);
}

/// The settings of a run file for a program.
inline RunSettings read_settings(const Json& file, const Abilities& abilities) {
  const Json &numerics = file.at("numerics"), &closure = file.at("stabilisation"), &solver = file.at("solver"), &events = numerics.at("events");
  return {.task = read_word<Task>(file, "task", {{"simulate", Task::simulate}, {"realtime", Task::realtime}, {"equilibrium", Task::equilibrium}}),
          .pose = read_word<Pose>(file, "pose", {{"design", Pose::design}, {"equilibrium", Pose::equilibrium}}),
          .end = read_number<double>(file, "end"),
          .output_step = read_number<double>(file, "output_step"),
          .integrator = read_integrator(file.at("integrator"), abilities),
          .solver = solver.is_null() ? std::nullopt : std::optional(solver.get<std::string>()),
          .dt = read_number<double>(numerics, "dt"),
          .penalty = read_optional(numerics, "penalty"),
          .tolerance = read_number<double>(numerics, "tolerance"),
          .iterations = numerics.at("iterations"),
          .multiplier_updates = numerics.at("multiplier_updates"),
          .fixed_cost = numerics.at("fixed_cost"),
          .events = !events.is_null() && events.get<bool>(),
          .absolute_tolerance = read_optional(numerics, "absolute_tolerance"),
          .spectral_radius = read_optional(numerics, "spectral_radius"),
          .energy = file.value("energy", false),
          .jumps_within = file.contains("jumps_within") ? read_optional(file, "jumps_within") : std::nullopt,
          .stabilisation = {.closure = read_word<Closure>(closure, "closure", {{"penalty", Closure::penalty}, {"proximal", Closure::proximal}, {"solved", Closure::solved}}),
                            .penalty = read_optional(closure, "penalty"),
                            .damping_ratio = read_number<double>(closure, "damping_ratio"),
                            .frequency = read_number<double>(closure, "frequency")}};
}

/// The numbers of steps of a run and per row of its table; cutjoint/model/ranges.py has the same, but not for runs that accuracy.py refines.
struct Steps {
  long number;
  long stride;
};

/// The steps of a run with a row each `output_step`, or each step; in single precision, times of neighbouring steps must be different numbers.
template <class Real>
Steps count_steps(const RunSettings& settings, bool row_each = false) {
  const double dt = settings.dt, every = row_each ? dt : settings.output_step, exact = settings.end / dt;
  if (settings.end == 0.0) return {0, 1};
  if (std::is_same_v<Real, float> && !(exact <= 0x1p24)) throw std::runtime_error("run file: the end is more than 16777216 steps away, too far for single precision");
  const double number = std::max(1.0, std::ceil(exact - 1e-9)), stride = std::clamp(std::floor(every / dt + 0.5), 1.0, number);
  if (!(dt <= settings.end * (1 + 1e-9) && number <= 0x1p53 && number / stride <= 1e8))
    throw std::runtime_error("run file: a step is longer than the run, or the run has too many steps or rows");
  return {static_cast<long>(number), static_cast<long>(stride)};
}

}  // namespace cutjoint
