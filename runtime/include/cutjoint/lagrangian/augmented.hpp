// The index-3 augmented Lagrangian method with mass-orthogonal projections (Cuadrado et al. 2000, section 2.1).
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <vector>

#include "cutjoint/lagrangian/newton.hpp"

namespace cutjoint {

/// M vdot + Phi_q^T (alpha Phi + lambda) = Q with lambda such that Phi vanishes.  Redundant and momentarily dependent equations are as
/// good as others: the tangent  f_q = M + dt/2 C + dt^2/4 (K + alpha Phi_q^T Phi_q)  is positive definite whatever their rank.
template <class S>
class AugmentedNewton : public Newton<S> {
 public:
  using Base = Newton<S>;
  using typename Base::Real;

  AugmentedNewton(S& system, LinearSolver<Real>& solver, const NewtonFigures& figures)
      : Base(system, solver, figures), alpha_(figures.penalty), pose_(d_.coordinates.size()), gap_(m_), ways_(passes * n_), closings_(passes * m_) {}

 protected:
  using Base::d_, Base::dt_, Base::f_, Base::figures_, Base::k_, Base::lambda_, Base::m_, Base::n_, Base::passes, Base::phi_, Base::phidd_,
      Base::system_, Base::tangent_, Base::turns_, Base::weight_, Base::x_;

  const char* name() const override { return "augmented"; }
  Weights<Real> weights() const override { return {dt_ / 2, k_, k_ * alpha_, turns_.data()}; }
  Weights<Real> start_weights() const override { return {Real(0), Real(0), start_alpha_, turns_.data()}; }

  /// The start weighs the equations against the heaviest coordinate, and so does a step whose penalty is not given, alpha dt^2/4 being what
  /// stands beside the masses in its tangent.
  void choose_weights(const State<Real>& state) override {
    this->linearise(state, Real(0), {Real(0), Real(0), Real(0), turns_.data()});
    Real heaviest(0);
    for (std::size_t j = 0; j < n_; ++j)
      for (auto k = static_cast<std::size_t>(d_.pattern.first[j]); k < static_cast<std::size_t>(d_.pattern.first[j + 1]); ++k)
        if (static_cast<std::size_t>(d_.pattern.row[k]) == j) heaviest = std::max(heaviest, tangent_[k]);
    start_alpha_ = overweight * (heaviest > Real(0) ? heaviest : Real(1));
    if (!(figures_.penalty > 0)) alpha_ = start_alpha_ / (k_ > Real(0) ? k_ : Real(1));
  }

  void correct_start() override {
    for (std::size_t i = 0; i < m_; ++i) lambda_[i] += start_alpha_ * phidd_[i];
  }

  /// (M + alpha Phi_q^T Phi_q) dvdot = -(M vdot + Phi_q^T (lambda + alpha Phidd) - Q) with the alpha of the start
  void right_of_start(const State<Real>& state) override {
    for (std::size_t i = 0; i < m_; ++i) weight_[i] = start_alpha_ * phidd_[i];
    system_.pull(state.q.data(), weight_.data(), x_.data());
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
    const bool updated = iteration > 1 && iteration - 1 <= figures_.multiplier_updates;
    this->linearise(state, updated ? 2 * alpha_ : alpha_, weights());
    pose_ = state.q;
    if (updated)
      for (std::size_t i = 0; i < m_; ++i) lambda_[i] += alpha_ * phi_[i];
    for (std::size_t i = 0; i < n_; ++i) x_[i] = -k_ * f_[i];
  }

  /// What acts is lambda + alpha Phi.  The multipliers take it over when the last iteration was still one that corrects them.
  void settle(State<Real>& state) override {
    for (std::size_t i = 0; i < m_; ++i) state.lambda[i] = lambda_[i] + alpha_ * phi_[i];
    if (iteration_ <= figures_.multiplier_updates) lambda_ = state.lambda;
  }

  /// An iteration leaves the share 1 / (1 + dt^2/4 alpha s) of what the multipliers lack in a direction with the inverse mass s.  What is
  /// left at the end of a step, extrapolation enlarges.  With a large dt^2/4 alpha it is next to nothing; with a small one multipliers
  /// that are extrapolated swing ever wider.
  bool extrapolates() const override {
    using std::pow;
    return pow(share_left_, Real(std::min(iteration_, figures_.multiplier_updates))) < Real(0.3);
  }

  /// The projection  f_q dv = -dt^2/4 alpha Phi_q^T Phid  leaves the same share of the gap Phid.  It is the first step, of length
  /// dt^2/4 alpha, of an iteration for w in  S w = Phid, S = Phi_q f_q^-1 Phi_q^T, dv = -f_q^-1 Phi_q^T w; conjugate residuals take steps of
  /// the best length at the same price, a back-substitution each, and close gaps where that length closes next to nothing.  They are those
  /// of Eisenstat, Elman, Schultz (SIAM J. Numer. Anal. 20 (1983) 345-357), since f_q need not be symmetric, nor belong to this very pose.
  ///
  /// A direction far weaker than others belongs to equations that depend on each other, or nearly do: it is left as it is, since closing
  /// it would take a leap in the rates.  How strong it is, the penalty hides: without it S is S / (1 - dt^2/4 alpha S).  (Those that move no
  /// mass at all are strong without limit, which says nothing of others.)
  void project_on(const State<Real>& state, std::vector<Real>& values, const std::vector<Real>& gap) override {
    const bool rates = &values == &state.v;
    Real strongest(0);
    if (rates) share_left_ = Real(0);
    gap_ = gap;
    for (std::size_t pass = 0; pass < passes && this->largest(gap_) > this->negligible(values); ++pass) {
      const std::span<Real> way(ways_.data() + pass * n_, n_), closing(closings_.data() + pass * m_, m_);
      follow_weight(state, gap_, way, closing);
      const Real strength = dot(gap_, closing) / dot(gap_, gap_);
      if (rates) share_left_ = std::max(share_left_, 1 - k_ * alpha_ * strength);
      const Real free = strength / std::max(1 - k_ * alpha_ * strength, std::numeric_limits<Real>::epsilon());
      if (!(free > Real(1e-4) * strongest)) break;
      strongest = std::max(strongest, std::min(free, overweight / (k_ * alpha_)));
      for (std::size_t before = 0; before < pass; ++before) {
        const std::span<Real> old_way(ways_.data() + before * n_, n_), old(closings_.data() + before * m_, m_);
        const Real share = dot(closing, old) / dot(old, old);
        subtract(share, old_way, way);
        subtract(share, old, closing);
      }
      const Real length = dot(gap_, closing) / dot(closing, closing);
      subtract(length, way, values);
      subtract(length, closing, gap_);
    }
  }

  /// way = f_q^-1 Phi_q^T w and closing = Phi_q way = S w; the first Phi_q is that of the tangent.
  void follow_weight(const State<Real>& state, const std::vector<Real>& w, std::span<Real> way, std::span<Real> closing) {
    system_.pull(pose_.data(), w.data(), x_.data());
    this->solve();
    std::copy_n(x_.begin(), n_, way.begin());
    system_.stretch(state.q.data(), way.data(), closing.data());
  }

  static Real dot(std::span<const Real> a, std::span<const Real> b) {
    Real sum(0);
    for (std::size_t i = 0; i < a.size(); ++i) sum += a[i] * b[i];
    return sum;
  }

  static void subtract(Real factor, std::span<const Real> a, std::span<Real> from) {
    for (std::size_t i = 0; i < a.size(); ++i) from[i] -= factor * a[i];
  }

  [[noreturn]] void report_breakdown(Breakdown broken) override {
    const std::string_view coordinate = broken.row < 0 ? "" : d_.unknowns()[static_cast<std::size_t>(broken.row)];
    const char* loose = "this coordinate has neither mass nor stiffness, and no equation holds it";
    if (broken.kind == Breakdown::Kind::singular) this->fail("the tangent is singular", coordinate, Real(0), loose);
    this->fail("a pivot of the tangent is not positive", coordinate, Real(0),
               std::string("a negative stiffness or damping outweighs the mass over a step this long: take a smaller dt; or ") + loose);
  }

  static constexpr Real overweight{1e4};

  Real start_alpha_{1}, alpha_;
  int iteration_ = 0;       ///< of a step
  std::vector<Real> pose_;  ///< of the tangent

 private:
  Real share_left_{0};             ///< of the gap by a projection of length dt^2/4 alpha, where most is left
  std::vector<Real> gap_;             ///< what a projection has left
  std::vector<Real> ways_, closings_;  ///< its increments, and what they close
};

}  // namespace cutjoint
