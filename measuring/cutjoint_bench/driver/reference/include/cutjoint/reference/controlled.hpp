// Steps as long as an estimate of their error allows.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "cutjoint/state.hpp"

namespace cutjoint::reference {

/// Advances y' = f(t, y) from one time to another.  A step's error, component by component relative to 1 + |y|, is at most `tolerance`.
template <class Dynamics, template <class> class Integrator>
class Controlled {
 public:
  using Real = typename Dynamics::Real;

  Controlled(Dynamics& dynamics, Real tolerance)
      : dynamics_(dynamics), integrator_(dynamics), tolerance_(tolerance), end_(dynamics.size()), error_(dynamics.size()) {}

  /// Go on from y at t to `until`; `number` is the step's in messages.  Throws Failure where no step is small enough.
  void advance(Real t, Real until, std::vector<Real>& y, long number) {
    using std::pow;
    const Real rest = (until - t) * Real(1e-10), least = (until - t) * Real(1e-6);
    if (!(h_ > Real(0))) h_ = (until - t) / Real(16);
    while (until - t > rest) {
      const Real h = std::min(h_, until - t);
      integrator_.attempt(t, h, y, end_, error_);
      const Real size = largest_error(y);
      const Real change = size > Real(0) ? Real(0.9) * pow(tolerance_ / size, Real(1) / Real(Integrator<Dynamics>::order + 1)) : Real(4);
      if (size <= tolerance_) {
        t += h;
        y.swap(end_);
        dynamics_.project(t, y);
        ++steps_;
        if (h >= h_) h_ = h * std::clamp(change, Real(0.2), Real(4));
      } else {
        h_ = h * (change > Real(0) ? std::clamp(change, Real(0.1), Real(0.9)) : Real(0.1));
        if (!(h_ > least))
          throw Failure("no step is small enough for the tolerance", static_cast<double>(t), number, dynamics_.name(worst_),
                        static_cast<double>(size), "try: a larger tolerance, or a longer precision");
      }
    }
  }

  long steps() const { return steps_; }

 private:
  /// The largest relative error; infinite where one is no number.
  Real largest_error(const std::vector<Real>& y) {
    using std::abs;
    Real largest(0);
    for (std::size_t i = 0; i < y.size(); ++i) {
      const Real size = abs(error_[i]) / (Real(1) + abs(y[i]));
      if (size <= largest) continue;
      largest = size;
      worst_ = i;
      if (!(size == size)) return std::numeric_limits<Real>::infinity();
    }
    return largest;
  }

  Dynamics& dynamics_;
  Integrator<Dynamics> integrator_;
  Real tolerance_, h_{0};
  std::vector<Real> end_, error_;
  std::size_t worst_ = 0;
  long steps_ = 0;
};

}  // namespace cutjoint::reference
