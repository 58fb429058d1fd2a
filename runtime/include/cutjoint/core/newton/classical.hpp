// The index-3 classical Lagrangian method with projections (Cuadrado et al. 2000, section 2.2).
#pragma once

#include "cutjoint/core/newton/guarded_solver.hpp"
#include "cutjoint/core/stepping/newton_steps.hpp"

namespace cutjoint {

/// M vdot + Phi_q^T lambda = Q and Phi = 0 with the unknowns (q, lambda) and, with A = M + dt/2 C + dt^2/4 K, the tangent
///
///     f_x = [ A, dt^2/4 Phi_q^T ; dt^2/4 Phi_q, 0 ]                                                               [eq. 20]
///
/// which is regular only where no equation depends on the others.
template <class S, class Solver>
class ClassicalNewton final : public Newton<ClassicalNewton<S, Solver>, S, Solver> {
 public:
  using Base = Newton<ClassicalNewton, S, Solver>;
  using typename Base::Real;

  ClassicalNewton(S& system, Solver& solver, const NewtonSettings& settings)
      : Base(system, solver, settings), scaled_(system), probe_(x_.size()) {}

  /// Close the loops of a state away from any step, by moving the masses least.  A fault names the equation that stays open.
  Fault assemble(StateOf<S>& state) {
    if (m_ == 0) return {};
    constexpr int most = 20;
    this->get_ready(state, Real(1));
    choose_weights(state);
    this->constraint_residual(state);
    for (int round = 0; round < most; ++round) {
      this->linearise(state, Real(0), start_weights());
      if (const Fault fault = this->factor()) return fault;
      if (const Fault fault = close(phi_, state.q)) return fault;
      this->constraint_residual(state);
      if (const Fault fault = close(this->phid_, state.v)) return fault;
      this->constraint_residual(state);
      if (this->is_closed(state)) return {};
    }
    const bool open = largest(phi_) > largest(this->phid_);
    const Equations<S>& violation = open ? phi_ : this->phid_;
    const std::size_t worst = index_of_largest(violation, m_);
    return this->fault_in_equation(open ? Cause::loops_not_closed : Cause::speeds_not_found, worst, violation[worst]);
  }

  /// Memory of the next steps, besides the state and the factors of the last tangent.
  struct Memory {
    typename Base::Memory steps;
    Real mass;
  };

  Memory memory() const { return {Base::memory(), mass_}; }

  void restore(const Memory& memory) {
    mass_ = memory.mass;
    Base::restore(memory.steps);
  }

 private:
  friend Base;
  using Base::f_, Base::k_, Base::lambda_, Base::m_, Base::n_, Base::phi_, Base::phidd_, Base::solver_, Base::speed_, Base::tangent_,
      Base::passes, Base::x_;

  Weights<Real> weights() const { return {speed_, k_, k_ * mass_}; }
  Weights<Real> start_weights() const { return {Real(0), Real(0), mass_}; }

  /// Of a mechanism far from a metre, whose masses are far from a kilogram, equations weigh as the heaviest coordinate: beside them no mass is rounding.
  void choose_weights(const StateOf<S>& state) {
    if (this->arm_ != Real(1)) mass_ = this->heaviest(state, nullptr);
  }

  /// [M, Phi_q^T; Phi_q, 0] (dvdot; dlambda) = -(M vdot + Phi_q^T lambda - Q; Phidd)
  void right_of_start(const StateOf<S>&, Real weight) {
    for (std::size_t i = 0; i < n_; ++i) x_[i] = -f_[i];
    for (std::size_t i = 0; i < m_; ++i) x_[n_ + i] = -weight * phidd_[i];
  }

  /// f_x (dq; dlambda) = -dt^2/4 (M vdot + Phi_q^T lambda - Q; Phi)                                          [eqs. 18-20]
  void approach(const StateOf<S>& state, int, bool) {
    this->linearise(state, Real(0), weights());
    for (std::size_t i = 0; i < n_; ++i) x_[i] = -k_ * f_[i];
    for (std::size_t i = 0; i < m_; ++i) x_[n_ + i] = -k_ * mass_ * phi_[i];
  }

  void take_multipliers(Real weight) {
    for (std::size_t i = 0; i < m_; ++i) lambda_[i] += weight * x_[n_ + i];
  }

  Fault update_multipliers(StateOf<S>& state) {
    state.lambda = lambda_;
    return {};
  }

  /// f_x (dv; .) = (0; -dt^2/4 Phid), and the same of accelerations with Phidd [eqs. 21-22].  Twice or more, since the matrix is that of
  /// the last iteration, whose pose differs from the final one.
  Fault project_on(const StateOf<S>& state, Speeds<S>& values, Equations<S>& violation) {
    Real last = std::numeric_limits<Real>::infinity();
    for (std::size_t pass = 0; pass < passes; ++pass) {
      const Real size = largest(violation);
      if (size <= this->negligible(this->size_of(state, values)) || !(size <= last / 2)) break;
      last = size;
      std::fill_n(x_.begin(), n_, Real(0));
      for (std::size_t i = 0; i < m_; ++i) x_[n_ + i] = -k_ * mass_ * violation[i];
      if (const Fault fault = this->solve()) return fault;
      if (const Fault fault = require_small(values)) return fault;
      for (std::size_t i = 0; i < n_; ++i) values[i] += x_[i];
      this->constraint_residual(state);
    }
    return {};
  }

  /// A fault if a projection changes values strongly: an equation is nearly dependent, and the state would silently switch branch.
  Fault require_small(const Speeds<S>& values) const {
    using std::abs;
    const std::size_t worst = index_of_largest(x_, n_);
    if (abs(x_[worst]) <= Real(10) * (Real(1) + largest(values))) return {};
    return this->fault_in_row(Cause::pose_singular, static_cast<int>(worst), x_[worst]);
  }

  /// [M, Phi_q^T; Phi_q, 0] (change; .) = (0; -violation)
  Fault close(const Equations<S>& violation, auto& values) {
    std::fill_n(x_.begin(), n_, Real(0));
    for (std::size_t i = 0; i < m_; ++i) x_[n_ + i] = -mass_ * violation[i];
    if (const Fault fault = this->solve()) return fault;
    for (std::size_t i = 0; i < values.size(); ++i) values[i] += x_[i];
    return {};
  }

  Fault examine() { return explain({}); }

  Fault explain(const Fault& fault) { return is_singular() ? this->fault_in_row(Cause::tangent_singular, -1, Real(0)) : fault; }

  /// True if the factored matrix amplifies a right-hand side of the size of its rows beyond the number's precision.  Pivots of a singular
  /// matrix are rounding, hardly ever exactly zero.
  bool is_singular() {
    scaled_.measure(tangent_.data());
    scaled_.probe(probe_.data());
    if (solver_.solve(probe_.data())) return true;
    return !(scaled_.size(probe_.data()) <= Real(1e-3) / std::numeric_limits<Real>::epsilon());
  }

  Real mass_{1};
  Scaled<S> scaled_;
  Rows<S> probe_;
};

/// Steps of a simulation over a system in natural coordinates with its multipliers.
template <class M, class S>
using ClassicalSteps = NewtonSteps<M, S, ClassicalNewton<S, GuardedSolver<S, DenseSolver<S>>>, GuardedSolver<S, DenseSolver<S>>>;

}  // namespace cutjoint
