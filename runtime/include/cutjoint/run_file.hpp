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

/// Rates at samples: of the parabola through each and its neighbours, at the ends of the adjacent parabola.
template <class Real>
std::vector<Real> rates_at(const std::vector<Real>& t, const std::vector<Real>& value) {
  const std::size_t last = t.size() - 1;
  const auto slope = [&](std::size_t i) { return (value[i + 1] - value[i]) / (t[i + 1] - t[i]); };
  if (last == 1) return {slope(0), slope(0)};
  std::vector<Real> rates(t.size());
  for (std::size_t i = 1; i < last; ++i) {
    const Real before = t[i] - t[i - 1], after = t[i + 1] - t[i];
    rates[i] = (after * slope(i - 1) + before * slope(i)) / (before + after);
  }
  rates[0] = 2 * slope(0) - rates[1];
  rates[last] = 2 * slope(last - 1) - rates[last - 1];
  return rates;
}

/// The inputs of a run file, a source of a mechanism or system: under "inputs" by name a number, or samples "t" and "value" with
/// "interpolation" "cubic" (the default) or "linear", a cubic one with "rate" if its rates are known.  Other inputs follow the scene.
template <class Real>
class RunInputs {
 public:
  RunInputs() = default;

  RunInputs(const std::vector<Named>& inputs, const Json& file) {
    if (!file.contains("inputs")) return;
    const double end = file.value("end", 0.0);
    for (const auto& [name, given] : read_object(file, "inputs").items()) trajectories_.push_back(read(number_of_input(inputs, name), name, given, end));
  }

  /// The source; this object must outlive its use.
  InputSource<Real> source() { return trajectories_.empty() ? InputSource<Real>{} : InputSource<Real>{&fill, this}; }

 private:
  static int number_of_input(const std::vector<Named>& inputs, const std::string& name) {
    const auto found = std::find_if(inputs.begin(), inputs.end(), [&](const Named& input) { return input.name == name; });
    if (found == inputs.end()) refuse(name, "is no input of the model");
    return static_cast<int>(found - inputs.begin());
  }

  static Trajectory<Real> read(int input, const std::string& name, const Json& given, double end) {
    if (!given.is_object()) return {input, {}, {number_of<Real>(given, name)}, {}};
    require_keys(given, std::to_array<std::string_view>({"t", "value", "rate", "interpolation"}));
    using Kind = std::pair<std::string_view, bool>;
    constexpr std::array kinds{Kind{"cubic", true}, Kind{"linear", false}};
    const bool cubic = !given.contains("interpolation") || read_word(given, "interpolation", kinds);
    Trajectory<Real> trajectory{input, read_samples(given, "t"), read_samples(given, "value"), {}};
    require_times(name, trajectory, end);
    if (given.contains("rate")) {
      if (!cubic) refuse(name, "has rates, which a linear interpolation does not read");
      trajectory.rate = read_samples(given, "rate");
      if (trajectory.rate.size() != trajectory.t.size()) refuse(name, "has not as many rates as times");
    } else if (cubic) {
      trajectory.rate = rates_at(trajectory.t, trajectory.value);
    }
    return trajectory;
  }

  static std::vector<Real> read_samples(const Json& given, const char* key) {
    const Json& list = value_of(given, key);
    if (!list.is_array()) refuse(key, "is " + list.dump() + " and not a list");
    std::vector<Real> samples;
    for (const Json& sample : list) samples.push_back(number_of<Real>(sample, key));
    return samples;
  }

  static void require_times(const std::string& name, const Trajectory<Real>& trajectory, double end) {
    if (trajectory.t.size() < 2 || trajectory.value.size() != trajectory.t.size()) refuse(name, "needs two times or more and as many values");
    if (std::adjacent_find(trajectory.t.begin(), trajectory.t.end(), [](Real a, Real b) { return !(a < b); }) != trajectory.t.end())
      refuse(name, "has times that do not ascend");
    if (trajectory.t.front() > Real(0) || trajectory.t.back() < Real(end)) refuse(name, "has times that do not reach from 0 to the end of the run");
  }

  static void fill(void* host, Real t, Real* input) {
    for (const Trajectory<Real>& trajectory : static_cast<const RunInputs*>(host)->trajectories_) trajectory.write(t, input + numbers_per_input * trajectory.input);
  }

  std::vector<Trajectory<Real>> trajectories_;
};

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

  void drive(auto& mechanism) { mechanism.drive_by(inputs()); }

  void load_mechanism(auto& mechanism, const StabilisationSettings& stabilisation, const std::vector<Real>& penalties) {
    drive(mechanism);
    cutjoint::load_mechanism(mechanism, parameters_.data(), roads().data(), stabilisation, penalties);
  }

  void load_system(auto& system) {
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

}  // namespace cutjoint
