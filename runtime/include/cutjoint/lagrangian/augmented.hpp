// The index-3 augmented Lagrangian method with mass-orthogonal projections (Cuadrado et al. 2000, section 2.1).
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "cutjoint/lagrangian/closing.hpp"
#include "cutjoint/lagrangian/newton.hpp"

namespace cutjoint {

/// M vdot + Phi_q^T (alpha Phi + lambda) = Q with lambda such that Phi vanishes.  Redundant and momentarily dependent equations are as
/// good as others: the tangent  f_q = M + dt/2 C + dt^2/4 (K + alpha Phi_q^T Phi_q)  is positive definite whatever their rank.
template <class S>
class AugmentedNewton : public Newton<S> {
 public:
  using Base = Newton<S>;
  using typename Base::Real;

  AugmentedNewton(S& system, LinearSolver<Real>& solver, const NewtonSettings& settings)
      : Base(system, solver, settings), alpha_(settings.penalty.value_or(0.0)), pose_(d_.coordinates.size()), closing_(n_, m_) {}

 protected:
  using Base::d_, Base::f_, Base::settings_, Base::k_, Base::lambda_, Base::m_, Base::n_, Base::phi_, Base::phidd_,
      Base::speed_, Base::system_, Base::tangent_, Base::turns_, Base::weight_, Base::x_;

  const char* name() const override { return "augmented"; }
  Weights<Real> weights() const override { return {speed_, k_, k_ * alpha_, turns_.data()}; }
  Weights<Real> start_weights() const override { return {Real(0), Real(0), start_alpha_, turns_.data()}; }

  /// The start weighs the equations against the heaviest coordinate, and so does a step whose penalty is not given, alpha dt^2/4 being what
  /// stands beside the masses in its tangent.
  void choose_weights(const State<Real>& state) override {
    this->linearise(state, Real(0), {Real(0), Real(0), Real(0), turns_.data()});
    Real heaviest(0);
    for (std::size_t j = 0; j < n_; ++j)
      for (auto k = static_cast<std::size_t>(d_.pattern.first[j]); k < static_cast<std::size_t>(d_.pattern.first[j + 1]); ++k)
        if (static_cast<std::size_t>(d_.pattern.row[k]) == j) heaviest = std::max(heaviest, tangent_[k]);
    start_alpha_ = overweight<Real> * (heaviest > Real(0) ? heaviest : Real(1));
    weigh();
  }

  void weigh() override {
    if (!settings_.penalty) alpha_ = start_alpha_ / (k_ > Real(0) ? k_ : Real(1));
  }

  void correct_start() override {
    for (std::size_t i = 0; i < m_; ++i) lambda_[i] += start_alpha_ * phidd_[i];
  }

  /// (M + alpha Phi_q^T Phi_q) dvdot = -(M vdot + Phi_q^T (lambda + alpha Phidd) - Q) with the alpha of the start
  void right_of_start(const State<Real>& state) override {
    for (std::size_t i = 0; i < m_; ++i) weight_[i] = start_alpha_ * phidd_[i];
    system_.apply_jacobian_transposed(state.q.data(), weight_.data(), x_.data());
    for (std::size_t i = 0; i < n_; ++i) x_[i] = -f_[i] - x_[i];
  }

  /// f_q dq = -dt^2/4 f with f = M vdot + Phi_q^T (alpha Phi + lambda) - Q.
  ///
  /// The multipliers of iteration i + 1 are lambda_(i+1) = lambda_i + alpha Phi_(i+1) with Phi_(i+1) = Phi(q_(i+1)), which is known only
  /// when that iteration evaluates it; but lambda_(i+1) + alpha Phi_(i+1) = lambda_i + 2 alpha Phi_(i+1), so that evaluating with
  /// twice the penalty and the old multipliers gives the f that belongs to the new ones.  The first iteration has no Phi before
  /// its own: it keeps what was predicted, since the penalty of a predicted pose is no force of the mechanism.
  void approach(const State<Real>& state, int iteration, bool) override {
    iteration_ = iteration;
    const bool updated = iteration > 1 && iteration - 1 <= settings_.multiplier_updates;
    this->linearise(state, updated ? 2 * alpha_ : alpha_, weights());
    pose_ = state.q;
    if (updated)
      for (std::size_t i = 0; i < m_; ++i) lambda_[i] += alpha_ * phi_[i];
    for (std::size_t i = 0; i < n_; ++i) x_[i] = -k_ * f_[i];
  }

  /// What acts is lambda + alpha Phi.  The multipliers take it over when the last iteration was still one that corrects them.
  void update_multipliers(State<Real>& state) override {
    for (std::size_t i = 0; i < m_; ++i) state.lambda[i] = lambda_[i] + alpha_ * phi_[i];
    if (iteration_ <= settings_.multiplier_updates) lambda_ = state.lambda;
  }

  /// An iteration leaves the share 1 / (1 + dt^2/4 alpha s) of what the multipliers lack in a direction with the inverse mass s.  What is
  /// left at the end of a step, extrapolation enlarges.  With a large dt^2/4 alpha it is next to nothing; with a small one multipliers
  /// that are extrapolated swing ever wider.
  bool extrapolates() const override {
    using std::pow;
    return pow(share_left_, Real(std::min(iteration_, settings_.multiplier_updates))) < Real(0.3);
  }

  /// The projection  f_q dv = -dt^2/4 alpha Phi_q^T Phid  leaves the same share of the gap Phid; see Closing.
  void project_on(const State<Real>& state, std::vector<Real>& values, std::vector<Real>& gap) override {
    const Real left = closing_.close(values, gap, k_ * alpha_, this->negligible(values), [&](const auto& w, auto way, auto closing) {
      this->follow_weight(pose_, state, w, way, closing);
    });
    if (&values == &state.v) take_share(left);
  }

  /// The share of the rates' gap that a projection of length dt^2/4 alpha leaves where it leaves most.
  virtual void take_share(Real left) { share_left_ = left; }

  [[noreturn]] void report_breakdown(Breakdown broken) override {
    const std::string_view coordinate = broken.row < 0 ? "" : d_.unknowns()[static_cast<std::size_t>(broken.row)];
    const char* loose = "this coordinate has neither mass nor stiffness, and no equation holds it";
    if (broken.kind == Breakdown::Kind::singular) this->fail("the tangent is singular", coordinate, Real(0), loose);
    this->fail("a pivot of the tangent is not positive", coordinate, Real(0),
               std::string("a negative stiffness or damping outweighs the mass over a step this long, or ") + loose + "; not tried: a smaller dt");
  }

  Real start_alpha_{1}, alpha_;
  int iteration_ = 0;       ///< of a step
  Real share_left_{0};             ///< of the gap by a projection of length dt^2/4 alpha, where most is left
  std::vector<Real> pose_;  ///< of the tangent

  Closing<Real> closing_;
};

}  // namespace cutjoint
