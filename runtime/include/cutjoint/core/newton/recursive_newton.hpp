// Newton's iteration on the recursion: the augmented Lagrangian method in relative coordinates, with tangents that are reused.
#pragma once

#include "cutjoint/core/newton/augmented.hpp"
#include "cutjoint/core/newton/guarded_solver.hpp"

namespace cutjoint {

/// The residual is cheap compared with its tangent, so factors are reused, over steps too, while the iteration converges; a step that fails
/// even with a tangent in each iteration is halved.
///
/// Violations are then corrected along the Phi_q of the tangent.  Along the present one, which differs by epsilon, the penalty
/// would overshoot by a factor epsilon dt^2/4 alpha / mass in the free directions.  Multipliers are corrected when the iteration has nearly
/// converged: before, Phi has components without constraint forces, which redundant equations would retain.
template <class S, class Solver>
class RecursiveNewton final : public AugmentedBase<RecursiveNewton<S, Solver>, S, Solver> {
 public:
  using Base = AugmentedBase<RecursiveNewton, S, Solver>;
  using typename Base::Real;

  RecursiveNewton(S& system, Solver& solver, const NewtonSettings& settings)
      : Base(system, solver, settings), push_(m_), penalised_(n_), unclosed_(n_), violation_(m_) {}

 private:
  friend Base;
  friend typename Base::Base;
  using Base::alpha_, Base::closing_, Base::f_, Base::settings_, Base::iteration_, Base::k_, Base::lambda_, Base::m_, Base::n_, Base::phi_, Base::pose_,
      Base::share_left_, Base::system_, Base::x_;

  /// f_q dq = -dt^2/4 (f + alpha Phi_q^T Phi), and twice the penalty after it has been added to the multipliers.
  void approach(const StateOf<S>& state, int iteration, bool renewed) {
    iteration_ = iteration;
    if (iteration == 1) updates_ = 0;
    if (renewed) {
      this->linearise(state, Real(0), this->step_weights());
      pose_ = state.q;
    } else {
      this->dynamic_residual(state, Real(0));
    }
    const bool updated = iteration > 1 && this->is_near() && updates_ < settings_.multiplier_updates;
    for (std::size_t i = 0; i < m_; ++i) {
      push_[i] = (updated ? 2 : 1) * alpha_ * phi_[i];
      if (updated) lambda_[i] += alpha_ * phi_[i];
    }
    updates_ += updated;
    system_.apply_jacobian_transposed(pose_.data(), push_.data(), penalised_.data());
    for (std::size_t i = 0; i < n_; ++i) x_[i] = -k_ * (f_[i] + penalised_[i]);
  }

  /// A hundredth of what the iteration leaves of the accelerations.
  Real negligible(Real size) const { return Real(1e-2) * Real(settings_.tolerance) * size; }

  /// If reused factors leave a violation, a new tangent is factored.  Likewise if their age matters: rates are projected in the metric of
  /// the tangent, and the error by its age has the same direction in all steps.
  Fault project_on(const StateOf<S>& state, Speeds<S>& values, Equations<S>& violation) {
    unclosed_ = values;
    violation_ = violation;
    if (const Fault fault = project_surely(state, values, violation)) return fault;
    if (pose_ == state.q || (closing_.closed() && !shows_age(state, values))) return {};
    if (closing_.closed()) {
      values = unclosed_;
      violation = violation_;
    }
    this->update_ball_tangents();
    if (const Fault fault = this->renew(state)) return fault;
    return project_surely(state, values, violation);
  }

  /// Whether the tangent's age changes a projection of the rates by more than a hundred times what iterations may leave of them.  With less, a tolerance
  /// that is as loose as the default would take a tangent in every third step of the vehicle, for a change that is far below the rule's error.
  bool shows_age(const StateOf<S>& state, const Speeds<S>& values) const {
    using std::abs;
    if (&values != &state.v) return false;
    Real move(0);
    for (std::size_t i = 0; i < n_; ++i) move = std::max(move, abs(values[i] - unclosed_[i]));
    return this->age() * move > 100 * this->left() * this->speed_;
  }

  /// If a projection leaves most of a violation, equations are nearly dependent.  Their directions rotate quickly with the pose, and their
  /// multipliers grow without limit.
  Fault project_surely(const StateOf<S>& state, Speeds<S>& values, Equations<S>& violation) {
    const Fault fault = Base::project_on(state, values, violation);
    if (!fault && &values == &state.v && share_left_ > Real(0.9)) return this->fault_in_equation(Cause::pose_singular, 0, share_left_);
    return fault;
  }

  bool renews_always() const { return false; }
  bool halves() const { return true; }

  /// Whether the iterate is so near that its Phi is only due to the multipliers.
  bool may_end() const { return m_ == 0 || this->is_near(); }

  /// The last iteration leaves the part of Phi due to its tangent's age: correct it along the same Phi_q, by the accelerations.
  Fault update_multipliers(StateOf<S>& state) {
    const Real rounding = this->rounding_like(1e-13) * this->pose_size(state.q);
    for (std::size_t pass = 0; pass < Base::passes && largest(phi_) > rounding; ++pass) {
      for (std::size_t i = 0; i < m_; ++i) push_[i] = alpha_ * phi_[i];
      system_.apply_jacobian_transposed(pose_.data(), push_.data(), x_.data());
      if (const Fault fault = this->solve()) return fault;
      for (std::size_t i = 0; i < n_; ++i) state.vdot[i] -= x_[i];
      for (std::size_t i = 0; i < m_; ++i) lambda_[i] += push_[i];
      this->follow(state);
      this->constraint_residual(state);
    }
    return Base::update_multipliers(state);
  }

  int updates_ = 0;  ///< iterations of a step that corrected the multipliers
  Equations<S> push_;
  Speeds<S> penalised_, unclosed_;  ///< the last: rates before they were projected, whose violation is `violation_`
  Equations<S> violation_;
};

/// Steps of a simulation over a system in the coordinates of the mechanism M that starts.
template <class M, class S>
using RecursiveNewtonSteps = NewtonSteps<M, S, RecursiveNewton<S, GuardedSolver<S, DenseSolver<S>>>, GuardedSolver<S, DenseSolver<S>>>;

/// The same by the generalised-alpha method.
template <class M, class S>
using GeneralisedAlphaSteps = NewtonSteps<M, S, RecursiveNewton<S, GuardedSolver<S, DenseSolver<S>>>, GuardedSolver<S, DenseSolver<S>>, true>;

}  // namespace cutjoint
