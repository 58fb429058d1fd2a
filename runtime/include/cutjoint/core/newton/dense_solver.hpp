// L U of a whole matrix with partial pivoting: what takes over where a fixed pivot order is unsafe.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <utility>

#include "cutjoint/core/newton/static_solver.hpp"
#include "cutjoint/core/newton/system.hpp"

namespace cutjoint {

/// Factors the whole tangents of a system as dense matrices, rows exchanged for the largest pivot of each column (Golub, Van Loan, Matrix Computations,
/// section 3.4).
template <class S>
class DenseSolver {
 public:
  using Real = typename S::real_type;

  static constexpr std::size_t rows = static_tangent<S>().rows;

  explicit DenseSolver(const S& system) : system_(system), order_(tangent_of(system).rows) {}

  /// Take the memory, where it is not inside: few runs need any.
  void prepare() {
    if constexpr (!Sized<S>) a_.resize(order_.size() * order_.size());
    x_ = Rows<S>(order_.size());
  }

  Breakdown factor(const Real* values) {
    fill(values);
    for (std::size_t k = 0; k < order_.size(); ++k) {
      bring_largest(k);
      if (!(at(k, k) - at(k, k) == Real(0)) || at(k, k) == Real(0)) return {Breakdown::Kind::singular, -1};
      for (std::size_t i = k + 1; i < order_.size(); ++i) at(i, k) /= at(k, k);
      for (std::size_t j = k + 1; j < order_.size(); ++j) subtract(k, at(k, j), &at(0, j));
    }
    return {};
  }

  Breakdown solve(Real* x) {
    const std::size_t n = order_.size();
    for (std::size_t i = 0; i < n; ++i) x_[i] = x[order_[i]];
    for (std::size_t k = 0; k < n; ++k) subtract(k, x_[k], x_.data());
    for (std::size_t k = n; k-- > 0;) {
      x_[k] /= at(k, k);
      for (std::size_t i = 0; i < k; ++i) x_[i] -= at(i, k) * x_[k];
    }
    std::copy(x_.begin(), x_.end(), x);
    return {};
  }

  /// The smallest pivot, as a share of the largest entry of its column.
  double smallest_pivot(const Real* values) const
    requires Sized<S>
  {
    std::array<int, rows> columns;
    for (std::size_t k = 0; k < rows; ++k) columns[k] = static_cast<int>(k);
    return share_of_columns<S>(values, [this](std::size_t k) { return static_cast<double>(a_[k * rows + k]); }, columns);
  }

 private:
  Real& at(std::size_t i, std::size_t j) { return a_[j * order_.size() + i]; }

  void fill(const Real* values) {
    const auto& pattern = pattern_of(system_);
    std::fill(a_.begin(), a_.end(), Real(0));
    for (std::size_t j = 0; j < order_.size(); ++j) {
      order_[j] = j;
      for (auto i = static_cast<std::size_t>(pattern.first[j]); i < static_cast<std::size_t>(pattern.first[j + 1]); ++i)
        at(static_cast<std::size_t>(pattern.row[i]), j) = values[i];
    }
  }

  /// The row of the largest entry below comes to the next place; one that is no number counts as largest.
  void bring_largest(std::size_t k) {
    using std::abs;
    std::size_t largest = k;
    for (std::size_t i = k + 1; i < order_.size(); ++i)
      if (abs(at(i, k)) > abs(at(largest, k)) || at(i, k) != at(i, k)) largest = i;
    if (largest == k) return;
    std::swap(order_[k], order_[largest]);
    for (std::size_t j = 0; j < order_.size(); ++j) std::swap(at(k, j), at(largest, j));
  }

  /// Take from the rest of a column the share of column k of L.
  void subtract(std::size_t k, Real factor, Real* column) {
    for (std::size_t i = k + 1; i < order_.size(); ++i) column[i] -= at(i, k) * factor;
  }

  const S& system_;
  Array<S, rows * rows> a_;
  Array<S, rows, std::size_t> order_;
  Rows<S> x_;
};

}  // namespace cutjoint
