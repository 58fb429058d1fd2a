// IEEE binary128, 113 bits or 34 decimal digits, as a number that templates over a real type take like any other.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <limits>

namespace cutjoint {

/// A wrapper of the compiler's __float128, whose functions are those of the C library (glibc 2.26).
struct Quad {
  __float128 v;

  Quad() = default;
  constexpr Quad(__float128 value) : v(value) {}
  constexpr Quad(double value) : v(value) {}
  constexpr Quad(long double value) : v(value) {}
  constexpr Quad(int value) : v(value) {}
  constexpr Quad(long value) : v(value) {}
  constexpr Quad(unsigned value) : v(value) {}
  constexpr Quad(bool) = delete;

  explicit constexpr operator double() const { return static_cast<double>(v); }
  explicit constexpr operator int() const { return static_cast<int>(v); }

  constexpr Quad& operator+=(Quad b) { return *this = v + b.v; }
  constexpr Quad& operator-=(Quad b) { return *this = v - b.v; }
  constexpr Quad& operator*=(Quad b) { return *this = v * b.v; }
  constexpr Quad& operator/=(Quad b) { return *this = v / b.v; }

  friend constexpr Quad operator-(Quad a) { return -a.v; }
  friend constexpr Quad operator+(Quad a, Quad b) { return a.v + b.v; }
  friend constexpr Quad operator-(Quad a, Quad b) { return a.v - b.v; }
  friend constexpr Quad operator*(Quad a, Quad b) { return a.v * b.v; }
  friend constexpr Quad operator/(Quad a, Quad b) { return a.v / b.v; }
  friend constexpr bool operator==(Quad a, Quad b) { return a.v == b.v; }
  friend constexpr bool operator!=(Quad a, Quad b) { return a.v != b.v; }
  friend constexpr bool operator<(Quad a, Quad b) { return a.v < b.v; }
  friend constexpr bool operator<=(Quad a, Quad b) { return a.v <= b.v; }
  friend constexpr bool operator>(Quad a, Quad b) { return a.v > b.v; }
  friend constexpr bool operator>=(Quad a, Quad b) { return a.v >= b.v; }
};

#define CUTJOINT_QUAD(name) \
  inline Quad name(Quad a) { return ::name##f128(a.v); }
CUTJOINT_QUAD(sqrt)
CUTJOINT_QUAD(sin)
CUTJOINT_QUAD(cos)
CUTJOINT_QUAD(tan)
CUTJOINT_QUAD(asin)
CUTJOINT_QUAD(acos)
CUTJOINT_QUAD(atan)
CUTJOINT_QUAD(sinh)
CUTJOINT_QUAD(cosh)
CUTJOINT_QUAD(tanh)
CUTJOINT_QUAD(exp)
CUTJOINT_QUAD(log)
CUTJOINT_QUAD(floor)
CUTJOINT_QUAD(ceil)
#undef CUTJOINT_QUAD

inline Quad abs(Quad a) { return a.v < 0 ? -a.v : a.v; }
inline Quad fabs(Quad a) { return abs(a); }
inline Quad atan2(Quad a, Quad b) { return ::atan2f128(a.v, b.v); }
inline Quad pow(Quad a, Quad b) { return ::powf128(a.v, b.v); }
/// To and from JSON as a double (found by nlohmann::json).
template <class J>
void to_json(J& json, const Quad& a) {
  json = static_cast<double>(a);
}
template <class J>
void from_json(const J& json, Quad& a) {
  a = json.template get<double>();
}

inline bool isfinite(Quad a) { return a.v - a.v == 0; }
inline bool isnan(Quad a) { return a.v != a.v; }
inline bool isinf(Quad a) { return !isfinite(a) && !isnan(a); }

}  // namespace cutjoint

template <>
struct std::numeric_limits<cutjoint::Quad> {
  static constexpr bool is_specialized = true, is_signed = true, is_integer = false, is_exact = false, is_iec559 = true;
  static constexpr bool has_infinity = true, has_quiet_NaN = true;
  static constexpr int digits = 113, digits10 = 33, max_digits10 = 36, radix = 2, min_exponent = -16381, max_exponent = 16384;
  static constexpr cutjoint::Quad power(int exponent) {
    cutjoint::Quad result = 1;
    for (int i = 0; i < exponent; ++i) result *= cutjoint::Quad(2);
    for (int i = 0; i > exponent; --i) result /= cutjoint::Quad(2);
    return result;
  }
  static constexpr cutjoint::Quad epsilon() { return power(-112); }
  static constexpr cutjoint::Quad min() { return power(-16382); }
  static constexpr cutjoint::Quad max() { return (cutjoint::Quad(2) - epsilon()) * power(16383); }
  static constexpr cutjoint::Quad lowest() { return -max(); }
  static constexpr cutjoint::Quad infinity() { return static_cast<__float128>(__builtin_huge_val()); }
  static constexpr cutjoint::Quad quiet_NaN() { return static_cast<__float128>(__builtin_nan("")); }
};

template <>
struct Eigen::NumTraits<cutjoint::Quad> : Eigen::GenericNumTraits<cutjoint::Quad> {
  using Real = cutjoint::Quad;
  using NonInteger = cutjoint::Quad;
  using Nested = cutjoint::Quad;
  using Literal = double;
  enum { IsComplex = 0, IsInteger = 0, IsSigned = 1, RequireInitialization = 0, ReadCost = 2, AddCost = 30, MulCost = 40 };
  static Real dummy_precision() { return Real(1e-30); }
  static int digits10() { return 33; }
};
