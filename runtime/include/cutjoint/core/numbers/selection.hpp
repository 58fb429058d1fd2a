// Selections of instances of a mechanism: one for a plain real, or some of several SIMD lanes.
#pragma once

#include <cmath>

namespace cutjoint {

/// A mask of instances: one for a plain real.  Reals with lanes have a specialisation.
template <class Real>
struct Selection {
  using Scalar = Real;
  using Mask = bool;
  using Count = long;
  static constexpr int number = 1;

  static bool any(bool mask) { return mask; }
  static bool all_if(bool condition) { return condition; }
  static bool both(bool a, bool b) { return a && b; }
  static bool either(bool a, bool b) { return a || b; }
  static bool without(bool mask, bool others) { return mask && !others; }
  static bool finite(Real x) { return std::isfinite(static_cast<double>(x)); }
  static bool is_number(Real x) { return x == x; }
  static bool has(bool mask, int) { return mask; }
  static double of(Real x, int) { return static_cast<double>(x); }
  static void count(bool mask, long& counted) { counted += mask; }

  /// Assign in the selected instances.
  static void take(bool mask, Real value, Real& number) {
    if (mask) number = value;
  }

  /// The choice for arrays; `values` may end with the former contents of the other.
  template <class Numbers>
  static void take_all(bool mask, Numbers& values, Numbers& numbers) {
    if (mask) numbers.swap(values);
  }
};

}  // namespace cutjoint
