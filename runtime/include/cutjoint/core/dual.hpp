// Numbers with a derivative: what generated code makes of them are exact derivatives, to rounding.
#pragma once

#include <cmath>

#include "cutjoint/core/road.hpp"

namespace cutjoint {

/// A value and its derivative along a direction, with the arithmetic and functions of generated code.  Comparisons are of values: where formulas
/// change, derivatives are those of the formula that holds, of |x| at 0 those of x.  What does not change along the direction has a derivative of 0,
/// also where a function is infinitely steep.
struct Dual {
  double value = 0.0, slope = 0.0;

  constexpr Dual() = default;
  constexpr Dual(double number) : value(number) {}
  constexpr Dual(double number, double derivative) : value(number), slope(derivative) {}

  Dual& operator+=(Dual b) { return *this = *this + b; }
  Dual& operator-=(Dual b) { return *this = *this - b; }
  Dual& operator*=(Dual b) { return *this = *this * b; }
  Dual& operator/=(Dual b) { return *this = *this / b; }

  friend Dual operator-(Dual a) { return {-a.value, -a.slope}; }
  friend Dual operator+(Dual a, Dual b) { return {a.value + b.value, a.slope + b.slope}; }
  friend Dual operator-(Dual a, Dual b) { return {a.value - b.value, a.slope - b.slope}; }
  friend Dual operator*(Dual a, Dual b) { return {a.value * b.value, a.slope * b.value + a.value * b.slope}; }
  friend Dual operator/(Dual a, Dual b) {
    const double quotient = a.value / b.value;
    return {quotient, (a.slope - quotient * b.slope) / b.value};
  }
  friend bool operator<(Dual a, Dual b) { return a.value < b.value; }
  friend bool operator<=(Dual a, Dual b) { return a.value <= b.value; }
};

/// The derivative of a function with that `steepness` by an argument with that `slope`.
inline double follow(double steepness, double slope) { return slope == 0.0 ? 0.0 : steepness * slope; }

inline Dual sqrt(Dual a) {
  const double root = std::sqrt(a.value);
  return {root, follow(0.5 / root, a.slope)};
}
inline Dual sin(Dual a) { return {std::sin(a.value), follow(std::cos(a.value), a.slope)}; }
inline Dual cos(Dual a) { return {std::cos(a.value), follow(-std::sin(a.value), a.slope)}; }
inline Dual tan(Dual a) {
  const double tangent = std::tan(a.value);
  return {tangent, follow(1.0 + tangent * tangent, a.slope)};
}
inline Dual asin(Dual a) { return {std::asin(a.value), follow(1.0 / std::sqrt(1.0 - a.value * a.value), a.slope)}; }
inline Dual acos(Dual a) { return {std::acos(a.value), follow(-1.0 / std::sqrt(1.0 - a.value * a.value), a.slope)}; }
inline Dual atan(Dual a) { return {std::atan(a.value), follow(1.0 / (1.0 + a.value * a.value), a.slope)}; }
inline Dual sinh(Dual a) { return {std::sinh(a.value), follow(std::cosh(a.value), a.slope)}; }
inline Dual cosh(Dual a) { return {std::cosh(a.value), follow(std::sinh(a.value), a.slope)}; }
inline Dual tanh(Dual a) {
  const double tangent = std::tanh(a.value);
  return {tangent, follow(1.0 - tangent * tangent, a.slope)};
}
inline Dual exp(Dual a) {
  const double power = std::exp(a.value);
  return {power, follow(power, a.slope)};
}
inline Dual log(Dual a) { return {std::log(a.value), follow(1.0 / a.value, a.slope)}; }
inline Dual abs(Dual a) { return {std::abs(a.value), a.value < 0.0 ? -a.slope : a.slope}; }
inline Dual atan2(Dual a, Dual b) {
  const double square = a.value * a.value + b.value * b.value;
  return {std::atan2(a.value, b.value), follow(b.value / square, a.slope) - follow(a.value / square, b.slope)};
}
inline Dual pow(Dual a, Dual b) {
  const double power = std::pow(a.value, b.value);
  return {power, follow(b.value * std::pow(a.value, b.value - 1.0), a.slope) + follow(std::log(a.value) * power, b.slope)};
}

/// A road of plain numbers, which belongs to somebody else.
template <>
class Road<Dual> {
 public:
  Road() = default;
  explicit Road(const Road<double>& road) : road_(&road) {}

  Dual height(Dual x, Dual y) const { return {road_->height(x.value, y.value), follow(road_->height_dx(x.value, y.value), x.slope)}; }
  Dual slope(Dual x, Dual y) const { return {road_->slope(x.value, y.value), follow(road_->slope_dx(x.value, y.value), x.slope)}; }

 private:
  const Road<double>* road_ = nullptr;
};

}  // namespace cutjoint
