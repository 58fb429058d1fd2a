// Numbers with derivatives: what generated code makes of them are exact derivatives, to rounding.
#pragma once

#include <cmath>
#include <cstddef>

namespace cutjoint {

/// Derivatives along several directions side by side; a struct that has them needs no other alignment than that of doubles.
typedef double Slopes __attribute__((vector_size(8 * sizeof(double)), aligned(alignof(double))));
inline constexpr std::size_t directions = sizeof(Slopes) / sizeof(double);

// As calls, products and quotients take a third less time of a compiler and a tenth more of a processor.
#ifdef CUTJOINT_SMALL_DERIVATIVES
#define CUTJOINT_PRODUCT gnu::noinline
#else
#define CUTJOINT_PRODUCT gnu::always_inline
#endif

/// A value and its derivatives along directions, with the arithmetic and functions of generated code.  Comparisons are of values: where formulas
/// change, derivatives are those of the formula that holds, of |x| at 0 those of x.  What does not change along a direction has a derivative of 0,
/// also where a function is infinitely steep.
struct Dual {
  double value = 0.0;
  Slopes slope{};

  constexpr Dual() = default;
  constexpr Dual(double number) : value(number) {}
  constexpr Dual(double number, const Slopes& derivatives) : value(number), slope(derivatives) {}
  /// The derivatives of another: clang takes a vector that is passed by itself for an aligned one.
  constexpr Dual(double number, const Dual& other) : value(number), slope(other.slope) {}

  [[gnu::always_inline]] Dual& operator+=(const Dual& b) { return *this = *this + b; }
  [[gnu::always_inline]] Dual& operator-=(const Dual& b) { return *this = *this - b; }
  [[gnu::always_inline]] Dual& operator*=(const Dual& b) { return *this = *this * b; }
  [[gnu::always_inline]] Dual& operator/=(const Dual& b) { return *this = *this / b; }

  [[gnu::always_inline]] friend Dual operator-(const Dual& a) { return {-a.value, -a.slope}; }
  [[gnu::always_inline]] friend Dual operator+(const Dual& a, const Dual& b) { return {a.value + b.value, a.slope + b.slope}; }
  [[gnu::always_inline]] friend Dual operator-(const Dual& a, const Dual& b) { return {a.value - b.value, a.slope - b.slope}; }
  [[CUTJOINT_PRODUCT]] friend Dual operator*(const Dual& a, const Dual& b) { return {a.value * b.value, a.slope * b.value + a.value * b.slope}; }
  [[CUTJOINT_PRODUCT]] friend Dual operator/(const Dual& a, const Dual& b) {
    const double quotient = a.value / b.value;
    return {quotient, (a.slope - quotient * b.slope) / b.value};
  }
  friend bool operator<(const Dual& a, const Dual& b) { return a.value < b.value; }
  friend bool operator<=(const Dual& a, const Dual& b) { return a.value <= b.value; }
  friend bool operator>(const Dual& a, const Dual& b) { return a.value > b.value; }
  friend bool operator>=(const Dual& a, const Dual& b) { return a.value >= b.value; }
};

#undef CUTJOINT_PRODUCT

/// Derivatives without their value, which linear maps of numbers take to others.
struct Along {
  Slopes slope{};

  [[gnu::always_inline]] Along& operator+=(const Along& b) { return slope += b.slope, *this; }
  [[gnu::always_inline]] Along& operator-=(const Along& b) { return slope -= b.slope, *this; }
  [[gnu::always_inline]] Along& operator*=(double b) { return slope *= b, *this; }
  [[gnu::always_inline]] Along& operator/=(double b) { return slope /= b, *this; }

  [[gnu::always_inline]] friend Along operator*(const Along& a, double b) { return {a.slope * b}; }
  [[gnu::always_inline]] friend Along operator*(double a, const Along& b) { return {a * b.slope}; }
};

/// A function's value, and its derivatives by an argument, of which it has that `steepness`.
inline Dual follow(double value, double steepness, const Dual& a) { return {value, a.slope == 0.0 ? Slopes{} : steepness * a.slope}; }

inline Dual sqrt(const Dual& a) {
  const double root = std::sqrt(a.value);
  return follow(root, 0.5 / root, a);
}
inline Dual sin(const Dual& a) { return follow(std::sin(a.value), std::cos(a.value), a); }
inline Dual cos(const Dual& a) { return follow(std::cos(a.value), -std::sin(a.value), a); }
inline Dual tan(const Dual& a) {
  const double tangent = std::tan(a.value);
  return follow(tangent, 1.0 + tangent * tangent, a);
}
inline Dual asin(const Dual& a) { return follow(std::asin(a.value), 1.0 / std::sqrt(1.0 - a.value * a.value), a); }
inline Dual acos(const Dual& a) { return follow(std::acos(a.value), -1.0 / std::sqrt(1.0 - a.value * a.value), a); }
inline Dual atan(const Dual& a) { return follow(std::atan(a.value), 1.0 / (1.0 + a.value * a.value), a); }
inline Dual sinh(const Dual& a) { return follow(std::sinh(a.value), std::cosh(a.value), a); }
inline Dual cosh(const Dual& a) { return follow(std::cosh(a.value), std::sinh(a.value), a); }
inline Dual tanh(const Dual& a) {
  const double tangent = std::tanh(a.value);
  return follow(tangent, 1.0 - tangent * tangent, a);
}
inline Dual exp(const Dual& a) {
  const double power = std::exp(a.value);
  return follow(power, power, a);
}
inline Dual log(const Dual& a) { return follow(std::log(a.value), 1.0 / a.value, a); }
inline Dual abs(const Dual& a) { return {std::abs(a.value), a.value < 0.0 ? -a.slope : a.slope}; }
inline Dual atan2(const Dual& a, const Dual& b) {
  const double square = a.value * a.value + b.value * b.value;
  return follow(std::atan2(a.value, b.value), b.value / square, a) + follow(0.0, -a.value / square, b);
}
inline Dual pow(const Dual& a, const Dual& b) {
  const double power = std::pow(a.value, b.value);
  return follow(power, b.value * std::pow(a.value, b.value - 1.0), a) + follow(0.0, std::log(a.value) * power, b);
}

}  // namespace cutjoint
