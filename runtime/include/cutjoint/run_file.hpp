// What a run file says of roads, parameters and states.
#pragma once

#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "cutjoint/json.hpp"
#include "cutjoint/mechanism.hpp"
#include "cutjoint/read_settings.hpp"
#include "cutjoint/road.hpp"

namespace cutjoint {

template <class Real>
std::vector<Piece<Real>> read_pieces(const Json& list) {
  std::vector<Piece<Real>> pieces;
  for (const Json& p : list) {
    const std::string kind = read_word(p, "kind", std::to_array<std::string_view>({"line", "arc", "cosine"}), "");
    pieces.push_back({kind == "arc" ? PieceKind::arc : kind == "cosine" ? PieceKind::cosine : PieceKind::line,
                      read_number<Real>(p, "begin"), read_number<Real>(p, "a"), read_number<Real>(p, "b"), read_number<Real>(p, "c")});
  }
  return pieces;
}

/// The road of each tyre.
template <class Real>
std::vector<Road<Real>> read_roads(const std::vector<std::string_view>& names, const Json& file) {
  std::vector<Road<Real>> roads;
  for (const std::string_view name : names) {
    const Json& road = file.at("roads").at(std::string(name));
    roads.emplace_back(read_pieces<Real>(road.at("left")), read_pieces<Real>(road.at("right")), road.at("disc").get<bool>());
  }
  return roads;
}

/// The values of parameters.
template <class Real>
std::vector<Real> read_parameters(const std::vector<Named>& parameters, const Json& file) {
  std::vector<Real> values;
  for (const Named& p : parameters) values.push_back(read_number<Real>(file.at("parameters"), std::string(p.name).c_str()));
  return values;
}

/// The switches at which steps end: the model's, or none in a run that takes its steps over events.
template <class Described>
const std::vector<Switch>& read_switches(const Described& d, const Json& file) {
  static const std::vector<Switch> none;
  return file.at("numerics").value("events", true) ? d.switches : none;
}

/// Whether the cut joints' figures are those of the proximal closure.
inline bool is_proximal(const Json& figures) {
  return read_word(figures, "closure", std::to_array<std::string_view>({"penalty", "proximal"}), "penalty") == "proximal";
}

/// What a run file gives a mechanism or system before it runs.  Both keep a pointer to the roads.
template <class Real>
class Inputs {
 public:
  template <class Described>
  Inputs(const Described& d, const Json& file)
      : roads_(read_roads<Real>(d.roads, file)), parameters_(read_parameters<Real>(d.parameters, file)) {}

  Inputs(const Inputs&) = delete;
  Inputs& operator=(const Inputs&) = delete;

  const std::vector<Road<Real>>& roads() const { return roads_; }

  /// The figures of the cut joints; of the proximal closure `penalties`.
  template <class M>
  void load_mechanism(M& mechanism, const Json& figures, const std::vector<Real>& penalties) const {
    if (is_proximal(figures)) {
      mechanism.load(parameters_.data(), {.penalties = penalties.data()}, roads_.data());
      return;
    }
    mechanism.load(parameters_.data(),
                   {.penalty = read_positive<Real>(figures, "penalty"),
                    .damping_ratio = read_between<Real>(figures, "damping_ratio", 0.0, largest_read<Real>),
                    .frequency = read_between<Real>(figures, "frequency", 0.0, largest_read<Real>)},
                   roads_.data());
  }

  template <class S>
  void load_system(S& system) const {
    system.load(parameters_.data(), roads_.data());
  }

 private:
  std::vector<Road<Real>> roads_;
  std::vector<Real> parameters_;
};

/// Values by name into an array; true where one was given.
template <class Real>
std::vector<bool> read_given(const Json& by_name, const std::vector<std::string_view>& names, std::vector<Real>& values) {
  std::vector<bool> given(names.size(), false);
  for (std::size_t i = 0; i < names.size(); ++i) {
    const auto found = by_name.find(std::string(names[i]));
    if (found == by_name.end()) continue;
    values[i] = number_of<Real>(*found, names[i]);
    given[i] = true;
  }
  return given;
}

}  // namespace cutjoint
