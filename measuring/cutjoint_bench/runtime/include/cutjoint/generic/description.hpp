// The description of a model that is interpreted at run time.
#pragma once

#include <algorithm>

#include "cutjoint/generic/model.hpp"
#include "cutjoint/any_mechanism.hpp"

namespace cutjoint::generic {

inline std::vector<const char*> views_of(const std::vector<std::string>& names) {
  std::vector<const char*> views;
  for (const std::string& name : names) views.push_back(name.c_str());
  return views;
}

inline std::vector<Named> views_of(const std::vector<Names::Item>& items) {
  std::vector<Named> named;
  for (const Names::Item& item : items) named.push_back({item.name.c_str(), item.unit.c_str(), item.value});
  return named;
}

/// The chart of a joint's coordinates: a ball has three speeds and a quaternion, all others a coordinate a speed.
inline Chart chart_of(const Body& body) {
  const bool ball = body.joint.has_ball();
  return {body.q, body.v, ball ? body.speeds - 3 : body.speeds, ball, body.reversed};
}

/// The description; its views stand in the model's names.
template <class Real>
Description describe(const Model<Real>& model) {
  const Names& names = model.names;
  Description d;
  d.name = names.model.c_str();
  std::vector<Chart> charts;
  std::vector<int> cuts;
  for (const Body& body : model.bodies)
    if (body.speeds > 0) charts.push_back(chart_of(body));
  d.charts = charts;
  d.coordinates = views_of(names.coordinates);
  d.speeds = views_of(names.speeds);
  d.equations = views_of(names.equations);
  for (const Gear& gear : model.gears) cuts.push_back(gear.equation);
  for (const Cut& cut : model.cuts) cuts.push_back(cut.first);
  std::sort(cuts.begin(), cuts.end());
  d.cuts = cuts;
  d.parameters = views_of(names.parameters);
  d.inputs = views_of(names.inputs);
  d.roads = views_of(names.roads);
  d.columns = views_of(names.columns);
  return d;
}

}  // namespace cutjoint::generic
