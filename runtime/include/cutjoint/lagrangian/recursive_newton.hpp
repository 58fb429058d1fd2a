// Newton's iteration on the recursion: the augmented Lagrangian method in relative coordinates, with tangents that are reused.
#pragma once

#include <algorithm>

#include "cutjoint/lagrangian/augmented.hpp"

namespace cutjoint {

/// The residual is cheap beside its tangent, so that factors are reused, over steps too, while they bring the iteration on; a step that fails
/// even with a tangent in each iteration is taken in halves.
///
/// What violates the equations is then corrected along the Phi_q of the tangent.  Along the present one, which differs by epsilon, the penalty
/// would push epsilon dt^2/4 alpha / mass times too far in the free directions.  Multipliers are corrected once the iteration is near its end:
/// before, Phi has parts that no force of the equations answers to, which redundant equations would keep.
template <class S>
class RecursiveNewton final : public AugmentedNewton<S> {
 public:
  using Base = AugmentedNewton<S>;
  using typename Base::Real;

  RecursiveNewton(S& system, LinearSolver<Real>& solver, const NewtonSettings& settings)
      : Base(system, solver, settings), push_(m_), penalised_(n_), way_(n_), from_(pose_) {}

  /// Close the loops of another state, positions first, then speeds, with the factors of a step near it.
  void close_loops(State<Real>& state) {
    if (m_ == 0) return;
    this->time_ = state.t;
    system_.begin_step(state.t, Real(1));
    if (!this->has_factors()) renew(state);
    this->close_with(state, pose_, k_ * alpha_, closing_, way_, from_);
  }

 private:
  using Base::alpha_, Base::closing_, Base::d_, Base::f_, Base::settings_, Base::iteration_, Base::k_, Base::lambda_, Base::m_, Base::n_, Base::phi_,
      Base::pose_, Base::system_, Base::x_;

  const char* name() const override { return "recursive-newton"; }

  /// f_q dq = -dt^2/4 (f + alpha Phi_q^T Phi), and twice the penalty where it has become part of the multipliers.
  void approach(const State<Real>& state, int iteration, bool renewed) override {
    iteration_ = iteration;
    if (iteration == 1) updates_ = 0;
    if (renewed) {
      this->linearise(state, Real(0), this->step_weights());
      pose_ = state.q;
    } else {
      this->dynamic_residual(state, Real(0));
    }
    const bool updated = this->is_near() && updates_ < settings_.multiplier_updates;
    for (std::size_t i = 0; i < m_; ++i) {
      push_[i] = (updated ? 2 : 1) * alpha_ * phi_[i];
      if (updated) lambda_[i] += alpha_ * phi_[i];
    }
    updates_ += updated;
    system_.apply_jacobian_transposed(pose_.data(), push_.data(), penalised_.data());
    for (std::size_t i = 0; i < n_; ++i) x_[i] = -k_ * (f_[i] + penalised_[i]);
  }

  /// A hundredth of what the iteration leaves of the accelerations.
  Real negligible(const std::vector<Real>& values) const override { return Real(1e-2) * Real(settings_.tolerance) * (Real(1) + largest(values)); }

  /// Where the reused factors leave a gap, those of a new tangent close it.
  void project_on(const State<Real>& state, std::vector<Real>& values, std::vector<Real>& gap) override {
    Base::project_on(state, values, gap);
    if (closing_.closed() || pose_ == state.q) return;
    this->turn();
    renew(state);
    Base::project_on(state, values, gap);
  }

  /// Where a projection leaves most of a gap, equations nearly depend on each other; what they ask for turns quickly with the pose, their
  /// multipliers grow without limit, and with them the tangent's share of these.
  void take_share(Real left) override {
    Base::take_share(left);
    if (left > Real(0.9))
      this->fail("the pose is singular, or nearly: equations depend on each other for a moment", d_.equations[0], left,
                 "not tried: another dt, or the methods augmented and recursive, which can cross such poses");
  }

  bool renews_always() const override { return false; }
  bool halves() const override { return true; }

  /// The iterate is near enough for its Phi to be the multipliers' alone.
  bool may_end() const override { return m_ == 0 || this->is_near(); }

  /// The last iteration leaves the share of Phi that its tangent's age explains: it is closed along the same Phi_q, by the accelerations.
  void update_multipliers(State<Real>& state) override {
    const Real rounding = this->rounding_like(1e-13) * (Real(1) + largest(state.q));
    for (std::size_t pass = 0; pass < Base::passes && largest(phi_) > rounding; ++pass) {
      for (std::size_t i = 0; i < m_; ++i) push_[i] = alpha_ * phi_[i];
      system_.apply_jacobian_transposed(pose_.data(), push_.data(), x_.data());
      this->solve();
      for (std::size_t i = 0; i < n_; ++i) state.vdot[i] -= x_[i];
      for (std::size_t i = 0; i < m_; ++i) lambda_[i] += push_[i];
      this->follow(state);
      this->constraint_residual(state);
    }
    Base::update_multipliers(state);
  }

  void renew(const State<Real>& state) {
    this->linearise(state, Real(0), this->step_weights());
    pose_ = state.q;
    this->factor();
  }

  int updates_ = 0;  ///< iterations of a step that corrected the multipliers
  std::vector<Real> push_, penalised_, way_, from_;
};

}  // namespace cutjoint
