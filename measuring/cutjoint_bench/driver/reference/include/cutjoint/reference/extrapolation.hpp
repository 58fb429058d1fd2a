// The explicit midpoint rule with extrapolation of its step to zero.
#pragma once

#include <cstddef>
#include <vector>

namespace cutjoint::reference {

/// Gragg's method with polynomial extrapolation in the square of the step: six rows with 2, 4, ..., 12 substeps, order 12.
/// Source: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I (1993), section II.9.
template <class Dynamics>
class Extrapolation {
 public:
  using Real = typename Dynamics::Real;

  static constexpr int order = 11;  ///< of the estimate of the error

  explicit Extrapolation(Dynamics& dynamics)
      : dynamics_(dynamics), first_(dynamics.size()), slope_(first_), before_(first_), middle_(first_), above_(rows, first_),
        row_(above_) {}

  /// A step of h from y at t, into `end`; the difference of the last two columns, into `error`.
  void attempt(Real t, Real h, const std::vector<Real>& y, std::vector<Real>& end, std::vector<Real>& error) {
    dynamics_.derive(t, y, first_);
    for (int k = 0; k < rows; ++k) {
      midpoint(t, h, y, 2 * (k + 1), row_[0]);
      for (int j = 1; j <= k; ++j) extrapolate(Real(k + 1) / Real(k + 1 - j), static_cast<std::size_t>(j));
      above_.swap(row_);
    }
    end = above_[rows - 1];
    for (std::size_t i = 0; i < end.size(); ++i) error[i] = end[i] - above_[rows - 2][i];
  }

 private:
  static constexpr int rows = 6;

  /// n substeps of the midpoint rule, and Gragg's smoothing.
  void midpoint(Real t, Real h, const std::vector<Real>& y, int n, std::vector<Real>& end) {
    const Real s = h / Real(n);
    before_ = y;
    for (std::size_t i = 0; i < y.size(); ++i) middle_[i] = y[i] + s * first_[i];
    for (int step = 1; step < n; ++step) {
      dynamics_.derive(t + Real(step) * s, middle_, slope_);
      for (std::size_t i = 0; i < y.size(); ++i) before_[i] += Real(2) * s * slope_[i];
      before_.swap(middle_);
    }
    dynamics_.derive(t + h, middle_, slope_);
    for (std::size_t i = 0; i < y.size(); ++i) end[i] = (before_[i] + middle_[i] + s * slope_[i]) / Real(2);
  }

  /// T(k, j) = T(k, j-1) + (T(k, j-1) - T(k-1, j-1)) / (ratio^2 - 1), ratio that of the substeps in T(k, 0) and T(k-j, 0).
  void extrapolate(Real ratio, std::size_t j) {
    const Real factor = Real(1) / (ratio * ratio - Real(1));
    for (std::size_t i = 0; i < row_[j].size(); ++i) row_[j][i] = row_[j - 1][i] + factor * (row_[j - 1][i] - above_[j - 1][i]);
  }

  Dynamics& dynamics_;
  std::vector<Real> first_, slope_, before_, middle_;
  std::vector<std::vector<Real>> above_, row_;  ///< the row of the table before and the one that is made
};

}  // namespace cutjoint::reference
