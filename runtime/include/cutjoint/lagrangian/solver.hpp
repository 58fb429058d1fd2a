// Linear solvers for tangents of one pattern: analyse once, factor often, solve in place.
#pragma once

#include <memory>

#include "cutjoint/core/newton/newton.hpp"
#include "cutjoint/lagrangian/any_system.hpp"
#include "cutjoint/settings.hpp"

namespace cutjoint {

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

  /// The number of factorisations with pivoting instead of a fixed order.
  virtual long fallbacks() const { return 0; }
};

/// A solver that an extension builds into a program: its name, whether it needs a symmetric matrix, and its factory.
template <class Real>
struct SolverKind {
  std::string_view name;
  bool symmetric;
  std::unique_ptr<LinearSolver<Real>> (*make)();
};

template <class Solver, class Real>
std::unique_ptr<LinearSolver<Real>> make_solver() { return std::make_unique<Solver>(); }

/// The library solvers of this program.
template <class Real>
std::vector<SolverKind<Real>>& library_solvers() {
  static std::vector<SolverKind<Real>> all;
  return all;
}

/// The settings of a simulation whose solver is chosen by name.
struct ChosenSettings : SimulationSettings {
  explicit ChosenSettings(const RunSettings& settings)
      : SimulationSettings(simulation_settings(settings)), solver(*settings.solver) {}

  std::string solver;
};

/// The solver selected by a run.
template <class S>
class ChosenSolver {
 public:
  using Real = typename S::real_type;
  using Settings = ChosenSettings;

  ChosenSolver(const S& system, const Settings& settings);  ///< in choose_solver.hpp, which knows all solvers

  Breakdown factor(const Real* values) { return solver_->factor(values); }
  Breakdown solve(Real* x) { return solver_->solve(x); }
  long fallbacks() const { return solver_->fallbacks(); }

  LinearSolver<Real>& chosen() { return *solver_; }

 private:
  std::unique_ptr<LinearSolver<Real>> solver_;
};

/// A solver of the core (newton/static_solver.hpp, newton/guarded_solver.hpp), which knows its system's pattern.
template <class Core>
class CoreSolver final : public LinearSolver<typename Core::Real> {
 public:
  using Real = typename Core::Real;

  explicit CoreSolver(const auto& system) : core_(system) {}

  void analyse(const Pattern&) override {}
  Breakdown factor(const Real* values) override { return core_.factor(values); }
  Breakdown solve(Real* x) override { return core_.solve(x); }

  long fallbacks() const override {
    if constexpr (requires { core_.fallbacks(); }) return core_.fallbacks();
    return 0;
  }

 private:
  Core core_;
};

}  // namespace cutjoint
