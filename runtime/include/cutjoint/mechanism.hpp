// Descriptions of mechanisms.
#pragma once

#include <string_view>
#include <vector>

#include "cutjoint/any_mechanism.hpp"
#include "cutjoint/constants.hpp"

namespace cutjoint {

/// Everything about a mechanism that does not change in a run.
struct Description {
  std::string_view name;
  std::vector<Chart> charts;
  std::vector<std::string_view> coordinates;  ///< names of q
  std::vector<std::string_view> speeds;       ///< names of v, first-order states last
  std::vector<std::string_view> equations;    ///< names of the cut joints' equations
  std::vector<Named> parameters;              ///< tunable parameters with defaults, SI units
  std::vector<std::string_view> roads;        ///< tyres, each with a road of its own
  std::vector<Named> columns;                 ///< reported quantities
  std::vector<int> cuts{};                    ///< first equation of each cut joint
  std::vector<Named> inputs{};                ///< inputs with the model's values, SI units
  std::vector<Guard> guards{};                ///< forces that must not act
  std::vector<Domain> domains{};              ///< where laws may have no value
  std::vector<EventIndicator> indicators{};             ///< where formulas change
  std::size_t states = 0;                     ///< number of the first-order states
  std::vector<Controller> controllers{};      ///< what holds values between samples
  std::vector<double> nominals{};             ///< usual sizes of the first-order states, after those of accelerations where `arm` is not 1, none where all are 1
  double arm = 1.0;                           ///< a length (m) near the mechanism's, 1 for ordinary ones
  bool driven = false;                        ///< whether guides have power, which takes accelerations and multipliers
  bool guides_jump = false;                   ///< whether the rates of guides may jump

  /// How many values controllers hold.
  std::size_t discrete() const {
    std::size_t number = 0;
    for (const Controller& controller : controllers) number += static_cast<std::size_t>(controller.times.discrete);
    return number;
  }
};

}  // namespace cutjoint
