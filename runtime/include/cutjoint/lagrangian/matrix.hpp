// What the runtime itself does with sparse matrices: whole ones from lower triangles, and how well a solution solves.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "cutjoint/lagrangian/system.hpp"

namespace cutjoint {

/// The whole matrix of a pattern: of a symmetric one the triangle and its mirror image, of any other a copy.
class WholeMatrix {
 public:
  explicit WholeMatrix(const Pattern& pattern) {
    const auto size = static_cast<std::size_t>(pattern.size);
    whole_.size = pattern.size;
    whole_.first.assign(size + 1, 0);
    visit(pattern, [&](int, int column, int) { ++whole_.first[static_cast<std::size_t>(column) + 1]; });
    for (std::size_t j = 0; j < size; ++j) whole_.first[j + 1] += whole_.first[j];
    whole_.row.resize(static_cast<std::size_t>(whole_.first[size]));
    source_.resize(whole_.row.size());
    std::vector<int> next(whole_.first.begin(), whole_.first.end() - 1);
    visit(pattern, [&](int row, int column, int entry) {
      const auto at = static_cast<std::size_t>(next[static_cast<std::size_t>(column)]++);
      whole_.row[at] = row;
      source_[at] = entry;
    });
  }

  const Pattern& pattern() const { return whole_; }

  /// The whole matrix's values from those of the pattern it was made from.
  template <class Real>
  void fill(const Real* values, Real* whole) const {
    for (std::size_t i = 0; i < source_.size(); ++i) whole[i] = values[source_[i]];
  }

 private:
  /// Row, column and entry of all entries of the whole matrix.  Columns of the triangle are visited in ascending order, so that
  /// the rows of each whole column ascend: first those above the diagonal, which come from earlier columns, then its own.
  template <class Visitor>
  static void visit(const Pattern& pattern, Visitor visitor) {
    for (int column = 0, entry = 0; column < pattern.size; ++column)
      for (; entry < pattern.first[static_cast<std::size_t>(column) + 1]; ++entry) {
        const int row = pattern.row[static_cast<std::size_t>(entry)];
        visitor(row, column, entry);
        if (pattern.symmetric && row != column) visitor(column, row, entry);
      }
  }

  Pattern whole_;
  std::vector<int> source_;
};

/// The measures of a whole matrix by which its rows and columns become comparable, and what they say of a solution.
///
/// With d_j the largest entry of column j, the unknowns d_j x_j have one scale whatever the units of x; the largest entry of row i in
/// these unknowns, R_i = max_j |K_ij| / d_j, is the scale of equation i.
template <class Real>
class Scaled {
 public:
  explicit Scaled(const Pattern& whole)
      : pattern_(whole), column_(static_cast<std::size_t>(whole.size)), row_(column_.size()), left_(column_.size()) {}

  void measure(const Real* values) {
    using std::abs, std::max;
    std::fill(row_.begin(), row_.end(), Real(0));
    for (std::size_t j = 0; j < column_.size(); ++j) {
      Real largest(0);
      for (std::size_t i = begin(j); i < begin(j + 1); ++i) largest = max(largest, abs(values[i]));
      column_[j] = largest;
      const Real inverse = largest > Real(0) ? Real(1) / largest : Real(0);
      for (std::size_t i = begin(j); i < begin(j + 1); ++i) row_[row(i)] = max(row_[row(i)], abs(values[i]) * inverse);
    }
  }

  /// The backward error of a solution, max_i |K x - b|_i / (R_i max_j |d_j x_j| + |b_i|): how much the equations would have to change,
  /// relative to their scale, for x to solve them (after Oettli and Prager 1964).  Not a number where x has no finite value.
  Real backward_error(const Real* values, const Real* x, const Real* b) {
    using std::abs, std::max;
    Real size(0), error(0);
    for (std::size_t i = 0; i < left_.size(); ++i) left_[i] = -b[i];
    for (std::size_t j = 0; j < column_.size(); ++j) {
      size = max(size, abs(column_[j] * x[j]));
      for (std::size_t i = begin(j); i < begin(j + 1); ++i) left_[row(i)] += values[i] * x[j];
    }
    for (std::size_t i = 0; i < left_.size(); ++i) {
      const Real whole = row_[i] * size + abs(b[i]);
      if (!(abs(left_[i]) <= error * whole)) error = abs(left_[i]) / whole;
      if (!std::isfinite(static_cast<double>(error))) return error;
    }
    return error;
  }

  /// A right-hand side of the equations' scale without pattern of its own: what a singular matrix blows up.
  void probe(Real* b) const {
    unsigned state = 12345;
    for (std::size_t i = 0; i < row_.size(); ++i) {
      state = state * 1664525u + 1013904223u;
      b[i] = row_[i] * (Real(0.5) + Real(state >> 16) / Real(131072)) * ((state >> 15) & 1u ? Real(1) : Real(-1));
    }
  }

  /// The largest of the scaled unknowns.
  Real size(const Real* x) const {
    using std::abs;
    Real largest(0);
    for (std::size_t j = 0; j < column_.size(); ++j)
      if (const Real scaled = abs(column_[j] * x[j]); scaled > largest || scaled != scaled) largest = scaled;
    return largest;
  }

 private:
  std::size_t begin(std::size_t j) const { return static_cast<std::size_t>(pattern_.first[j]); }
  std::size_t row(std::size_t i) const { return static_cast<std::size_t>(pattern_.row[i]); }

  const Pattern& pattern_;
  std::vector<Real> column_, row_, left_;
};

}  // namespace cutjoint
