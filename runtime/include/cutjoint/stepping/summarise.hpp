// The statistics of steps, in the summary of a run.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "cutjoint/json.hpp"
#include "cutjoint/mechanism.hpp"

namespace cutjoint::stepping {

/// Put the counts of a stepper into a run's summary; `indicators` are those that it watches.
template <class Counts>
void summarise(const Counts& counts, const std::vector<EventIndicator>& indicators, Json& summary) {
  summary["steps"] = counts.steps;
  summary["rejected"] = counts.rejected;
  summary["events"] = counts.events;
  Json by_element = Json::object();
  for (std::size_t i = 0; i < counts.by_indicator.size(); ++i)
    if (const long n = counts.by_indicator[i]; n > 0) {
      Json& known = by_element[std::string(indicators[i].element)];
      known = known.is_null() ? n : known.template get<long>() + n;
    }
  summary["events_by_element"] = by_element;
}

}  // namespace cutjoint::stepping
