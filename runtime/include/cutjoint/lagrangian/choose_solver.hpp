// Selection of the linear solver by name.
#pragma once

#include <stdexcept>

#include "cutjoint/core/newton/guarded_solver.hpp"
#include "cutjoint/lagrangian/eigen_sparse.hpp"

namespace cutjoint {

/// A system with an emitted factorisation.
template <class S>
concept Factored = requires(const S& system, const typename S::real_type* in, typename S::real_type* out) {
  { system.factor(in, out) } -> std::convertible_to<int>;
  system.solve(in, out);
};

/// Eigen's sparse pivoting for the classical method, whose matrices are large and often need it.
template <class S>
class SparsePivoting {
 public:
  using Real = typename S::real_type;

  explicit SparsePivoting(const S& system) : pattern_(system.description().pattern) {}

  void prepare() {
    sparse_.lay_out(pattern_);
    sparse_.solver.analyzePattern(sparse_.matrix());
  }

  Breakdown factor(const Real* values) {
    sparse_.solver.factorize(sparse_.with(values));
    return sparse_.solver.info() == Eigen::Success ? Breakdown{} : Breakdown{Breakdown::Kind::singular, -1};
  }

  Breakdown solve(Real* x) { return sparse_.solve(x); }

 private:
  const Pattern& pattern_;
  EigenSparse<Real, SparseLu> sparse_;
};

/// The emitted factorisation; checked if the matrix is not symmetric, since any pivot order is safe only for a positive definite one.
template <class S>
std::unique_ptr<LinearSolver<typename S::real_type>> emitted_solver(const S& system) {
  if (system.description().pattern.symmetric) return std::make_unique<CoreSolver<StaticSolver<S>>>(system);
  if (system.description().method == Lagrangian::classical) return std::make_unique<CoreSolver<GuardedSolver<S, SparsePivoting<S>>>>(system);
  return std::make_unique<CoreSolver<GuardedSolver<S, DenseSolver<S>>>>(system);
}

/// The names of the solvers suitable for a matrix, joined for a message.
template <class Real>
std::string solver_names(bool emitted, bool symmetric) {
  std::string names = emitted ? "emitted" : "";
  for (const SolverKind<Real>& kind : library_solvers<Real>())
    if (symmetric || !kind.symmetric) names.append(names.empty() ? "" : ", ").append(kind.name);
  return names;
}

/// The solver of that name, with the system's pattern analysed.  Throws runtime_error for a name that is not built in or not suitable.
template <class S>
std::unique_ptr<LinearSolver<typename S::real_type>> choose_solver(const S& system, std::string_view name) {
  using Real = typename S::real_type;
  const Pattern& pattern = system.description().pattern;
  std::unique_ptr<LinearSolver<Real>> solver;
  if constexpr (Factored<S>)
    if (name == "emitted") solver = emitted_solver(system);
  for (const SolverKind<Real>& kind : library_solvers<Real>()) {
    if (kind.name != name) continue;
    if (kind.symmetric && !pattern.symmetric)
      throw std::runtime_error("solver '" + std::string(name) +
                               "' factors symmetric matrices, and that of the classical method is not; use " +
                               solver_names<Real>(Factored<S>, false));
    solver = kind.make();
  }
  if (!solver)
    throw std::runtime_error("no solver '" + std::string(name) + "' in this simulator, which has " +
                             solver_names<Real>(Factored<S>, pattern.symmetric) +
                             "; one of another package needs a simulator that is compiled with it");
  solver->analyse(pattern);
  return solver;
}

template <class S>
ChosenSolver<S>::ChosenSolver(const S& system, const ChosenSettings& settings) : solver_(choose_solver(system, settings.solver)) {}

}  // namespace cutjoint
