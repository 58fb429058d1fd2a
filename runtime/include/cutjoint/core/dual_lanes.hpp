// Numbers with derivatives side by side.
#pragma once

#include <type_traits>

#include "cutjoint/core/dual_road.hpp"
#include "cutjoint/core/lanes.hpp"

namespace cutjoint {

/// Numbers that have no vector register, side by side.  Each operation is a call, so that long functions are compiled in seconds.
template <class Number, int N>
  requires(!std::is_floating_point_v<Number>)
struct Lanes<Number, N> {
  using Vector = Lanes;
  using Mask = typename Lanes<double, N>::Mask;
  using real_type = Number;
  static constexpr int size = N;

  Number v[N];

  Lanes() = default;
  Lanes(const Number& x) {
    for (Number& each : v) each = x;
  }
  template <class... Numbers>
    requires(sizeof...(Numbers) == N && N > 1)
  Lanes(const Numbers&... x) : v{x...} {}

  const Number& operator[](int k) const { return v[k]; }
  Number& operator[](int k) { return v[k]; }

  Lanes& operator+=(const Lanes& b) { return *this = *this + b; }
  Lanes& operator*=(const Lanes& b) { return *this = *this * b; }

  static Mask mask(bool condition) { return Lanes<double, N>::mask(condition); }

#define CUTJOINT_DEFINE(Result, operation, A, B, a, b)                                    \
  [[gnu::noinline]] friend Result operator operation(const A & left, const B & right) {  \
    Result result;                                                                        \
    for (int k = 0; k < N; ++k) result[k] = a operation b;                                \
    return result;                                                                        \
  }
#define CUTJOINT_OPERATION(operation)                                       \
  CUTJOINT_DEFINE(Lanes, operation, Lanes, Lanes, left.v[k], right.v[k])       \
  CUTJOINT_DEFINE(Lanes, operation, Lanes, Number, left.v[k], right)          \
  CUTJOINT_DEFINE(Lanes, operation, Number, Lanes, left, right.v[k])
  CUTJOINT_OPERATION(+)
  CUTJOINT_OPERATION(-)
  CUTJOINT_OPERATION(*)
  CUTJOINT_OPERATION(/)
  CUTJOINT_DEFINE(Mask, <, Lanes, Lanes, left.v[k], right.v[k] ? -1 : 0)
  CUTJOINT_DEFINE(Mask, <=, Lanes, Lanes, left.v[k], right.v[k] ? -1 : 0)
#undef CUTJOINT_OPERATION
#undef CUTJOINT_DEFINE

  friend Lanes operator-(const Lanes& a) {
    Lanes result;
    for (int k = 0; k < N; ++k) result[k] = -a.v[k];
    return result;
  }
};

template <class Mask, class Number, int N>
  requires(!std::is_floating_point_v<Number>)
Lanes<Number, N> where(Mask condition, Lanes<Number, N> yes, Lanes<Number, N> no) {
  Lanes<Number, N> result;
  for (int k = 0; k < N; ++k) result[k] = condition[k] ? yes[k] : no[k];
  return result;
}

template <class Number, int N>
  requires(!std::is_floating_point_v<Number>)
Lanes<Number, N> abs(Lanes<Number, N> a) {
  return each(a, [](const Number& x) { return abs(x); });
}

}  // namespace cutjoint
