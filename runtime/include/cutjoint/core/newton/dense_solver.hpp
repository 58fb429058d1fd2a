// Dense L U with partial pivoting, used if a fixed pivot order is unsafe.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>

#include "cutjoint/core/numbers/dense.hpp"
#include "cutjoint/core/newton/static_solver.hpp"
#include "cutjoint/core/newton/system.hpp"

namespace cutjoint {

/// Factors the tangents of a system as dense matrices.
template <class S>
class DenseSolver {
 public:
  using Real = typename S::real_type;

  static constexpr std::size_t rows = static_tangent<S>().rows;

  explicit DenseSolver(const S& system) : system_(system), order_(tangent_of(system).rows) {}

  /// Allocate memory unless it is inside the object: few runs need any.
  void prepare() {
    if constexpr (!Sized<S>) a_.resize(order_.size() * order_.size());
    x_ = Rows<S>(order_.size());
  }

  Breakdown factor(const Real* values) {
    fill(values);
    if (!triangles().decompose()) return {Breakdown::Kind::singular, -1};
    return {};
  }

  Breakdown solve(Real* x) {
    triangles().solve(x, x_.data());
    return {};
  }

  /// The smallest pivot, relative to the largest entry of its column.
  double smallest_pivot(const Real* values) const
    requires Sized<S>
  {
    std::array<int, rows> columns;
    for (std::size_t k = 0; k < rows; ++k) columns[k] = static_cast<int>(k);
    return share_of_columns<S>(values, [this](std::size_t k) { return static_cast<double>(a_[k * rows + k]); }, columns);
  }

 private:
  dense::Triangles<Real> triangles() { return {{a_.data(), order_.size(), order_.size()}, order_.data()}; }

  void fill(const Real* values) {
    const auto& pattern = pattern_of(system_);
    std::fill(a_.begin(), a_.end(), Real(0));
    for (std::size_t j = 0; j < order_.size(); ++j)
      for (auto i = static_cast<std::size_t>(pattern.first[j]); i < static_cast<std::size_t>(pattern.first[j + 1]); ++i)
        a_[j * order_.size() + static_cast<std::size_t>(pattern.row[i])] = values[i];
  }

  const S& system_;
  Array<S, rows * rows> a_;
  Array<S, rows, std::size_t> order_;
  Rows<S> x_;
};

}  // namespace cutjoint
