// Roads with derivatives with respect to the wheel's position.
#pragma once

#include "cutjoint/core/numbers/dual.hpp"
#include "cutjoint/core/roads/road.hpp"

namespace cutjoint {

/// A road of plain numbers, owned by another object.
template <>
class Road<Dual> {
 public:
  Road() = default;
  explicit Road(const Road<double>& road) : road_(&road) {}

  Dual height(const Dual& x, const Dual& y) const { return follow(road_->height(x.value, y.value), road_->height_dx(x.value, y.value), x); }
  Dual slope(const Dual& x, const Dual& y) const { return follow(road_->slope(x.value, y.value), road_->slope_dx(x.value, y.value), x); }
  Dual surface(const Dual& x, const Dual& y, int by_x, int by_y) const { return of_both<&Road<double>::surface>(x, y, by_x, by_y); }
  Dual friction(const Dual& x, const Dual& y, int by_x, int by_y) const { return of_both<&Road<double>::friction>(x, y, by_x, by_y); }

 private:
  template <auto answer>
  Dual of_both(const Dual& x, const Dual& y, int by_x, int by_y) const {
    const auto value = [&](int i, int j) { return (road_->*answer)(x.value, y.value, by_x + i, by_y + j); };
    return follow(value(0, 0), value(1, 0), x) + follow(0.0, value(0, 1), y);
  }

  const Road<double>* road_ = nullptr;
};

}  // namespace cutjoint
