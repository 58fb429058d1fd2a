// Linear solvers for tangents of one pattern: analyse once, factor often, solve in place.
#pragma once

#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "cutjoint/lagrangian/system.hpp"

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

/// A direct solver.  `analyse` may take its time and memory; `factor` and `solve` allocate nothing on this side of a library.
template <class Real>
class LinearSolver {
 public:
  virtual ~LinearSolver() = default;

  /// Prepare for matrices of a pattern, which must outlive the solver.
  virtual void analyse(const Pattern& pattern) = 0;

  /// Factor the matrix with these values in the order of the pattern; they must stay until the last solve.
  virtual Breakdown factor(const Real* values) = 0;

  /// Replace the right-hand side x by the solution.
  virtual Breakdown solve(Real* x) = 0;

  /// How often a fixed pivot order had to give way to pivoting.
  virtual long fallbacks() const { return 0; }
};

/// A solver that a program was built with: its name, whether it needs a symmetric matrix, and how to make one.
template <class Real>
struct SolverKind {
  std::string_view name;
  bool symmetric;
  std::unique_ptr<LinearSolver<Real>> (*make)();
};

template <class Solver, class Real>
std::unique_ptr<LinearSolver<Real>> make_solver() {
  return std::make_unique<Solver>();
}

/// The library solvers of this program.  Each driver library defines it for its number type: the plain one those of Eigen, the one for
/// comparisons more.
template <class Real>
std::span<const SolverKind<Real>> library_solvers();

/// The factorisation that was emitted with the system, with its static pivot order.
template <class S>
class EmittedSolver final : public LinearSolver<typename S::real_type> {
 public:
  using Real = typename S::real_type;

  explicit EmittedSolver(const S& system) : system_(system) {}

  void analyse(const Pattern& pattern) override {
    kind_ = pattern.symmetric ? Breakdown::Kind::not_positive : Breakdown::Kind::singular;
    factors_.resize(static_cast<std::size_t>(system_.description().factors));
  }

  Breakdown factor(const Real* values) override {
    const int row = system_.factor(values, factors_.data());
    return row < 0 ? Breakdown{} : Breakdown{kind_, row};
  }

  Breakdown solve(Real* x) override {
    system_.solve(factors_.data(), x);
    return {};
  }

 private:
  const S& system_;
  Breakdown::Kind kind_ = Breakdown::Kind::singular;
  std::vector<Real> factors_;
};

}  // namespace cutjoint
