// The index-3 augmented Lagrangian method with mass-orthogonal projections (Cuadrado et al. 2000, section 2.1).
#pragma once

#include "cutjoint/core/stepping/newton_steps.hpp"

namespace cutjoint {

/// M vdot + Phi_q^T (alpha Phi + lambda) = Q with lambda such that Phi vanishes.  Redundant and momentarily dependent equations are
/// allowed: the tangent  f_q = M + dt/2 C + dt^2/4 (K + alpha Phi_q^T Phi_q)  is positive definite whatever their rank.
///
/// The base of `augmented` and `recursive-newton`; `Own` is one of these.
template <class Own, class S, class Solver>
class AugmentedBase : public Newton<Own, S, Solver> {
 public:
  using Base = Newton<Own, S, Solver>;
  using typename Base::Real;

  AugmentedBase(S& system, Solver& solver, const NewtonSettings& settings)
      : Base(system, solver, settings), alpha_(settings.penalty.value_or(0.0)), pose_(sizes_of(system).coordinates), closing_(system), shift_(n_), from_(pose_) {}

  /// Close the loops of another state, positions first, then speeds, with the factors of a step near it.
  Fault close_loops(StateOf<S>& state) {
    if (m_ == 0) return {};
    this->time_ = state.t;
    system_.begin_step(state.t, Real(1));
    if (!this->has_factors())
      if (const Fault fault = renew(state)) return fault;
    Residuals left;
    return this->close_with(state, pose_, k_ * alpha_, closing_, shift_, from_, left);
  }

  /// Close the loops of a state away from any step, by moving the masses least.  A fault names the equation that stays open.
  Fault assemble(StateOf<S>& state) {
    if (m_ == 0) return {};
    constexpr int most = 20;
    Residuals left;
    this->get_ready(state, Real(1));
    if (this->arm_ != Real(1)) choose_weights(state);
    for (int round = 0; round < most; ++round) {
      this->linearise(state, Real(0), start_weights());
      pose_ = state.q;
      if (const Fault fault = this->factor()) return fault;
      if (const Fault fault = this->close_with(state, pose_, start_alpha_, closing_, shift_, from_, left)) return fault;
      if (this->is_closed(state)) return {};
    }
    const bool open = left.position > left.velocity;
    return this->fault_in_equation(open ? Cause::loops_not_closed : Cause::speeds_not_found, index_of_largest(open ? phi_ : this->phid_, m_),
                                   Real(open ? left.position : left.velocity));
  }

  /// Memory of the next steps, besides the state and the factors of the last tangent.
  struct Memory {
    typename Base::Memory steps;
    Coordinates<S> pose;
    Real start_alpha, share_left;
    long iteration;
  };

  Memory memory() const { return {Base::memory(), pose_, start_alpha_, share_left_, iteration_}; }

  void restore(const Memory& memory) {
    start_alpha_ = memory.start_alpha;
    Base::restore(memory.steps);
    pose_ = memory.pose;
    share_left_ = memory.share_left;
    iteration_ = static_cast<int>(memory.iteration);
  }

 protected:
  friend Base;
  using Base::f_, Base::settings_, Base::k_, Base::lambda_, Base::m_, Base::n_, Base::phi_, Base::phidd_,
      Base::speed_, Base::system_, Base::tangent_, Base::ball_tangents_, Base::weight_, Base::x_;

  Weights<Real> weights() const { return {speed_, k_, k_ * alpha_, ball_tangents_.data()}; }
  Weights<Real> start_weights() const { return {Real(0), Real(0), start_alpha_, ball_tangents_.data()}; }

  /// The start weights the equations relative to the heaviest coordinate, and so does a step without a given penalty, whose weight beside the
  /// masses in its tangent is alpha dt^2/4.
  void choose_weights(const StateOf<S>& state) {
    start_alpha_ = overweight<Real> * this->heaviest(state, ball_tangents_.data());
    weigh();
  }

  void weigh() {
    if (!settings_.penalty) alpha_ = start_alpha_ / (k_ > Real(0) ? k_ : Real(1));
  }

  /// By stored products, so that results do not depend on contraction by the compiler.
  void correct_start(Real alpha) {
    for (std::size_t i = 0; i < m_; ++i) {
      weight_[i] = alpha * phidd_[i];
      lambda_[i] += weight_[i];
    }
  }

  /// (M + alpha Phi_q^T Phi_q) dvdot = -(M vdot + Phi_q^T (lambda + alpha Phidd) - Q) with the alpha of the start, or with dt^2/4 times that of a step
  void right_of_start(const StateOf<S>& state, Real alpha) {
    for (std::size_t i = 0; i < m_; ++i) weight_[i] = alpha * phidd_[i];
    system_.apply_jacobian_transposed(state.q.data(), weight_.data(), x_.data());
    for (std::size_t i = 0; i < n_; ++i) x_[i] = -f_[i] - x_[i];
  }

  /// f_q dq = -dt^2/4 f with f = M vdot + Phi_q^T (alpha Phi + lambda) - Q.
  ///
  /// The multipliers of iteration i + 1 are lambda_(i+1) = lambda_i + alpha Phi_(i+1) with Phi_(i+1) = Phi(q_(i+1)).  That is known only
  /// when the iteration evaluates it; but lambda_(i+1) + alpha Phi_(i+1) = lambda_i + 2 alpha Phi_(i+1).  So an evaluation with twice the
  /// penalty and the old multipliers gives the f of the new ones.  The first iteration has no Phi before its own: it keeps what was
  /// predicted, since the penalty of a predicted pose is no force of the mechanism.
  void approach(const StateOf<S>& state, int iteration, bool) {
    iteration_ = iteration;
    const bool updated = iteration > 1 && (this->is_damped() ? this->is_near() : iteration - 1 <= settings_.multiplier_updates);
    this->linearise(state, updated ? 2 * alpha_ : alpha_, weights());
    pose_ = state.q;
    if (updated)
      for (std::size_t i = 0; i < m_; ++i) lambda_[i] += alpha_ * phi_[i];
    for (std::size_t i = 0; i < n_; ++i) x_[i] = -k_ * f_[i];
  }

  /// The forces are lambda + alpha Phi.  The multipliers take them over when the last iteration was still one that corrects them.
  Fault update_multipliers(StateOf<S>& state) {
    for (std::size_t i = 0; i < m_; ++i) state.lambda[i] = lambda_[i] + alpha_ * phi_[i];
    if (iteration_ <= settings_.multiplier_updates) lambda_ = state.lambda;
    return {};
  }

  /// An iteration leaves the fraction 1 / (1 + dt^2/4 alpha s) of the multipliers' error in a direction with the inverse mass s.  Extrapolation
  /// amplifies the error left at the end of a step.  With a large dt^2/4 alpha it is negligible; with a small one extrapolated
  /// multipliers oscillate with growing amplitude.
  bool extrapolates() const {
    using std::pow;
    return pow(share_left_, Real(std::min(iteration_, settings_.multiplier_updates))) < Real(0.3);
  }

  /// The projection  f_q dv = -dt^2/4 alpha Phi_q^T Phid  leaves the same fraction of the violation Phid; see Closing.
  Fault project_on(const StateOf<S>& state, Speeds<S>& values, Equations<S>& violation) {
    const Real negligible = static_cast<const Own*>(this)->negligible(this->size_of(state, values));
    const Fault fault = closing_.close(values, violation, k_ * alpha_, negligible, [&](const auto& w, auto shift, auto closing) {
      return this->follow_weight(pose_, state.q, w, shift, closing);
    });
    if (!fault && &values == &state.v) share_left_ = closing_.share_left();
    return fault;
  }

  Fault renew(const StateOf<S>& state) {
    this->linearise(state, Real(0), this->step_weights());
    pose_ = state.q;
    return this->factor();
  }

  Real start_alpha_{1}, alpha_;
  int iteration_ = 0;     ///< of a step
  Real share_left_{0};    ///< of the violation of rates by a projection of length dt^2/4 alpha, where most is left
  Coordinates<S> pose_;   ///< of the tangent

  Closing<S> closing_;

 private:
  Speeds<S> shift_;  ///< displacement of a projection, and its origin
  Coordinates<S> from_;
};

/// The method `augmented`.
template <class S, class Solver>
class AugmentedNewton final : public AugmentedBase<AugmentedNewton<S, Solver>, S, Solver> {
 public:
  using AugmentedBase<AugmentedNewton, S, Solver>::AugmentedBase;
};

/// Steps of a simulation over a system in natural coordinates, whose tangent is positive definite: any pivot order is safe.
template <class M, class S>
using AugmentedSteps = NewtonSteps<M, S, AugmentedNewton<S, StaticSolver<S>>, StaticSolver<S>>;

}  // namespace cutjoint
