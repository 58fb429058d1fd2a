// Inputs of a run file: constants and tables over time.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "cutjoint/core/inputs/inputs.hpp"
#include "cutjoint/json.hpp"
#include "cutjoint/mechanism.hpp"
#include "cutjoint/read_json.hpp"

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

}  // namespace cutjoint
