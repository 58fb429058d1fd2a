// L U of a complex matrix with the pattern of a tangent.
#pragma once

#include "cutjoint/core/newton/static_solver.hpp"

namespace cutjoint {

/// Factors complex matrices with the pattern of a system's whole tangents, from the last unknown to the first: coordinates of a tree are in the order of parents first,
/// so fill is small.  A row is stored from its first nonzero entry.  The pivot is the diagonal's, unless it is below a thousandth of the
/// largest of its column (Golub, Van Loan, Matrix Computations, section 3.4).  Real and imaginary parts are separate for vectorisation.
template <class S>
class ComplexSolver {
 public:
  using Real = typename S::real_type;

  static constexpr std::size_t rows = static_tangent<S>().rows;

  explicit ComplexSolver(const S& system)
      : system_(system), n_(tangent_of(system).rows), re_(n_ * n_), im_(n_ * n_), x_(n_), y_(n_), first_(n_), last_(n_), order_(n_) {}

  /// Factor the matrix with these real and imaginary parts.
  Breakdown factor(const Real* re, const Real* im) {
    fill(re, im);
    for (std::size_t k = n_; k-- > 0;) {
      bring_pivot(k);
      Real *a = row(re_, k), *b = row(im_, k);
      const Real size = a[k] * a[k] + b[k] * b[k];
      if (!(size - size == Real(0)) || size == Real(0)) return {Breakdown::Kind::singular, -1};
      a[k] /= size;
      b[k] /= -size;
      for (std::size_t i = first_of_column_; i < k; ++i) eliminate(k, i, a, b);
    }
    return {};
  }

  /// Solve in place for both parts of a right-hand side.
  void solve(Real* re, Real* im) {
    for (std::size_t i = n_; i-- > 0;) take_products(i, i + 1, last_[i], re[order_[i]], im[order_[i]]);
    for (std::size_t i = 0; i < n_; ++i) {
      take_products(i, first_[i], i, x_[i], y_[i]);
      const Real a = row(re_, i)[i], b = row(im_, i)[i], x = x_[i], y = y_[i];
      x_[i] = a * x - b * y;
      y_[i] = a * y + b * x;
    }
    std::copy(x_.begin(), x_.end(), re);
    std::copy(y_.begin(), y_.end(), im);
  }

 private:
  using Square = Array<S, rows * rows>;

  Real* row(Square& part, std::size_t i) { return part.data() + i * n_; }

  void fill(const Real* re, const Real* im) {
    const auto& pattern = pattern_of(system_);
    std::fill(re_.begin(), re_.end(), Real(0));
    std::fill(im_.begin(), im_.end(), Real(0));
    for (std::size_t i = 0; i < n_; ++i) {
      order_[i] = i;
      first_[i] = i;
      last_[i] = i + 1;
    }
    for (std::size_t j = 0; j < n_; ++j)
      for (auto k = static_cast<std::size_t>(pattern.first[j]); k < static_cast<std::size_t>(pattern.first[j + 1]); ++k) {
        const auto i = static_cast<std::size_t>(pattern.row[k]);
        row(re_, i)[j] = re[k];
        row(im_, i)[j] = im[k];
        first_[i] = std::min(first_[i], j);
      }
  }

  Real size_at(std::size_t i, std::size_t k) {
    using std::abs;
    return abs(row(re_, i)[k]) + abs(row(im_, i)[k]);
  }

  /// Exchange rows for the pivot of column k; NaN counts as largest.
  void bring_pivot(std::size_t k) {
    std::size_t largest = k;
    first_of_column_ = k;
    for (std::size_t i = k; i-- > 0;) {
      const Real size = size_at(i, k);
      if (size == Real(0)) continue;
      first_of_column_ = i;
      if (size > size_at(largest, k) || size != size) largest = i;
    }
    if (!(size_at(k, k) < Real(1e-3) * size_at(largest, k)) || largest == k) return;
    std::swap_ranges(row(re_, k), row(re_, k) + n_, row(re_, largest));
    std::swap_ranges(row(im_, k), row(im_, k) + n_, row(im_, largest));
    std::swap(order_[k], order_[largest]);
    std::swap(first_[k], first_[largest]);
    std::swap(last_[k], last_[largest]);
  }

  /// Eliminate row i's entry in the column of the pivot; the factor is stored in its place.
  void eliminate(std::size_t k, std::size_t i, const Real* a, const Real* b) {
    Real *re = row(re_, i), *im = row(im_, i);
    if (re[k] == Real(0) && im[k] == Real(0)) return;
    const Real x = re[k] * a[k] - im[k] * b[k], y = re[k] * b[k] + im[k] * a[k];
    for (std::size_t j = first_[k]; j < k; ++j) {
      re[j] -= x * a[j] - y * b[j];
      im[j] -= x * b[j] + y * a[j];
    }
    re[k] = x;
    im[k] = y;
    first_[i] = std::min(first_[i], first_[k]);
    last_[i] = std::max(last_[i], k + 1);
  }

  /// The unknown of a row: (x, y) minus the products of its entries in a range of columns with their unknowns.
  void take_products(std::size_t i, std::size_t from, std::size_t to, Real x, Real y) {
    const Real *a = row(re_, i), *b = row(im_, i);
    for (std::size_t j = from; j < to; ++j) {
      x -= a[j] * x_[j] - b[j] * y_[j];
      y -= a[j] * y_[j] + b[j] * x_[j];
    }
    x_[i] = x;
    y_[i] = y;
  }

  const S& system_;
  std::size_t n_, first_of_column_ = 0;
  Square re_, im_;  ///< by rows: the factors below and above the diagonal, and the reciprocals of pivots on it
  Rows<S> x_, y_;
  Array<S, rows, std::size_t> first_, last_, order_;  ///< of each row: its first entry, the end of its factors, the row of the matrix
};

}  // namespace cutjoint
