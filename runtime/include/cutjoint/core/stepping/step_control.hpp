// How long the steps of an adaptive method are.
#pragma once

#include "cutjoint/core/mechanism/mechanism.hpp"
#include "cutjoint/core/numbers/vectors.hpp"

namespace cutjoint::stepping {

/// The largest error of a value: `absolute` times the nominal value, and a share `relative` of the value itself.  Values are places of a row (q, v) or v.
/// Nominal values are 1 in SI units but for first-order states; if the `arm` is not 1, they are arm (m), sqrt(arm) (m/s) and 1/sqrt(arm) (rad/s).
template <class Real>
struct Tolerances {
  Real relative{0}, absolute{0};
  std::span<const double> nominals{};  ///< `nominals_of`
  double arm = 1.0;
  std::size_t states = 0;
  std::span<const Chart> charts{};

  static Tolerances of_steps(const auto& subject, double relative, double absolute) {
    return {Real(relative), Real(absolute), nominals_of(subject), arm_of(subject), number_of_states(subject), charts_of(subject)};
  }

  /// That of a value at a place of a row.
  Real of(Real value, std::size_t i, std::size_t length) const {
    using std::abs;
    return absolute * size(i, length) + relative * abs(value);
  }

  Real size(std::size_t i, std::size_t length) const {
    if (arm == 1.0 || length - i <= states) return Real(size_at(nominals, i, length));
    if (length - i <= nominals.size()) return time() * Real(size_at(nominals, i, length));
    const auto after = std::upper_bound(charts.begin(), charts.end(), static_cast<int>(i), [](int place, const Chart& chart) { return place < chart.q; });
    const Chart& chart = *(after - 1);
    const int scalar = static_cast<int>(i) - chart.q;
    return scalar < chart.scalars ? Real(arm * nominals[static_cast<std::size_t>(chart.v + scalar)]) : Real(1);
  }

  /// That of falling the arm's length at 1 m/s2.
  Real time() const { return Real(std::sqrt(arm)); }

  Tolerances part(Real share) const {
    Tolerances part = *this;
    part.relative *= share, part.absolute *= share;
    return part;
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
  long rejected_ = 0;  ///< 0 or 1; a bool would leave bytes of a snapshot to chance
};

}  // namespace cutjoint::stepping
