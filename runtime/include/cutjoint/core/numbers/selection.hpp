// Which instances of a mechanism go on: the one that a real is a number of, or some of several side by side.
#pragma once

#include <cmath>

namespace cutjoint {

/// Instances of a mechanism by a mask: of a plain real there is one.  Reals that are numbers of several have a specialisation.
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

  /// A number becomes another in a selection.
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
