// How long the steps of an adaptive method are.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

namespace cutjoint::stepping {

/// The largest error of a value: `absolute` and a share `relative` of the value itself.
template <class Real>
struct Tolerances {
  Real relative{0}, absolute{0};

  Real of(Real value) const {
    using std::abs;
    return absolute + relative * abs(value);
  }
};

/// A proportional-integral controller.  Source: Hairer, Wanner, Solving Ordinary Differential Equations II (1996), section IV.2.
template <class Real, int order>
class StepControl {
 public:
  /// The length after an accepted step of length h whose error has this size; an error of 1 is what is allowed.
  Real after(Real h, Real size) {
    using std::pow;
    const Real factor = safety() * pow(last_, integral()) / pow(std::max(size, Real(1e-10)), proportional());
    last_ = std::max(size, Real(1e-4));
    const Real longest(rejected_ ? 1 : 10);
    rejected_ = false;
    return h * std::clamp(factor, Real(0.2), longest);
  }

  /// A shorter length after one that was too long; the size may be infinite.
  Real instead_of(Real h, Real size) {
    using std::pow;
    rejected_ = true;
    return h * std::max(Real(0.1), safety() / pow(size, proportional()));
  }

  /// Forget the errors of earlier steps.
  void restart() { *this = StepControl(); }

 private:
  static Real integral() { return Real(0.04); }
  static Real proportional() { return Real(1) / Real(order) - Real(0.75) * integral(); }
  static Real safety() { return Real(0.9); }

  Real last_{1e-4};
  bool rejected_ = false;
};

}  // namespace cutjoint::stepping
