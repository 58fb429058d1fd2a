// Roads, parameters, inputs and states in a run file.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "cutjoint/json.hpp"
#include "cutjoint/mechanism.hpp"
#include "cutjoint/read_json.hpp"
#include "cutjoint/core/roads/road.hpp"
#include "cutjoint/run_inputs.hpp"
#include "cutjoint/settings.hpp"
#include "cutjoint/state.hpp"

namespace cutjoint {

template <class Real>
std::vector<Piece<Real>> read_pieces(const Json& list) {
  using Kind = std::pair<std::string_view, PieceKind>;
  constexpr std::array kinds{Kind{"line", PieceKind::line}, Kind{"arc", PieceKind::arc}, Kind{"cosine", PieceKind::cosine}};
  std::vector<Piece<Real>> pieces;
  for (const Json& p : list) {
    require_keys(p, std::to_array<std::string_view>({"kind", "start", "a", "b", "c"}));
    pieces.push_back({read_word(p, "kind", kinds), read_number<Real>(p, "start"), read_number<Real>(p, "a"), read_number<Real>(p, "b"),
                      read_number<Real>(p, "c")});
  }
  return pieces;
}

/// The surface of a run file's road, with its heights and patches.
template <class Real>
class SurfaceData {
 public:
  explicit SurfaceData(const Json& data) {
    require_keys(data, std::to_array<std::string_view>({"field", "patches"}));
    if (const Json& field = value_of(data, "field"); !field.is_null()) read_field(field);
    for (const Json& p : list_of(data, "patches")) {
      require_keys(p, std::to_array<std::string_view>({"x", "y", "friction", "edge"}));
      patches_.push_back({read_pair(p, "x"), read_pair(p, "y"), read_number<Real>(p, "friction"), read_number<Real>(p, "edge")});
      if (!(patches_.back().edge > Real(0))) refuse("edge", "of a patch is not above zero");
    }
    surface_.patches = patches_;
  }

  SurfaceData(const SurfaceData&) = delete;
  SurfaceData& operator=(const SurfaceData&) = delete;

  const Surface<Real>& surface() const { return surface_; }

 private:
  static const Json& list_of(const Json& object, const char* key) {
    const Json& list = value_of(object, key);
    if (!list.is_array()) refuse(key, "of a surface is not a list");
    return list;
  }

  static std::vector<Real> read_numbers(const Json& object, const char* key) {
    std::vector<Real> numbers;
    for (const Json& number : list_of(object, key)) numbers.push_back(number_of<Real>(number, key));
    return numbers;
  }

  static std::array<Real, 2> read_pair(const Json& object, const char* key) {
    const std::vector<Real> pair = read_numbers(object, key);
    if (pair.size() != 2) refuse(key, "of a surface has not two numbers");
    return {pair[0], pair[1]};
  }

  void read_field(const Json& data) {
    if (data.contains("sections")) return read_sections(data);
    require_keys(data, std::to_array<std::string_view>({"start", "step", "counts", "wraps", "bilinear", "heights"}));
    HeightField<Real>& field = surface_.field;
    field.start = read_pair(data, "start");
    field.step = read_pair(data, "step");
    const std::array<Real, 2> counts = read_pair(data, "counts");
    heights_ = read_numbers(data, "heights");
    for (std::size_t axis = 0; axis < 2; ++axis) {
      if (!(counts[axis] >= Real(2) && counts[axis] <= Real(1e7))) refuse("counts", "of a surface are not two or more along x and y");
      field.counts[axis] = static_cast<std::ptrdiff_t>(double(counts[axis]));
    }
    if (heights_.size() != static_cast<std::size_t>(field.counts[0] * field.counts[1])) refuse("counts", "of a surface are not those of its heights");
    if (!(field.step[0] > Real(0) && field.step[1] > Real(0))) refuse("step", "of a surface is not above zero");
    field.wraps = read_flag(data, "wraps");
    field.bilinear = read_flag(data, "bilinear");
    field.heights = heights_;
  }

  void read_sections(const Json& data) {
    require_keys(data, std::to_array<std::string_view>({"sections", "across", "heights", "boxes", "step", "borders", "offsets", "smooth", "closed"}));
    const std::vector<Real> numbers = read_numbers(data, "sections");
    for (std::size_t i = 0; i + 9 <= numbers.size(); i += 9) {
      const Real* const n = numbers.data() + i;
      sections_.push_back({n[0], n[1], n[2], n[3], n[4], n[5], n[6], n[7], n[8]});
    }
    across_ = read_numbers(data, "across");
    heights_ = read_numbers(data, "heights");
    boxes_ = read_numbers(data, "boxes");
    CurvedField<Real>& curved = surface_.curved;
    if (sections_.size() < 2 || across_.size() < 2 || 9 * sections_.size() != numbers.size()) refuse("sections", "of a surface are not two or more by two");
    if (heights_.size() != sections_.size() * across_.size()) refuse("heights", "of a surface are not those of its sections");
    if (boxes_.size() != 4 * (2 * std::bit_ceil((sections_.size() + curved.in_leaf - 1) / curved.in_leaf) - 1)) refuse("boxes", "of a surface are not those of its sections");
    curved.line = sections_;
    curved.across = across_;
    curved.heights = heights_;
    curved.boxes = boxes_;
    curved.step = read_number<Real>(data, "step");
    if (!(curved.step > Real(0))) refuse("step", "of a surface is not above zero");
    const std::array<Real, 2> borders = read_pair(data, "borders");
    for (std::size_t axis = 0; axis < 2; ++axis) {
      if (!(borders[axis] >= Real(1) && borders[axis] <= Real(4))) refuse("borders", "of a surface are not 1 to 4");
      curved.borders[axis] = static_cast<Border>(static_cast<int>(double(borders[axis])));
    }
    curved.offsets = read_pair(data, "offsets");
    curved.smooth = read_pair(data, "smooth");
    curved.closed = read_pair(data, "closed");
  }

  std::vector<CrossSection<Real>> sections_;
  std::vector<Real> across_, heights_, boxes_;
  std::vector<FrictionPatch<Real>> patches_;
  Surface<Real> surface_;
};

/// The road of each tyre, with its pieces and the common surface.
template <class Real>
class Roads {
 public:
  Roads() = default;

  Roads(const std::vector<std::string_view>& names, const Json& file) {
    const Json& roads = read_object(file, "roads");
    require_keys(roads, names);
    if (file.contains("surface")) surface_ = std::make_unique<SurfaceData<Real>>(read_object(file, "surface"));
    for (const std::string_view name : names) {
      const Json& road = read_object(roads, std::string(name).c_str());
      require_keys(road, std::to_array<std::string_view>({"left", "right", "disc"}));
      roads_.emplace_back(keep(value_of(road, "left")), keep(value_of(road, "right")), read_flag(road, "disc"),
                          surface_ ? &surface_->surface() : nullptr);
    }
  }

  Roads(Roads&&) = default;
  Roads& operator=(Roads&&) = default;
  Roads(const Roads&) = delete;
  Roads& operator=(const Roads&) = delete;

  const std::vector<Road<Real>>& list() const { return roads_; }

 private:
  Track<Real> keep(const Json& list) {
    const std::vector<Piece<Real>>& pieces = pieces_.emplace_back(read_pieces<Real>(list));
    std::vector<Real>& breaks = breaks_.emplace_back();
    for (std::size_t i = 1; i < pieces.size(); ++i) breaks.push_back(pieces[i].start);
    return {.pieces = pieces, .breaks = breaks};
  }

  std::unique_ptr<SurfaceData<Real>> surface_;
  std::vector<std::vector<Piece<Real>>> pieces_;  ///< their elements keep their addresses when this grows or moves
  std::vector<std::vector<Real>> breaks_;
  std::vector<Road<Real>> roads_;
};

/// The values of parameters.
template <class Real>
std::vector<Real> read_parameters(const std::vector<Named>& parameters, const Json& file) {
  const Json& given = read_object(file, "parameters");
  std::vector<std::string_view> names;
  for (const Named& p : parameters) names.push_back(p.name);
  require_keys(given, names);
  std::vector<Real> values;
  for (const std::string_view name : names) values.push_back(read_number<Real>(given, std::string(name).c_str()));
  return values;
}

/// The data of a run file for a mechanism or system, which keeps pointers to the roads and inputs.
template <class Real>
class ModelData {
 public:
  template <class Described>
  ModelData(const Described& d, const Json& file)
      : roads_(d.roads, file), parameters_(read_parameters<Real>(d.parameters, file)), inputs_(d.inputs, file) {}

  ModelData(const ModelData&) = delete;
  ModelData& operator=(const ModelData&) = delete;

  const std::vector<Road<Real>>& roads() const { return roads_.list(); }

  const std::vector<Real>& parameters() const { return parameters_; }

  InputSource<Real> inputs() { return inputs_.source(); }

  template <class M>
  void drive(M& mechanism) {
    mechanism.drive_by(inputs());
  }

  template <class M>
  void load_mechanism(M& mechanism, const StabilisationSettings& stabilisation, const std::vector<Real>& penalties) {
    drive(mechanism);
    cutjoint::load_mechanism(mechanism, parameters_.data(), roads().data(), stabilisation, penalties);
  }

  template <class S>
  void load_system(S& system) {
    drive(system);
    system.load(parameters_.data(), roads().data());
  }

 private:
  Roads<Real> roads_;
  std::vector<Real> parameters_;
  RunInputs<Real> inputs_;
};

/// Read values by name into an array; returns which were given.
template <class Real>
std::vector<bool> read_given(const Json& by_name, const std::vector<std::string_view>& names, std::vector<Real>& values) {
  require_keys(by_name, names);
  std::vector<bool> given(names.size(), false);
  for (std::size_t i = 0; i < names.size(); ++i) {
    const auto found = by_name.find(std::string(names[i]));
    if (found == by_name.end()) continue;
    values[i] = number_of<Real>(*found, names[i]);
    given[i] = true;
  }
  return given;
}

/// The array under a key.
template <class Real>
std::vector<Real> read_array(const Json& object, const char* key) {
  return object.at(key).get<std::vector<Real>>();
}

/// A state with the keys t, q, v, vdot and lambda.
template <class Real>
State<Real> read_state(const Json& at) {
  State<Real> state(0, 0, 0);
  state.t = read_number<Real>(at, "t");
  state.q = read_array<Real>(at, "q");
  state.v = read_array<Real>(at, "v");
  state.vdot = read_array<Real>(at, "vdot");
  state.lambda = read_array<Real>(at, "lambda");
  return state;
}

/// A state under the keys that read_state reads.
template <class Real>
Json write_state(const State<Real>& state) {
  const State<double> plain(state);
  return Json{{"t", plain.t}, {"q", plain.q}, {"v", plain.v}, {"vdot", plain.vdot}, {"lambda", plain.lambda}};
}

}  // namespace cutjoint
