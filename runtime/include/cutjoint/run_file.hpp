// Roads, parameters, inputs and states in a run file.
#pragma once

#include <memory>

#include "cutjoint/core/constraints/stabilisation.hpp"
#include "cutjoint/read_json.hpp"
#include "cutjoint/state.hpp"

namespace cutjoint {

/// An input over time: a constant, or samples with linear or cubic interpolation.
template <class Real>
struct Trajectory {
  int input;
  std::vector<Real> t, value;
  std::vector<Real> rate;  ///< empty for linear interpolation

  void write(Real now, Real* numbers) const {
    if (t.empty()) {
      numbers[0] = value.front();
      numbers[1] = numbers[2] = Real(0);
      return;
    }
    const auto after = std::upper_bound(t.begin() + 1, t.end() - 1, now) - t.begin();
    const auto j = static_cast<std::size_t>(after), i = j - 1;
    const Real length = t[j] - t[i], slope = (value[j] - value[i]) / length;
    interpolate(now - t[i], length, value[i], rate.empty() ? slope : rate[i], value[j], rate.empty() ? slope : rate[j], numbers);
  }
};

/// The inputs of a run file, a source of a mechanism or system: under "inputs" by name a number, or samples "t" and "value", with their "rate"
/// for cubic interpolation.  Other inputs follow the scene.
template <class Real>
class RunInputs {
 public:
  RunInputs() = default;

  RunInputs(const List<Named>& inputs, const Json& file) {
    if (!file.contains("inputs")) return;
    for (std::size_t i = 0; i < inputs.size(); ++i) {
      const auto given = file.at("inputs").find(std::string(inputs[i].name));
      if (given == file.at("inputs").end()) continue;
      Trajectory<Real>& trajectory = trajectories_.emplace_back(Trajectory<Real>{static_cast<int>(i), {}, {}, {}});
      if (!given->is_object()) {
        trajectory.value = {Real(given->template get<double>())};
        continue;
      }
      trajectory.t = read_numbers<Real>(*given, "t"), trajectory.value = read_numbers<Real>(*given, "value");
      if (given->contains("rate")) trajectory.rate = read_numbers<Real>(*given, "rate");
      if (std::adjacent_find(trajectory.t.begin(), trajectory.t.end(), std::greater_equal<>()) != trajectory.t.end())
        throw std::runtime_error(std::string("run file: times of ") + inputs[i].name + " are one number in this precision");
    }
  }

  /// The source; this object must outlive its use.
  InputSource<Real> source() { return trajectories_.empty() ? InputSource<Real>{} : InputSource<Real>{&fill, this}; }

 private:
  static void fill(void* host, Real t, Real* input) {
    for (const Trajectory<Real>& trajectory : static_cast<const RunInputs*>(host)->trajectories_) trajectory.write(t, input + numbers_per_input * trajectory.input);
  }

  std::vector<Trajectory<Real>> trajectories_;
};

/// The surface of a run file's road, with its heights and patches.
template <class Real>
class SurfaceData {
 public:
  explicit SurfaceData(const Json& data) {
    if (const Json& field = data.at("field"); !field.is_null()) read_field(field);
    for (const Json& p : data.at("patches"))
      patches_.push_back({read_pair(p, "x"), read_pair(p, "y"), read_number<Real>(p, "friction"), read_number<Real>(p, "edge")});
    surface_.patches = patches_;
  }

  SurfaceData(const SurfaceData&) = delete;
  SurfaceData& operator=(const SurfaceData&) = delete;

  const Surface<Real>& surface() const { return surface_; }

 private:
  static std::array<Real, 2> read_pair(const Json& object, const char* key) {
    const std::vector<Real> pair = read_numbers<Real>(object, key);
    return {pair.at(0), pair.at(1)};
  }

  void read_field(const Json& data) {
    if (data.contains("sections")) return read_sections(data);
    HeightField<Real>& field = surface_.field;
    field.start = read_pair(data, "start");
    field.step = read_pair(data, "step");
    for (std::size_t axis = 0; axis < 2; ++axis) field.counts[axis] = data.at("counts").at(axis).get<std::ptrdiff_t>();
    heights_ = read_numbers<Real>(data, "heights");
    field.wraps = data.at("wraps");
    field.bilinear = data.at("bilinear");
    field.heights = heights_;
  }

  void read_sections(const Json& data) {
    const std::vector<Real> numbers = read_numbers<Real>(data, "sections");
    for (std::size_t i = 0; i + 9 <= numbers.size(); i += 9) {
      const Real* const n = numbers.data() + i;
      sections_.push_back({n[0], n[1], n[2], n[3], n[4], n[5], n[6], n[7], n[8]});
    }
    across_ = read_numbers<Real>(data, "across");
    heights_ = read_numbers<Real>(data, "heights");
    boxes_ = read_numbers<Real>(data, "boxes");
    CurvedField<Real>& curved = surface_.curved;
    curved.line = sections_;
    curved.across = across_;
    curved.heights = heights_;
    curved.boxes = boxes_;
    curved.step = read_number<Real>(data, "step");
    for (std::size_t axis = 0; axis < 2; ++axis) curved.borders[axis] = static_cast<Border>(data.at("borders").at(axis).get<int>());
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

  Roads(const List<const char*>& names, const Json& file) {
    if (file.contains("surface")) surface_ = std::make_unique<SurfaceData<Real>>(file.at("surface"));
    for (const std::string_view name : names) {
      const Json& road = file.at("roads").at(std::string(name));
      roads_.emplace_back(keep(road.at("left")), keep(road.at("right")), road.at("disc").get<bool>(), surface_ ? &surface_->surface() : nullptr);
    }
  }

  Roads(Roads&&) = default;
  Roads& operator=(Roads&&) = default;
  Roads(const Roads&) = delete;
  Roads& operator=(const Roads&) = delete;

  const std::vector<Road<Real>>& list() const { return roads_; }

 private:
  Track<Real> keep(const Json& list) {
    std::vector<Piece<Real>>& pieces = pieces_.emplace_back();
    std::vector<Real>& breaks = breaks_.emplace_back();
    for (const Json& p : list)
      pieces.push_back({read_word<PieceKind>(p, "kind", {{"line", PieceKind::line}, {"arc", PieceKind::arc}, {"cosine", PieceKind::cosine}}),
                        read_number<Real>(p, "start"), read_number<Real>(p, "a"), read_number<Real>(p, "b"), read_number<Real>(p, "c")});
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
std::vector<Real> read_parameters(const List<Named>& parameters, const Json& file) {
  std::vector<Real> values;
  for (const Named& p : parameters) values.push_back(Real(file.at("parameters").at(std::string(p.name)).get<double>()));
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

  void drive(auto& mechanism) { mechanism.drive_by(inputs()); }

  void load_mechanism(auto& mechanism, const StabilisationSettings& stabilisation, const std::vector<Real>& penalties) {
    drive(mechanism);
    cutjoint::load_mechanism(mechanism, parameters_.data(), roads().data(), stabilisation, penalties);
  }

 private:
  Roads<Real> roads_;
  std::vector<Real> parameters_;
  RunInputs<Real> inputs_;
};

/// Read values by name into an array; returns which were given.
template <class Real>
std::vector<bool> read_given(const Json& by_name, const List<const char*>& names, std::vector<Real>& values) {
  std::vector<bool> given(names.size(), false);
  for (std::size_t i = 0; i < names.size(); ++i) {
    const auto found = by_name.find(std::string(names[i]));
    if (found == by_name.end()) continue;
    values[i] = Real(found->template get<double>());
    given[i] = true;
  }
  return given;
}

}  // namespace cutjoint
