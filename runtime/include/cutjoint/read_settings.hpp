// Reads a run's settings; values out of range and unknown keys and words are rejected by name.
#pragma once

#include "cutjoint/read_json.hpp"
#include "cutjoint/settings.hpp"

namespace cutjoint {

namespace words {

template <class Value>
using Meaning = std::pair<std::string_view, Value>;

inline constexpr std::array tasks{
    Meaning<Task>{"simulate", Task::simulate}, Meaning<Task>{"realtime", Task::realtime}, Meaning<Task>{"equilibrium", Task::equilibrium},
    Meaning<Task>{"batch", Task::batch},
};
inline constexpr std::array poses{Meaning<Pose>{"design", Pose::design}, Meaning<Pose>{"equilibrium", Pose::equilibrium}};
inline constexpr std::array closures{Meaning<Closure>{"penalty", Closure::penalty}, Meaning<Closure>{"proximal", Closure::proximal},
                                    Meaning<Closure>{"solved", Closure::solved}};

}  // namespace words

/// The abilities of a program: its tasks, the mark of its integrators in their rows, whether it has linear solvers, and whether an extension adds an integrator.
struct Abilities {
  std::vector<Task> tasks;
  bool IntegratorRow::*integrators;
  bool solvers = false;
  bool (*added)(const std::string& integrator) = nullptr;
};

/// Reads settings with the ranges of a number type.
template <class Real>
class SettingsReader {
 public:
  SettingsReader(const Json& file, const Abilities& abilities) : file_(file), abilities_(abilities) {}

  /// Throws runtime_error for missing, unknown, out-of-range or inconsistent settings.
  RunSettings read() const {
    if (!file_.is_object()) throw std::runtime_error("the run file is not an object of JSON");
    require_keys(file_, keys_);
    const Json& numerics = read_object(file_, "numerics");
    require_keys(numerics, numerics_keys_);
    const RunSettings settings{
        .task = able("task", words::tasks, abilities_.tasks),
        .pose = read_word(file_, "pose", words::poses),
        .end = between(file_, "end", 0.0, largest_read<Real>),
        .output_step = positive(file_, "output_step"),
        .integrator = integrator(),
        .solver = solver(),
        .dt = dt(numerics),
        .penalty = if_given(numerics, "penalty", [&](const char* key) { return positive(numerics, key); }),
        .tolerance = positive(numerics, "tolerance"),
        .iterations = read_integer(numerics, "iterations", 1),
        .multiplier_updates = read_integer(numerics, "multiplier_updates", 0),
        .fixed_cost = read_flag(numerics, "fixed_cost"),
        .events = if_given(numerics, "events", [&](const char* key) { return read_flag(numerics, key); }).value_or(false),
        .absolute_tolerance = if_given(numerics, "absolute_tolerance", [&](const char* key) { return positive(numerics, key); }),
        .spectral_radius = if_given(numerics, "spectral_radius", [&](const char* key) { return between(numerics, key, 0.0, 1.0); }),
        .energy = file_.contains("energy") && read_flag(file_, "energy"),
        .jumps_within = file_.contains("jumps_within") ? std::optional(positive(file_, "jumps_within")) : std::nullopt,
        .stabilisation = stabilisation(),
    };
    require_agreement(settings);
    return settings;
  }

 private:
  Integrator integrator() const {
    const Json& word = value_of(file_, "integrator");
    const bool is_added = abilities_.added != nullptr && word.is_string() && abilities_.added(word.get<std::string>());
    if (is_added) return Integrator::added;
    std::vector<std::string_view> names;
    for (std::size_t i = 0; i < integrator_rows.size(); ++i) {
      if (!(integrator_rows[i].*abilities_.integrators)) continue;
      if (word == integrator_rows[i].name) return Integrator(i);
      names.push_back(integrator_rows[i].name);
    }
    refuse("integrator", "is " + word.dump() + " and not one of " + listed(names));
  }

  StabilisationSettings stabilisation() const {
    const Json& part = read_object(file_, "stabilisation");
    require_keys(part, stabilisation_keys_);
    return {.closure = read_word(part, "closure", words::closures),
            .penalty = if_given(part, "penalty", [&](const char* key) { return positive(part, key); }),
            .damping_ratio = between(part, "damping_ratio", 0.0, largest_read<Real>),
            .frequency = between(part, "frequency", 0.0, largest_read<Real>)};
  }

  std::optional<std::string> solver() const {
    const Json& value = value_of(file_, "solver");
    if (value.is_null()) return std::nullopt;
    if (!value.is_string()) refuse("solver", "is " + value.dump() + " and not a name");
    if (!abilities_.solvers) throw std::runtime_error("the recursive method has no linear solver to choose; write null for 'solver'");
    return value.get<std::string>();
  }

  /// Check that settings are consistent.
  void require_agreement(const RunSettings& s) const {
    const IntegratorRow& row = integrator_rows[static_cast<std::size_t>(s.integrator)];
    if (row.absolute_tolerance && !s.absolute_tolerance) refuse_null("absolute_tolerance");
    if (row.spectral_radius && !s.spectral_radius) refuse_null("spectral_radius");
    if (abilities_.solvers && s.integrator != Integrator::added && !s.solver) refuse_null("solver");
    if (is_projected(s.stabilisation.closure) && !row.projected)
      refuse("closure", "is " + file_.at("stabilisation").at("closure").dump() + ", which this integrator does not take; write \"penalty\"");
  }

  [[noreturn]] void refuse_null(std::string_view key) const { refuse(key, "is null, but a run with these settings needs it"); }

  /// A keyword that this program supports.
  template <class Value, std::size_t n>
  Value able(const char* key, const std::array<words::Meaning<Value>, n>& meanings, const std::vector<Value>& able) const {
    const Json& word = value_of(file_, key);
    std::vector<std::string_view> names;
    for (const auto& [name, value] : meanings) {
      if (std::find(able.begin(), able.end(), value) == able.end()) continue;
      if (word.is_string() && word.template get_ref<const std::string&>() == name) return value;
      names.push_back(name);
    }
    refuse(key, "is " + word.dump() + " and not one of " + listed(names));
  }

  /// A number above zero.
  static double positive(const Json& object, const char* key) {
    if (!(read_number<Real>(object, key) > Real(0))) refuse(key, "is " + object.at(key).dump() + " and not above zero");
    return read_number<double>(object, key);
  }

  /// A number from `least` to `most`.
  static double between(const Json& object, const char* key, double least, double most) {
    const Real number = read_number<Real>(object, key);
    if (!(number >= Real(least) && number <= Real(most)))
      refuse(key, "is " + object.at(key).dump() + " and not from " + Json(least).dump() + " to " + Json(most).dump());
    return read_number<double>(object, key);
  }

  /// The step length; its square must be representable.
  static double dt(const Json& numerics) {
    const Real dt(positive(numerics, "dt"));
    const double quarter = static_cast<double>(dt * dt / Real(4)), rest = static_cast<double>(Real(1) / (dt * dt));
    if (!(quarter > 0.0 && std::isfinite(quarter) && rest > 0.0 && std::isfinite(rest)))
      refuse("dt", "is " + numerics.at("dt").dump() + ", whose square has no value in the number type of the run");
    return read_number<double>(numerics, "dt");
  }

  /// The value that `read` finds under a key, unless it is null.
  static auto if_given(const Json& object, const char* key, auto read) -> std::optional<decltype(read(key))> {
    if (value_of(object, key).is_null()) return std::nullopt;
    return read(key);
  }

  /// The keys of a run file; those that are no settings are read where they are used.
  static constexpr auto keys_ = std::to_array<std::string_view>(
      {"task", "pose", "end", "output_step", "integrator", "solver", "numerics", "stabilisation", "model", "parameters", "inputs", "positions",
       "near", "rates", "roads", "surface", "out", "out_rows", "steps_out", "steps_out_rows", "tangents_out", "coordinates_out", "coordinates_out_rows", "with_state", "energy",
       "jumps_within", "initial_state", "cases", "threads", "ends_with_stdin"});
  static constexpr auto numerics_keys_ = std::to_array<std::string_view>(
      {"dt", "penalty", "tolerance", "iterations", "multiplier_updates", "fixed_cost", "events", "absolute_tolerance", "spectral_radius"});
  static constexpr auto stabilisation_keys_ = std::to_array<std::string_view>({"closure", "penalty", "damping_ratio", "frequency"});

  const Json& file_;
  const Abilities& abilities_;
};

/// The settings of a run file for a program.  Throws runtime_error that names the error and the allowed values.
template <class Real>
RunSettings read_settings(const Json& file, const Abilities& abilities) { return SettingsReader<Real>(file, abilities).read(); }

/// The numbers of steps of a run and per row of its table; cutjoint/model/ranges.py has the same.
struct Steps {
  long number;
  long stride;
};

/// The largest number of rows of a table.
constexpr double most_rows = 1e8;

/// The steps of a run with a row each `output_step`, or each step; with more, times of neighbouring steps are one number.
template <class Real>
Steps count_steps(const RunSettings& settings, bool row_each = false) {
  const double dt = settings.dt, end = settings.end, every = row_each ? dt : settings.output_step;
  if (end == 0.0) return {0, 1};
  const std::string end_text = Json(end).dump();
  if (!(dt <= end * (1 + 1e-9))) refuse("dt", "is longer than the run, which has the end " + end_text);
  const double exact = end / dt, most = std::is_same_v<Real, float> ? 0x1p24 : 0x1p53;
  if (!(exact <= most)) refuse("end", "is " + end_text + " and more than " + Json(most).dump() + " steps away");
  const double number = std::max(1.0, std::ceil(exact - 1e-9)), stride = std::clamp(std::floor(every / dt + 0.5), 1.0, number);
  if (!(number / stride <= most_rows)) refuse("end", "is " + end_text + " and more than " + Json(most_rows).dump() + " rows away");
  return {static_cast<long>(number), static_cast<long>(stride)};
}

/// The total length of a run's steps, s.
template <class Real>
double length_of(const RunSettings& settings) { return static_cast<double>(count_steps<Real>(settings).number) * settings.dt; }

}  // namespace cutjoint
