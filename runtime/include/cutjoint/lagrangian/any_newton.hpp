// Newton's iteration as the driver sees it: the methods of the core behind virtual functions, with failures that have names.
#pragma once

#include <memory>
#include <string_view>
#include <type_traits>

#include "cutjoint/core/newton/augmented.hpp"
#include "cutjoint/core/newton/recursive_newton.hpp"
#include "cutjoint/lagrangian/classical.hpp"
#include "cutjoint/lagrangian/dependence.hpp"
#include "cutjoint/lagrangian/solver.hpp"
#include "cutjoint/lagrangian/system.hpp"
#include "cutjoint/settings.hpp"
#include "cutjoint/state.hpp"

namespace cutjoint {

/// The settings of a run's steps.
inline NewtonSettings newton_settings(const RunSettings& settings) {
  const bool damped = settings.integrator == Integrator::generalised_alpha;
  return {.dt = settings.dt,
          .penalty = settings.penalty,
          .tolerance = settings.tolerance,
          .iterations = settings.iterations,
          .multiplier_updates = settings.multiplier_updates,
          .rule = damped ? generalised_alpha(*settings.spectral_radius) : StepRule{}};
}

/// The name of a method, as its failures have it.
constexpr std::string_view name_of(Lagrangian method) {
  switch (method) {
    case Lagrangian::augmented: return "augmented";
    case Lagrangian::classical: return "classical";
    case Lagrangian::recursive_newton: return "recursive-newton";
  }
  return "";
}

/// The integrator of a method over a system with a solver that is chosen when a run begins.
template <class S>
class AnyNewton {
 public:
  using Real = typename S::real_type;

  virtual ~AnyNewton() = default;

  virtual void begin(State<Real>& state, Real motion) = 0;  ///< as of Newton; throws Failure
  virtual void step(State<Real>& state, long number) = 0;   ///< the same
  virtual void go_on(State<Real>& state) = 0;               ///< the same
  virtual void take_over(const State<Real>& state) = 0;     ///< a state with accelerations and multipliers, from which the next step goes on
  virtual Weights<Real> step_weights() const = 0;
  virtual const Residuals& residuals() const = 0;
  virtual long iterations() const = 0;
  virtual long substeps() const = 0;
  virtual long evaluations() const = 0;
  virtual long factorisations() const = 0;
};

/// A method of the core, or the classical one.
template <class S, class Core>
class NewtonOf final : public AnyNewton<S> {
 public:
  using typename AnyNewton<S>::Real;

  NewtonOf(S& system, LinearSolver<Real>& solver, const NewtonSettings& settings) : d_(system.description()), core_(system, solver, settings) {}

  void begin(State<Real>& state, Real motion) override { require(core_.begin(state, motion)); }
  void step(State<Real>& state, long number) override { require(core_.step(state, number)); }
  void go_on(State<Real>& state) override { require(core_.go_on(state)); }
  void take_over(const State<Real>& state) override {
    core_.stay(state);
    core_.take_means(state.vdot);
  }
  Weights<Real> step_weights() const override { return core_.step_weights(); }
  const Residuals& residuals() const override { return core_.residuals(); }
  long iterations() const override { return core_.iterations(); }
  long substeps() const override { return core_.substeps(); }
  long evaluations() const override { return core_.evaluations(); }
  long factorisations() const override { return core_.factorisations(); }

 private:
  void require(const Fault& fault) const {
    if (!fault) return;
    const Failure failure = failure_of(fault, d_, name_of(d_.method));
    if constexpr (std::is_same_v<Core, ClassicalNewton<S>>) throw explain_classical(fault, failure);
    if (fault.cause == Cause::tangent_not_positive) throw explain_not_positive(d_, core_.tangent().data(), failure);
    throw failure;
  }

  Failure explain_classical(const Fault& fault, const Failure& failure) const {
    if (fault.cause == Cause::tangent_singular) return explain_singular(d_, core_.tangent().data(), failure);
    if (fault.cause != Cause::pose_singular) return failure;
    return Failure("classical: the pose is singular, or nearly: rates that satisfy the equations are a leap away", failure.time, failure.step,
                   failure.element, failure.residual, "not tried: another dt, or method augmented, which leaves such directions alone");
  }

  const SystemDescription& d_;
  Core core_;
};

/// The integrator of the method that a system was made for.
template <class S>
std::unique_ptr<AnyNewton<S>> make_newton(S& system, LinearSolver<typename S::real_type>& solver, const NewtonSettings& settings) {
  using Solver = LinearSolver<typename S::real_type>;
  switch (system.description().method) {
    case Lagrangian::augmented: return std::make_unique<NewtonOf<S, AugmentedNewton<S, Solver>>>(system, solver, settings);
    case Lagrangian::classical: return std::make_unique<NewtonOf<S, ClassicalNewton<S>>>(system, solver, settings);
    default: return std::make_unique<NewtonOf<S, RecursiveNewton<S, Solver>>>(system, solver, settings);
  }
}

}  // namespace cutjoint
