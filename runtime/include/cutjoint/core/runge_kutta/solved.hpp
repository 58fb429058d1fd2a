// Accelerations of a mechanism with multipliers solved for in each evaluation.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include "cutjoint/core/numbers/arrays.hpp"
#include "cutjoint/core/numbers/largest.hpp"
#include "cutjoint/core/constraints/projection.hpp"
#include "cutjoint/core/mechanism/relative.hpp"
#include "cutjoint/core/mechanism/state.hpp"

namespace cutjoint::runge_kutta {

/// Multipliers are `corrected` from evaluation to evaluation, or `solved` for in each by passes from zero, so that they depend on the state alone.
/// Near singular poses, in nearly unconstrained directions, passes leave part of the forces missing.  `solved` accepts this: a single
/// evaluation with more passes would look like a jump to an error estimate.  `completed` is for rules without one.
enum class Multipliers { corrected, solved, completed };

/// The differential equation of a mechanism.  Near a singular pose completed multipliers are found by GCR (falling_residuals.hpp) in the nearest
/// consistent state, since violations would cause large accelerations there.
template <Mechanism M>
class Solved : public Relative<M, Solved<M>> {
 public:
  using Base = Relative<M, Solved<M>>;
  using typename Base::Real;

  Solved(M& mechanism, Real tolerance, Multipliers multipliers)
      : Base(mechanism, tolerance), projection_(mechanism), multipliers_(multipliers), first_lambda_(correction_), trial_(correction_), left_(correction_),
        first_vdot_(correction_.empty() ? 0 : state_.v.size()) {}

  Projection<M>& projection() { return projection_; }

  /// Find accelerations and multipliers of the state.
  void find_multipliers() {
    if (multipliers_ == Multipliers::corrected) this->correct_multipliers();
    else if (experience_.weak) settle();
    else solve_multipliers();
  }

 protected:
  using Base::correction_, Base::experience_, Base::mechanism_, Base::state_, Base::tolerance_;

  Projection<M> projection_;
  const Multipliers multipliers_;

 private:
  static constexpr int trusted = 32, soon = 4, most = 4;

  Real enough() const { return std::max(tolerance_, Real(1e-9)) * acceleration_size(state_.vdot, scaled_nominals_of(mechanism_)); }

  /// From zero multipliers by as many passes as the last check found sufficient.  A check takes one more, and further ones as long as each changes
  /// the accelerations much less than the one before.  Completed ones are checked more often, near a singular pose always, since a step may
  /// cross it.
  void solve_multipliers() {
    const bool checks = experience_.age >= trusted, completes = multipliers_ == Multipliers::completed;
    forget();
    Real last = std::numeric_limits<Real>::infinity();
    for (int pass = 1; pass <= most; ++pass) {
      this->add_pass();
      if (correction_.empty()) return;
      if (!checks && pass == experience_.passes) break;
      if (!checks) continue;
      if (pass == 1) {
        keep();
        continue;
      }
      const Real change = this->largest_change();
      const bool falls = change < last / Real(100);
      if (!falls && completes) return settle();
      experience_.passes = falls ? pass - 1 : 1;
      if (pass == 2) experience_.age = !completes ? 0 : change > enough() / Real(10) ? trusted : trusted - soon;
      if (!falls) {
        std::copy_n(first_vdot_.begin(), first_vdot_.size(), state_.vdot.begin());
        state_.lambda = first_lambda_;
      }
      if (!falls || change <= enough()) break;
      last = change;
    }
    ++experience_.age;
  }

  void keep() {
    std::copy_n(state_.vdot.begin(), first_vdot_.size(), first_vdot_.begin());
    first_lambda_ = state_.lambda;
  }

  void forget() { std::fill(state_.lambda.begin(), state_.lambda.end(), Real(0)); }

  /// Near a singular pose; left when passes suffice again.
  void settle() {
    projection_.close_fully(true);
    (void)projection_.positions(state_), (void)projection_.velocities(state_);
    projection_.close_fully(false);
    forget();
    experience_.age = trusted;
    experience_.weak = !is_enough();
    if (!experience_.weak) return;
    for (std::size_t i = 0; i < correction_.size(); ++i) state_.lambda[i] -= correction_[i];
    Real rest = largest(correction_), share(1e-6);
    for (int round = 0; round < 4; ++round) {
      const Real moved = solve_left(share), next = largest(correction_), owed = moved * (next / rest);
      if (owed <= enough() || !(next < rest / Real(2))) break;
      share = std::max(Real(1e-6), Real(0.3) * enough() / owed);
      rest = next;
    }
  }

  /// Passes from zero multipliers as elsewhere; whether they converge quickly enough.
  bool is_enough() {
    Real last = std::numeric_limits<Real>::infinity();
    for (int pass = 1; pass <= most; ++pass) {
      this->add_pass();
      if (pass == 1) continue;
      const Real change = this->largest_change();
      experience_.passes = pass - 1;
      if (change <= enough()) return true;
      if (!(change < last / Real(100))) break;
      last = change;
    }
    return false;
  }

  /// A correction of the multipliers, which leaves a fraction of their error; returns the change of the accelerations.
  Real solve_left(Real share) {
    keep();
    left_ = correction_;
    auto& solver = projection_.solver();
    solver.solve(left_, Real(1e-4), share, true, [this](const Equations<M>& w, Speeds<M>& step, Equations<M>& closed) {
      for (std::size_t i = 0; i < w.size(); ++i) trial_[i] = first_lambda_[i] + w[i];
      evaluate(trial_);
      for (std::size_t i = 0; i < w.size(); ++i) closed[i] = left_[i] - correction_[i];
      for (std::size_t i = 0; i < step.size(); ++i) step[i] = state_.vdot[i] - first_vdot_[i];
    });
    for (std::size_t i = 0; i < left_.size(); ++i) state_.lambda[i] = first_lambda_[i] + solver.found()[i];
    evaluate(state_.lambda);
    for (std::size_t i = 0; i < first_vdot_.size(); ++i) first_vdot_[i] -= state_.vdot[i];
    return largest(first_vdot_, scaled_nominals_of(mechanism_));
  }

  void evaluate(const Equations<M>& lambda) {
    mechanism_.evaluate(state_.q.data(), state_.v.data(), lambda.data(), state_.vdot.data(), correction_.data());
    ++experience_.evaluations;
  }

  Equations<M> first_lambda_, trial_, left_;
  Array<M, static_sizes<M>().equations == 0 ? 0 : static_sizes<M>().speeds> first_vdot_;
};

}  // namespace cutjoint::runge_kutta
