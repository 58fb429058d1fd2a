// Roads of several instances in SIMD lanes.
#pragma once

#include <array>
#include <cstddef>

#include "cutjoint/core/numbers/lanes.hpp"
#include "cutjoint/core/roads/road.hpp"

namespace cutjoint {

/// One road for each instance, since their wheels are on different pieces.
template <int N>
class Road<Lanes<double, N>> {
 public:
  using Real = Lanes<double, N>;

  /// The road of instance k.
  void put(int k, const Road<double>& road) { roads_[static_cast<std::size_t>(k)] = road; }

  Real height(Real x, Real y) const {
    return of_each(x, y, [](const Road<double>& road, double x, double y) { return road.height(x, y); });
  }
  Real slope(Real x, Real y) const {
    return of_each(x, y, [](const Road<double>& road, double x, double y) { return road.slope(x, y); });
  }
  Real surface(Real x, Real y, int by_x, int by_y) const {
    return of_each(x, y, [=](const Road<double>& road, double x, double y) { return road.surface(x, y, by_x, by_y); });
  }
  Real friction(Real x, Real y, int by_x, int by_y) const {
    return of_each(x, y, [=](const Road<double>& road, double x, double y) { return road.friction(x, y, by_x, by_y); });
  }

 private:
  template <class Function>
  Real of_each(Real x, Real y, Function function) const {
    Real result;
    for (int k = 0; k < N; ++k) result.v[k] = function(roads_[static_cast<std::size_t>(k)], x[k], y[k]);
    return result;
  }

  std::array<Road<double>, N> roads_;
};

}  // namespace cutjoint
