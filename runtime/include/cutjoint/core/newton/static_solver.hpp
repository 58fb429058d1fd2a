// The factorisation that was emitted with a system, with its static pivot order.
#pragma once

#include <type_traits>

#include "cutjoint/core/newton/system.hpp"

namespace cutjoint {

/// Why a matrix has no factors, and in which row of the pattern where that is known.
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

/// The solver of a system's tangents, by settings where it takes some.
template <class Solver, class S, class Settings>
Solver solver_for(const S& system, const Settings& settings) {
  if constexpr (std::is_constructible_v<Solver, const S&, const Settings&>) return Solver(system, settings);
  else return Solver(system);
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

  /// The next solutions follow from the matrix alone.
  struct Memory {};

  Memory memory() const { return {}; }
  void restore(const Memory&, const Real* values) { factor(values); }

 private:
  const S& system_;
  Factors<S> factors_;
};

}  // namespace cutjoint
