// Several instances of a mechanism in SIMD lanes: selections and norms.
#pragma once

#include <span>

#include "cutjoint/core/numbers/lanes.hpp"
#include "cutjoint/core/numbers/selection.hpp"

namespace cutjoint {

/// Instances by lanes.
template <class Number, int N>
struct Selection<Lanes<Number, N>> {
  using Real = Lanes<Number, N>;
  using Scalar = Number;
  using Mask = typename Real::Mask;
  using Count = Mask;
  static constexpr int number = N;

  static bool any(Mask mask) {
    long long bits = 0;
    for (int k = 0; k < N; ++k) bits |= mask[k];
    return bits != 0;
  }

  static Mask all_if(bool condition) { return Real::mask(condition); }
  static Mask both(Mask a, Mask b) { return a & b; }
  static Mask either(Mask a, Mask b) { return a | b; }
  static Mask without(Mask mask, Mask others) { return mask & ~others; }
  static Mask finite(Real x) { return (x - x).v == Real(0).v; }
  static Mask is_number(Real x) { return x.v == x.v; }
  static bool has(Mask mask, int k) { return mask[k]; }
  static double of(Real x, int k) { return static_cast<double>(x[k]); }
  static void count(Mask mask, Mask& counted) { counted -= mask; }
  static void take(Mask mask, Real value, Real& number) { number = where(mask, value, number); }

  template <class Numbers>
  static void take_all(Mask mask, const Numbers& values, Numbers& numbers) {
    for (std::size_t i = 0; i < numbers.size(); ++i) take(mask, values[i], numbers[i]);
  }
};

/// The larger of two numbers; NaN if one is NaN.
template <class Number, int N>
Lanes<Number, N> larger(Lanes<Number, N> a, Lanes<Number, N> b) {
  return where((b.v > a.v) | (b.v != b.v), b, a);
}

template <class Number, int N>
Lanes<Number, N> smaller(Lanes<Number, N> a, Lanes<Number, N> b) {
  return where((b.v < a.v) | (b.v != b.v), b, a);
}

/// The largest absolute value in each lane.
template <class Number, int N>
Lanes<Number, N> largest(std::span<const Lanes<Number, N>> values) {
  Lanes<Number, N> result(0);
  for (const Lanes<Number, N> value : values) result = larger(result, abs(value));
  return result;
}

}  // namespace cutjoint
