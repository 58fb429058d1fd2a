// A system with its tangent's factors and the arrays of a step: what Newton's iteration, the start and the projections work with.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "cutjoint/lagrangian/closing.hpp"
#include "cutjoint/core/largest.hpp"
#include "cutjoint/lagrangian/solver.hpp"
#include "cutjoint/lagrangian/system.hpp"
#include "cutjoint/core/retraction.hpp"
#include "cutjoint/state.hpp"

namespace cutjoint {

/// Evaluates, factors and solves, counts what it does, and throws Failure where a number is not one.
template <class S>
class Workspace {
 public:
  using Real = typename S::real_type;

  Workspace(S& system, LinearSolver<Real>& solver)
      : system_(system), solver_(solver), d_(system.description()), n_(d_.unknowns().size()), m_(d_.equations.size()), f_(n_), phi_(m_),
        phid_(m_), phidd_(m_), weight_(m_), lambda_(m_), x_(static_cast<std::size_t>(d_.pattern.size)), tangent_(d_.pattern.row.size()) {}

  Workspace(const Workspace&) = delete;
  Workspace& operator=(const Workspace&) = delete;
  virtual ~Workspace() = default;

  long evaluations() const { return evaluations_; }
  long factorisations() const { return factorisations_; }

 protected:
  virtual const char* name() const = 0;

  /// Throw the Failure of a matrix without factors.
  [[noreturn]] virtual void report_breakdown(Breakdown broken) = 0;

  void linearise(const State<Real>& state, Real penalty, const Weights<Real>& weights) {
    ++evaluations_;
    system_.linearise(state.q.data(), state.v.data(), state.vdot.data(), lambda_.data(), penalty, weights, f_.data(), phi_.data(),
                      tangent_.data());
  }

  void dynamic_residual(const State<Real>& state, Real penalty) {
    ++evaluations_;
    system_.dynamic_residual(state.q.data(), state.v.data(), state.vdot.data(), lambda_.data(), penalty, f_.data(), phi_.data());
  }

  void constraint_residual(const State<Real>& state) {
    system_.constraint_residual(state.q.data(), state.v.data(), state.vdot.data(), phi_.data(), phid_.data(), phidd_.data());
  }

  void factor() {
    require_finite();
    ++factorisations_;
    if (const Breakdown broken = solver_.factor(tangent_.data())) report_breakdown(broken);
  }

  void solve() {
    if (const Breakdown broken = solver_.solve(x_.data())) report_breakdown(broken);
  }

  /// way = A^-1 Phi_q^T w and closing = Phi_q way, the first Phi_q that of a pose, with the factors of A.
  void follow_weight(const std::vector<Real>& pose, const State<Real>& state, const std::vector<Real>& w, std::span<Real> way,
                     std::span<Real> closing) {
    system_.apply_jacobian_transposed(pose.data(), w.data(), x_.data());
    solve();
    std::copy_n(x_.begin(), n_, way.begin());
    system_.apply_jacobian(state.q.data(), way.data(), closing.data());
  }

  /// Close the loops of a state, positions first, then speeds, with the factors of a tangent that belongs to a pose and has the weight `constraint`
  /// of the equations; `way` and `from` are room for speeds and coordinates.  Returns what is left.
  Residuals close_with(State<Real>& state, const std::vector<Real>& pose, Real constraint, Closing<Real>& closing, std::vector<Real>& way,
                       std::vector<Real>& from) {
    const auto bring = [&](std::vector<Real>& values, std::vector<Real>& gap, Real negligible) {
      closing.close(values, gap, constraint, negligible,
                    [&](const auto& weight, auto along, auto closed) { follow_weight(pose, state, weight, along, closed); });
    };
    for (int round = 0;; ++round) {
      constraint_residual(state);
      const Real rounding = rounding_like(1e-13) * (Real(1) + largest(state.q));
      if (!(largest(phi_) > rounding) || round == 4) break;
      std::fill(way.begin(), way.end(), Real(0));
      bring(way, phi_, rounding);
      from = state.q;
      retract<Real>(d_.charts, from.data(), way.data(), state.q.data());
    }
    bring(state.v, phid_, rounding_like(1e-12) * (Real(1) + largest(state.v)));
    constraint_residual(state);
    return {static_cast<double>(largest(phi_)), static_cast<double>(largest(phid_)), 0.0};
  }

  [[noreturn]] void fail(const std::string& what, std::string_view element, Real residual, const std::string& advice) const {
    throw Failure(std::string(name()) + ": " + what, static_cast<double>(time_), number_, std::string(element),
                  static_cast<double>(residual), advice);
  }

  /// Throws Failure where the residual or the tangent has an entry that is no number.
  void require_finite() const {
    for (std::size_t i = 0; i < n_; ++i)
      if (!finite(f_[i])) fail("the equations of motion have no finite value", d_.unknowns()[i], f_[i], advice_finite());
    bool all = true;
    for (const Real value : tangent_) all &= value - value == Real(0);  // without branches, since this is asked of every tangent
    if (all) return;
    for (std::size_t i = 0; i < tangent_.size(); ++i)
      if (!finite(tangent_[i])) {
        const auto row = static_cast<std::size_t>(d_.pattern.row[i]);
        fail("the tangent has no finite value", row < n_ ? d_.unknowns()[row] : d_.equations[row - n_], tangent_[i], advice_finite());
      }
  }

  /// Laws with a domain are named where they leave it: what is left is another cause.
  static const char* advice_finite() { return "values may have grown without bound; not tried: a smaller dt"; }

  /// What a share of a quantity that is rounding in double is in this type.
  static Real rounding_like(double in_double) {
    return Real(in_double / std::numeric_limits<double>::epsilon()) * std::numeric_limits<Real>::epsilon();
  }

  static bool finite(Real value) { return std::isfinite(static_cast<double>(value)); }

  S& system_;
  LinearSolver<Real>& solver_;
  const SystemDescription& d_;
  std::size_t n_, m_;                                  ///< unknowns and equations
  std::vector<Real> f_, phi_, phid_, phidd_, weight_;  ///< force residual, equations and their rates, and room for what pulls on the equations
  std::vector<Real> lambda_;
  std::vector<Real> x_, tangent_;  ///< right-hand side and then solution, and the matrix
  Real time_{0};
  long number_ = 0;  ///< of the step, for messages

 private:
  long evaluations_ = 0, factorisations_ = 0;
};

}  // namespace cutjoint
