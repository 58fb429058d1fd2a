// The emitted factorisation of a system with its static pivot order.
#pragma once

#include <cmath>
#include <iterator>
#include <limits>

#include "cutjoint/core/newton/system.hpp"

namespace cutjoint {

/// The reason why a matrix has no factors, and the row of the pattern if known.
struct Breakdown {
  enum class Kind {
    none,
    not_positive,  ///< a pivot of L D L^T is not positive
    singular,      ///< no usable pivot is left
  };

  Kind kind = Kind::none;
  int row = -1;

  explicit operator bool() const { return kind != Kind::none; }
};

/// The solver of a system's tangents, with settings if it takes some.
template <class Solver, class S, class Settings>
Solver solver_for(const S& system, const Settings& settings) {
  if constexpr (std::is_constructible_v<Solver, const S&, const Settings&>) return Solver(system, settings);
  else return Solver(system);
}

/// The smallest pivot relative to the largest entry of its column; `pivot_of(k)` is one, in the column `columns[k]` of the values.
template <class S, class PivotOf, class Columns>
double share_of_columns(const auto* values, PivotOf pivot_of, const Columns& columns) {
  double smallest = std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < std::size(columns); ++k) {
    const auto column = static_cast<std::size_t>(columns[k]);
    double largest = 0.0;
    for (int i = S::pattern.first[column]; i < S::pattern.first[column + 1]; ++i) largest = std::max(largest, std::abs(static_cast<double>(values[i])));
    smallest = std::min(smallest, std::abs(pivot_of(k)) / largest);
  }
  return smallest;
}

/// Factors the tangents of a system by its own `factor` and `solve`; all memory is taken in the constructor.
template <class S>
class StaticSolver {
 public:
  using Real = typename S::real_type;

  explicit StaticSolver(const S& system) : system_(system), factors_(tangent_of(system).factors) {}

  Breakdown factor(const Real* values) {
    const int row = system_.factor(values, factors_.data());
    if (row < 0) return {};
    return {pattern_of(system_).symmetric ? Breakdown::Kind::not_positive : Breakdown::Kind::singular, row};
  }

  Breakdown solve(Real* x) {
    system_.solve(factors_.data(), x);
    return {};
  }

  /// The smallest pivot of the last factors, relative to the largest entry of its column; infinity before there are any.
  double smallest_pivot(const auto* values) const requires requires { S::pivot_columns; } {
    return share_of_columns<S>(values, [this](std::size_t k) { return 1.0 / static_cast<double>(factors_[k]); }, S::pivot_columns);
  }

  /// No memory: solutions depend on the matrix alone.
  struct Memory {};

  Memory memory() const { return {}; }
  void restore(const Memory&, const Real* values) { factor(values); }

 private:
  const S& system_;
  Factors<S> factors_;
};

}  // namespace cutjoint
