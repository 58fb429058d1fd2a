// The index-3 classical Lagrangian method with projections (Cuadrado et al. 2000, section 2.2).
#pragma once

#include <limits>
#include <string>
#include <vector>

#include "cutjoint/lagrangian/dependence.hpp"
#include "cutjoint/lagrangian/matrix.hpp"
#include "cutjoint/lagrangian/newton.hpp"

namespace cutjoint {

/// M vdot + Phi_q^T lambda = Q and Phi = 0 with the unknowns (q, lambda) and, with A = M + dt/2 C + dt^2/4 K, the tangent
///
///     f_x = [ A, dt^2/4 Phi_q^T ; dt^2/4 Phi_q, 0 ]                                                               [eq. 20]
///
/// which is regular only where no equation depends on the others.
template <class S>
class ClassicalNewton final : public Newton<S> {
 public:
  using Base = Newton<S>;
  using typename Base::Real;

  ClassicalNewton(S& system, LinearSolver<Real>& solver, const NewtonSettings& settings)
      : Base(system, solver, settings), scaled_(d_.pattern), probe_(x_.size()) {}

 private:
  using Base::d_, Base::f_, Base::k_, Base::lambda_, Base::m_, Base::n_, Base::phi_, Base::phidd_, Base::solver_, Base::speed_, Base::tangent_,
      Base::passes, Base::x_;

  const char* name() const override { return "classical"; }
  Weights<Real> weights() const override { return {speed_, k_, k_}; }
  Weights<Real> start_weights() const override { return {Real(0), Real(0), Real(1)}; }

  /// [M, Phi_q^T; Phi_q, 0] (dvdot; dlambda) = -(M vdot + Phi_q^T lambda - Q; Phidd)
  void right_of_start(const State<Real>&) override {
    for (std::size_t i = 0; i < n_; ++i) x_[i] = -f_[i];
    for (std::size_t i = 0; i < m_; ++i) x_[n_ + i] = -phidd_[i];
  }

  /// f_x (dq; dlambda) = -dt^2/4 (M vdot + Phi_q^T lambda - Q; Phi)                                          [eqs. 18-20]
  void approach(const State<Real>& state, int, bool) override {
    this->linearise(state, Real(0), weights());
    for (std::size_t i = 0; i < n_; ++i) x_[i] = -k_ * f_[i];
    for (std::size_t i = 0; i < m_; ++i) x_[n_ + i] = -k_ * phi_[i];
  }

  void take_multipliers() override {
    for (std::size_t i = 0; i < m_; ++i) lambda_[i] += x_[n_ + i];
  }

  void update_multipliers(State<Real>& state) override { state.lambda = lambda_; }

  /// f_x (dv; .) = (0; -dt^2/4 Phid), and the same of accelerations with Phidd [eqs. 21-22].  Twice or more, since the matrix is that of
  /// the last iteration, whose pose differs from the final one.
  void project_on(const State<Real>& state, std::vector<Real>& values, std::vector<Real>& gap) override {
    Real last = std::numeric_limits<Real>::infinity();
    for (std::size_t pass = 0; pass < passes; ++pass) {
      const Real size = largest(gap);
      if (size <= this->rounding(values) || !(size <= last / 2)) break;
      last = size;
      std::fill_n(x_.begin(), n_, Real(0));
      for (std::size_t i = 0; i < m_; ++i) x_[n_ + i] = -k_ * gap[i];
      this->solve();
      require_small(values);
      for (std::size_t i = 0; i < n_; ++i) values[i] += x_[i];
      this->constraint_residual(state);
    }
  }

  /// Throws Failure where a projection changes values by a leap: one equation nearly depends on others, and the state would land on
  /// another branch without a word.
  void require_small(const std::vector<Real>& values) const {
    using std::abs;
    std::size_t worst = 0;
    for (std::size_t i = 0; i < n_; ++i)
      if (abs(x_[i]) > abs(x_[worst]) || x_[i] != x_[i]) worst = i;
    if (!(abs(x_[worst]) <= Real(10) * (Real(1) + largest(values))))
      this->fail("the pose is singular, or nearly: rates that satisfy the equations are a leap away", d_.coordinates[worst], x_[worst],
                 "not tried: another dt, or method augmented, which leaves such directions alone");
  }

  void examine() override {
    if (is_singular()) report_singular(-1);
  }

  void explain() override {
    if (is_singular()) report_singular(-1);
  }

  /// Whether the factored matrix blows a right-hand side of the size of its rows up beyond what numbers can resolve.  Pivots of a singular
  /// matrix are rounding, hardly ever zero, so that its factors and solutions look as good as any.
  bool is_singular() {
    scaled_.measure(tangent_.data());
    scaled_.probe(probe_.data());
    if (solver_.solve(probe_.data())) return true;
    return !(scaled_.size(probe_.data()) <= Real(1e-3) / std::numeric_limits<Real>::epsilon());
  }

  [[noreturn]] void report_breakdown(Breakdown broken) override { report_singular(broken.row); }

  [[noreturn]] void report_singular(int row) {
    const Dependence found = find_dependence(transposed_jacobian(d_, tangent_.data()));
    if (!found.dependent.empty()) report_dependence(found);
    const int coordinate = unresisted_coordinate(d_, tangent_.data());
    if (coordinate >= 0)
      this->fail("the tangent is singular", d_.coordinates[static_cast<std::size_t>(coordinate)], Real(0),
                 "this coordinate can move without moving mass or meeting an equation: give it mass or hold it");
    const auto named = static_cast<std::size_t>(row);
    this->fail("the tangent is singular", row < 0 ? "" : named < n_ ? d_.coordinates[named] : d_.equations[named - n_], Real(0),
               "not tried: another dt, or method augmented, whose tangent stays regular");
  }

  [[noreturn]] void report_dependence(const Dependence& found) const {
    const bool one = found.dependent.size() == 1;
    const std::string names = listed(found.dependent, d_.equations), others = listed(found.on, d_.equations);
    this->fail("the tangent is singular", d_.equations[static_cast<std::size_t>(found.dependent.front())], Real(0),
               (one ? "equation " : "the equations ") + names + (one ? " depends" : " depend") +
                   (others.empty() ? " on no coordinate" : " on ") + others +
                   " here; not tried: method augmented, which tolerates redundant and momentarily dependent equations");
  }

  Scaled<Real> scaled_;
  std::vector<Real> probe_;
};

}  // namespace cutjoint
