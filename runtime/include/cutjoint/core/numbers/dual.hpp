// Dual numbers: forward-mode derivatives of generated code, exact up to rounding.
#pragma once

#include <cmath>
#include <cstddef>
#include <utility>

#include "cutjoint/core/numbers/functions.hpp"
#include "cutjoint/core/numbers/intrinsics.hpp"

namespace cutjoint {

/// A register of doubles with the alignment of doubles, and its length.
inline constexpr std::size_t register_length = doubles_of_register;
typedef double Part __attribute__((vector_size(register_length * sizeof(double)), aligned(alignof(double))));

template <std::size_t count, class Parts = std::make_index_sequence<count / register_length>>
struct Side;

/// `count` numbers in registers; GCC spills longer vectors to memory.
template <std::size_t count, std::size_t... p>
struct Side<count, std::index_sequence<p...>> {
  Part part[sizeof...(p)];

  double operator[](std::size_t k) const { return part[k / register_length][k % register_length]; }
  double& operator[](std::size_t k) { return reinterpret_cast<double*>(part)[k]; }
  bool is_zero() const {
    for (std::size_t k = 0; k < count; ++k)
      if ((*this)[k] != 0.0) return false;
    return true;
  }

  /// Construct each register from its index.
  [[gnu::always_inline]] static Side of(auto each) { return {{each(p)...}}; }

  [[gnu::always_inline]] Side& operator+=(const Side& b) { return *this = *this + b; }
  [[gnu::always_inline]] Side& operator-=(const Side& b) { return *this = *this - b; }
  [[gnu::always_inline]] Side& operator*=(double b) { return *this = *this * b; }
  [[gnu::always_inline]] Side& operator/=(double b) { return *this = *this / b; }

#define CUTJOINT_OPERATION(operation)                                                                                                         \
  [[gnu::always_inline]] friend Side operator operation(const Side& a, const Side& b) { return {{(a.part[p] operation b.part[p])...}}; } \
  [[gnu::always_inline]] friend Side operator operation(const Side& a, double b) { return {{(a.part[p] operation b)...}}; }               \
  [[gnu::always_inline]] friend Side operator operation(double a, const Side& b) { return {{(a operation b.part[p])...}}; }
  CUTJOINT_OPERATION(+)
  CUTJOINT_OPERATION(-)
  CUTJOINT_OPERATION(*)
  CUTJOINT_OPERATION(/)
#undef CUTJOINT_OPERATION
  [[gnu::always_inline]] friend Side operator-(const Side& a) { return {{(-a.part[p])...}}; }

  /// The larger of both; the second if one is NaN.
  [[gnu::always_inline]] friend Side larger(const Side& a, const Side& b) { return {{(a.part[p] > b.part[p] ? a.part[p] : b.part[p])...}}; }

  /// The product steepness * a, with 0 if a is 0, even if the steepness is infinite.
  [[gnu::always_inline]] friend Side along(const auto& steepness, const Side& a) {
    const Side product = steepness * a;
    return {{(a.part[p] == 0.0 ? Part{} : product.part[p])...}};
  }
};

/// Derivatives along several seeds.
inline constexpr std::size_t seeds_at_once = 8;
using Tangents = Side<seeds_at_once>;

/// A value and its derivatives along seeds, with the arithmetic and functions of generated code.  Comparisons are of values: at non-smooth points
/// derivatives are those of the active branch, for |x| at 0 those of x.  A constant has a derivative of 0 also where a function is
/// infinitely steep.
struct Dual {
  double value = 0.0;
  Tangents derivative{};

  constexpr Dual() = default;
  constexpr Dual(double number) : value(number) {}
  constexpr Dual(double number, const Tangents& derivatives) : value(number), derivative(derivatives) {}
  /// The derivatives of another: clang assumes alignment of a vector passed by itself.
  constexpr Dual(double number, const Dual& other) : value(number), derivative(other.derivative) {}

  [[gnu::always_inline]] Dual& operator+=(const Dual& b) { return *this = *this + b; }
  [[gnu::always_inline]] Dual& operator-=(const Dual& b) { return *this = *this - b; }
  [[gnu::always_inline]] Dual& operator*=(const Dual& b) { return *this = *this * b; }
  [[gnu::always_inline]] Dual& operator/=(const Dual& b) { return *this = *this / b; }

  [[gnu::always_inline]] friend Dual operator-(const Dual& a) { return {-a.value, -a.derivative}; }
  [[gnu::always_inline]] friend Dual operator+(const Dual& a, const Dual& b) { return {a.value + b.value, a.derivative + b.derivative}; }
  [[gnu::always_inline]] friend Dual operator-(const Dual& a, const Dual& b) { return {a.value - b.value, a.derivative - b.derivative}; }
  [[gnu::always_inline]] friend Dual operator*(const Dual& a, const Dual& b) { return {a.value * b.value, a.derivative * b.value + a.value * b.derivative}; }
  [[gnu::always_inline]] friend Dual operator/(const Dual& a, const Dual& b) {
    const double quotient = a.value / b.value;
    return {quotient, (a.derivative - quotient * b.derivative) / b.value};
  }
  friend bool operator<(const Dual& a, const Dual& b) { return a.value < b.value; }
  friend bool operator<=(const Dual& a, const Dual& b) { return a.value <= b.value; }
  friend bool operator>(const Dual& a, const Dual& b) { return a.value > b.value; }
  friend bool operator>=(const Dual& a, const Dual& b) { return a.value >= b.value; }
};

/// Derivatives without a value, for linear maps.
struct DualPart {
  Tangents derivative;

  [[gnu::always_inline]] DualPart& operator+=(const DualPart& b) { return derivative += b.derivative, *this; }
  [[gnu::always_inline]] DualPart& operator-=(const DualPart& b) { return derivative -= b.derivative, *this; }
  [[gnu::always_inline]] DualPart& operator*=(double b) { return derivative *= b, *this; }
  [[gnu::always_inline]] DualPart& operator/=(double b) { return derivative /= b, *this; }

  [[gnu::always_inline]] friend DualPart operator*(const DualPart& a, double b) { return {a.derivative * b}; }
  [[gnu::always_inline]] friend DualPart operator*(double a, const DualPart& b) { return {a * b.derivative}; }
};

/// A function's value and the chain rule for an argument, with the partial derivative `steepness`.
inline Dual follow(double value, double steepness, const Dual& a) { return {value, along(steepness, a.derivative)}; }
inline double value_of(const Dual& a) { return a.value; }

/// Dual numbers, single or in lanes.
template <class A>
concept Differentiated = requires(const A& a) { a.derivative, value_of(a); };

#define CUTJOINT_FOLLOW(name, steepness)                       \
  template <Differentiated A>                                  \
  A name(const A& a) {                                         \
    const auto x = value_of(a), y = [&] {                      \
      using std::name;                                         \
      return name(x);                                          \
    }();                                                       \
    using std::cos, std::cosh, std::sin, std::sinh, std::sqrt; \
    return follow(y, steepness, a);                            \
  }
CUTJOINT_FUNCTIONS(CUTJOINT_FOLLOW)
#undef CUTJOINT_FOLLOW
template <Differentiated A>
A atan2(const A& a, const A& b) {
  using std::atan2;
  const auto y = value_of(a), x = value_of(b), square = y * y + x * x;
  return follow(atan2(y, x), x / square, a) + follow(0.0, -y / square, b);
}
template <Differentiated A>
A pow(const A& a, const A& b) {
  using std::log, std::pow;
  const auto base = value_of(a), exponent = value_of(b), power = pow(base, exponent);
  return follow(power, exponent * pow(base, exponent - 1.0), a) + follow(0.0, log(base) * power, b);
}
inline Dual abs(const Dual& a) { return {std::abs(a.value), a.value < 0.0 ? -a.derivative : a.derivative}; }

}  // namespace cutjoint
