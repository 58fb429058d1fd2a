// A system in natural coordinates as an ordinary differential equation.
#pragma once

#include <string>
#include <vector>

#include "cutjoint/core/newton/workspace.hpp"
#include "cutjoint/lagrangian/solver.hpp"
#include "cutjoint/state.hpp"

namespace cutjoint::reference {

/// y = (q, v).  Accelerations solve [M, Phi_q^T; Phi_q, 0]; after each step coordinates and rates are brought back to the equations by
/// the shortest way in the norm of the masses.  The system is one of the classical method, whose equations do not depend on each other.
template <class S>
class Natural : public Workspace<S, LinearSolver<typename S::real_type>> {
  using Base = Workspace<S, LinearSolver<typename S::real_type>>;

 public:
  using typename Base::Real;

  Natural(S& system, LinearSolver<Real>& solver) : Base(system, solver), d_(system.description()), state_(n_, n_, m_) {}

  std::size_t size() const { return 2 * n_; }
  std::string name(std::size_t i) const { return (i < n_ ? "" : "rate of ") + std::string(d_.coordinates[i % n_]); }

  /// Take over a start.
  std::vector<Real> begin(const State<Real>& start) {
    std::vector<Real> y(start.q);
    y.insert(y.end(), start.v.begin(), start.v.end());
    project(start.t, y);
    return y;
  }

  void derive(Real t, const std::vector<Real>& y, std::vector<Real>& slope) {
    take(t, y);
    accelerate();
    std::copy(state_.v.begin(), state_.v.end(), slope.begin());
    std::copy(state_.vdot.begin(), state_.vdot.end(), slope.begin() + static_cast<std::ptrdiff_t>(n_));
  }

  /// Back to Phi = 0 and Phid = 0.
  void project(Real t, std::vector<Real>& y) {
    if (m_ == 0) return;
    for (int pass = 0; pass < 3; ++pass) {
      take(t, y);
      factor_masses();
      this->constraint_residual(state_);
      correct(phi_, y.data());
    }
    take(t, y);
    this->constraint_residual(state_);
    correct(phid_, y.data() + n_);
  }

  /// The state with its accelerations and multipliers.
  const State<Real>& complete(Real t, const std::vector<Real>& y) {
    take(t, y);
    accelerate();
    state_.lambda = lambda_;
    return state_;
  }

 private:
  using Base::f_, Base::lambda_, Base::m_, Base::n_, Base::phi_, Base::phid_, Base::phidd_, Base::system_, Base::time_, Base::x_;

  /// Throws the Failure of a fault.
  void require(const Fault& fault) const {
    if (!fault) return;
    const Failure failure = failure_of(fault, d_, "reference");
    if (fault.cause != Cause::tangent_singular) throw failure;
    throw Failure("reference: masses and equations do not determine the accelerations", failure.time, failure.step, failure.element, failure.residual,
                  "look for a singular pose");
  }

  void take(Real t, const std::vector<Real>& y) {
    state_.t = time_ = t;
    std::copy_n(y.begin(), n_, state_.q.begin());
    std::copy_n(y.begin() + static_cast<std::ptrdiff_t>(n_), n_, state_.v.begin());
    std::fill(state_.vdot.begin(), state_.vdot.end(), Real(0));
    std::fill(lambda_.begin(), lambda_.end(), Real(0));
    system_.begin_step(t, Real(1));
  }

  void factor_masses() {
    this->linearise(state_, Real(0), {.damping = Real(0), .stiffness = Real(0), .constraint = Real(1)});
    require(this->factor());
  }

  void accelerate() {
    factor_masses();
    this->constraint_residual(state_);
    for (std::size_t i = 0; i < n_; ++i) x_[i] = -f_[i];
    for (std::size_t i = 0; i < m_; ++i) x_[n_ + i] = -phidd_[i];
    require(this->solve());
    std::copy_n(x_.begin(), n_, state_.vdot.begin());
    std::copy_n(x_.begin() + static_cast<std::ptrdiff_t>(n_), m_, lambda_.begin());
  }

  /// Change n values by the shortest way that closes a gap of the equations.
  void correct(const std::vector<Real>& gap, Real* values) {
    std::fill_n(x_.begin(), n_, Real(0));
    for (std::size_t i = 0; i < m_; ++i) x_[n_ + i] = -gap[i];
    require(this->solve());
    for (std::size_t i = 0; i < n_; ++i) values[i] += x_[i];
  }

  const SystemDescription& d_;
  StateOf<S> state_;
};

}  // namespace cutjoint::reference
