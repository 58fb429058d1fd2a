// Roads of several instances side by side.
#pragma once

#include <utility>
#include <vector>

#include "cutjoint/batch/real.hpp"
#include "cutjoint/core/road.hpp"

namespace cutjoint {

/// One road for each instance: their wheels stand on different pieces.
template <>
class Road<batch::Real> {
 public:
  Road() : roads_(batch::width) {}
  explicit Road(std::vector<Road<double>> roads) : roads_(std::move(roads)) {}

  batch::Real height(batch::Real x, batch::Real y) const {
    return of_each(x, y, [](const Road<double>& road, double x, double y) { return road.height(x, y); });
  }
  batch::Real slope(batch::Real x, batch::Real y) const {
    return of_each(x, y, [](const Road<double>& road, double x, double y) { return road.slope(x, y); });
  }

 private:
  template <class Function>
  batch::Real of_each(batch::Real x, batch::Real y, Function function) const {
    batch::Real result;
    for (int k = 0; k < batch::width; ++k) result.v[k] = function(roads_[static_cast<std::size_t>(k)], x[k], y[k]);
    return result;
  }

  std::vector<Road<double>> roads_;
};

}  // namespace cutjoint
