// A system with a tangent as the runtime sees it: the contract between generated code (or the generic solver) and the Lagrangian integrators.
#pragma once

#include "cutjoint/any_mechanism.hpp"

namespace cutjoint {

/// A system M qdd + Phi_q^T lambda = Q(q, qd, t), Phi(q, t) = 0; in natural coordinates M is constant.  v and vdot have n elements, and q in
/// natural coordinates, lambda, residuals and multiplier-like arrays m; all arrays belong to the caller and nothing allocates.
///
/// - `load` computes what depends on parameters alone, `begin_step` what depends on time and on inputs (`motion` and `drive_by` as in `Mechanism`),
/// - `initial_coordinates` finds natural coordinates and their rates from relative coordinates and speeds (those of the mechanism that starts the run),
/// - `dynamic_residual` is M vdot + Phi_q^T (penalty Phi + lambda) - Q, with Phi as `residual`,
/// - `linearise` is the same and the values of the tangent's entries,
/// - `constraint_residual` is Phi, Phid = Phi_q v + Phi_t and Phidd = Phi_q vdot + (d/dt Phi_q) v + (d/dt Phi_t),
/// - `apply_jacobian_transposed` is Phi_q^T w, `apply_jacobian` Phi_q x,
/// - `report` is the columns, `energy` kinetic energy and power, `guard` and `sample` as in `Mechanism`, `events` the values of the indicators,
/// - `factor` is the emitted factorisation with its static pivot order: L D L^T (augmented) or L U (classical); it returns -1, or the row
///   of the pattern whose pivot is not positive (augmented) or not finite or zero (classical),
/// - `solve` replaces the right-hand side x by the solution.
template <class Real>
class AnySystem : public AnySubject<Real, SystemDescription> {
 public:
  virtual void load(const Real* parameters, const Road<Real>* roads) = 0;
  virtual void initial_coordinates(const Real* relative_q, const Real* relative_v, Real* q, Real* v) const = 0;
  virtual void dynamic_residual(const Real* q, const Real* v, const Real* vdot, const Real* lambda, Real penalty, Real* force_residual,
                       Real* residual) const = 0;
  virtual void linearise(const Real* q, const Real* v, const Real* vdot, const Real* lambda, Real penalty, const Weights<Real>& weights,
                         Real* force_residual, Real* residual, Real* tangent) const = 0;
  virtual void constraint_residual(const Real* q, const Real* v, const Real* vdot, Real* residual, Real* rate, Real* curvature) const = 0;
  virtual void apply_jacobian_transposed(const Real* q, const Real* w, Real* force) const = 0;
  virtual void apply_jacobian(const Real* q, const Real* x, Real* change) const = 0;
  virtual void energy(const Real*, const Real*, const Real*, const Real*, Real*) const { throw_no_energy(); }  ///< of q, v, vdot, lambda
  virtual int factor(const Real* tangent, Real* factors) const = 0;
  virtual void solve(const Real* factors, Real* x) const = 0;
};

}  // namespace cutjoint
