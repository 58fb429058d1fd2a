// How long the steps of an adaptive method are.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>

namespace cutjoint::stepping {

/// The largest error of a value: `absolute` and a share `relative` of the value itself.  The last values of a row are states, which have `nominals`: usual sizes,
/// by which `absolute` is multiplied.
template <class Real>
struct Tolerances {
  Real relative{0}, absolute{0};
  std::span<const double> nominals{};

  Real of(Real value) const {
    using std::abs;
    return absolute + relative * abs(value);
  }

  /// That of a value at a place of a row.
  Real of(Real value, std::size_t i, std::size_t length) const {
    using std::abs;
    return absolute * size(i, length) + relative * abs(value);
  }

  Real size(std::size_t i, std::size_t length) const { return length - i <= nominals.size() ? Real(nominals[nominals.size() - (length - i)]) : Real(1); }

  Tolerances part(Real share) const { return {share * relative, share * absolute, nominals}; }
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
  long rejected_ = 0;  ///< 0 or 1; a bool would leave bytes of a snapshot to chance
};

}  // namespace cutjoint::stepping
