// Backward errors of solutions, independent of the units of rows and columns.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "cutjoint/core/newton/system.hpp"

namespace cutjoint {

/// Row and column scales of a system's full tangent, and backward errors of solutions.
///
/// With d_j the largest entry of column j, the unknowns d_j x_j have one scale whatever the units of x; the largest entry of row i in
/// these unknowns, R_i = max_j |K_ij| / d_j, is the scale of equation i.
template <class S>
class Scaled {
 public:
  using Real = typename S::real_type;

  explicit Scaled(const S& system) : pattern_(pattern_of(system)), scales_(tangent_of(system).rows), left_(scales_.column.size()) {}

  void measure(const Real* values) {
    using std::abs, std::max;
    std::fill(scales_.row.begin(), scales_.row.end(), Real(0));
    for (std::size_t j = 0; j < scales_.column.size(); ++j) {
      Real largest(0);
      for (std::size_t i = begin(j); i < begin(j + 1); ++i) largest = max(largest, abs(values[i]));
      scales_.column[j] = largest;
      const Real inverse = largest > Real(0) ? Real(1) / largest : Real(0);
      for (std::size_t i = begin(j); i < begin(j + 1); ++i) scales_.row[row(i)] = max(scales_.row[row(i)], abs(values[i]) * inverse);
    }
  }

  /// The backward error of a solution, max_i |K x - b|_i / (R_i max_j |d_j x_j| + |b_i|): how much the equations would have to change,
  /// relative to their scale, for x to solve them (after Oettli and Prager 1964).  NaN if x is not finite.
  Real backward_error(const Real* values, const Real* x, const Real* b) {
    using std::abs, std::max;
    Real size(0), error(0);
    for (std::size_t i = 0; i < left_.size(); ++i) left_[i] = -b[i];
    for (std::size_t j = 0; j < left_.size(); ++j) {
      size = max(size, abs(scales_.column[j] * x[j]));
      for (std::size_t i = begin(j); i < begin(j + 1); ++i) left_[row(i)] += values[i] * x[j];
    }
    for (std::size_t i = 0; i < left_.size(); ++i) {
      const Real whole = scales_.row[i] * size + abs(b[i]);
      if (!(abs(left_[i]) <= error * whole)) error = abs(left_[i]) / whole;
      if (!std::isfinite(static_cast<double>(error))) return error;
    }
    return error;
  }

  /// A pseudo-random right-hand side of the equations' scale, which a singular matrix amplifies.
  void probe(Real* b) const {
    unsigned state = 12345;
    for (std::size_t i = 0; i < scales_.row.size(); ++i) {
      state = state * 1664525u + 1013904223u;
      b[i] = scales_.row[i] * (Real(0.5) + Real(state >> 16) / Real(131072)) * ((state >> 15) & 1u ? Real(1) : Real(-1));
    }
  }

  /// The largest of the scaled unknowns.
  Real size(const Real* x) const {
    using std::abs;
    Real largest(0);
    for (std::size_t j = 0; j < scales_.column.size(); ++j)
      if (const Real scaled = abs(scales_.column[j] * x[j]); scaled > largest || scaled != scaled) largest = scaled;
    return largest;
  }

  /// d and R.
  struct Scales {
    Rows<S> column, row;

    explicit Scales(std::size_t n) : column(n), row(n) {}
  };

  const Scales& scales() const { return scales_; }
  void restore(const Scales& scales) { scales_ = scales; }

 private:
  std::size_t begin(std::size_t j) const { return static_cast<std::size_t>(pattern_.first[j]); }
  std::size_t row(std::size_t i) const { return static_cast<std::size_t>(pattern_.row[i]); }

  const PatternOf<S>& pattern_;
  Scales scales_;
  Rows<S> left_;
};

}  // namespace cutjoint
