// Accelerations of a mechanism whose multipliers an evaluation solves for.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include "cutjoint/core/arrays.hpp"
#include "cutjoint/core/largest.hpp"
#include "cutjoint/core/projection.hpp"
#include "cutjoint/core/relative.hpp"
#include "cutjoint/core/state.hpp"

namespace cutjoint::runge_kutta {

/// The differential equation of a mechanism.  Where a pass `solves` for the multipliers, an evaluation begins with none, so that the state alone
/// says what it finds.
///
/// Near a singular pose the loops hardly hold some directions, and passes leave part of what they must push there.  There a state is taken to the
/// nearest one that closes the loops, since what opens them asks for accelerations as large as it is beside what is left of the equations.  Its
/// multipliers are then found by residuals that fall.
template <Mechanism M>
class Solved : public Relative<M, Solved<M>> {
 public:
  using Base = Relative<M, Solved<M>>;
  using typename Base::Real;

  Solved(M& mechanism, Real tolerance, bool solves)
      : Base(mechanism, tolerance), projection_(mechanism), solves_(solves), first_lambda_(correction_), trial_(correction_), left_(correction_),
        first_vdot_(correction_.empty() ? 0 : state_.v.size()) {}

  Projection<M>& projection() { return projection_; }

  /// Find accelerations and multipliers of the state.
  void find_multipliers() {
    if (!solves_) this->correct_multipliers();
    else if (experience_.weak) settle();
    else solve_multipliers();
  }

 protected:
  using Base::correction_, Base::experience_, Base::mechanism_, Base::state_, Base::tolerance_;

  /// The next evaluation checks whether a pass is enough.
  void doubt() { experience_.age = trusted; }

  Projection<M> projection_;
  const bool solves_;

 private:
  static constexpr int trusted = 32, soon = 4;

  Real enough() const { return std::max(tolerance_, Real(1e-9)) * (Real(1) + largest(state_.vdot)); }

  /// From no multipliers by as many passes as the last check found to be enough.  A check takes one more, and further ones as long as each changes
  /// the accelerations much less than the one before.  The next check is soon where the first of them is more than enough.
  void solve_multipliers() {
    constexpr int most = 4;
    const bool checks = experience_.age >= trusted;
    forget();
    Real last = std::numeric_limits<Real>::infinity();
    for (int pass = 1; pass <= most; ++pass) {
      this->add_pass();
      if (correction_.empty()) return;
      if (!checks && pass == experience_.passes) break;
      if (!checks || pass == 1) continue;
      const Real change = this->largest_change();
      if (!(change < last / Real(100))) return settle();
      experience_.passes = pass - 1;
      if (pass == 2) experience_.age = change > enough() ? trusted - soon : 0;
      if (pass == 4) experience_.age = trusted;
      if (change <= enough()) break;
      last = change;
    }
    ++experience_.age;
  }

  void forget() { std::fill(state_.lambda.begin(), state_.lambda.end(), Real(0)); }

  /// Near a singular pose.  If a second pass is none the better, the pose is left.
  void settle() {
    (void)projection_.positions(state_), (void)projection_.velocities(state_);
    forget();
    this->add_pass();
    this->add_pass();
    experience_.weak = this->largest_change() > enough();
    experience_.passes = 1;
    experience_.age = 0;
    if (!experience_.weak) return;
    for (std::size_t i = 0; i < correction_.size(); ++i) state_.lambda[i] -= correction_[i];
    Real last = std::numeric_limits<Real>::infinity();
    for (int round = 0; round < 4; ++round) {
      const Real rest = largest(correction_);
      if (!(rest < last / Real(2))) break;
      last = rest;
      if (solve_left() <= enough()) break;
    }
  }

  /// A correction of the multipliers that leaves none; how far it has moved the accelerations.
  Real solve_left() {
    using std::abs;
    std::copy_n(state_.vdot.begin(), first_vdot_.size(), first_vdot_.begin());
    first_lambda_ = state_.lambda;
    left_ = correction_;
    auto& solver = projection_.solver();
    solver.solve(left_, Real(1e-4), Real(1e-6), true, [this](const Equations<M>& w, Speeds<M>& step, Equations<M>& closed) {
      for (std::size_t i = 0; i < w.size(); ++i) trial_[i] = first_lambda_[i] + w[i];
      evaluate(trial_);
      for (std::size_t i = 0; i < w.size(); ++i) closed[i] = left_[i] - correction_[i];
      for (std::size_t i = 0; i < step.size(); ++i) step[i] = state_.vdot[i] - first_vdot_[i];
    });
    for (std::size_t i = 0; i < left_.size(); ++i) state_.lambda[i] = first_lambda_[i] + solver.found()[i];
    evaluate(state_.lambda);
    Real moved(0);
    for (std::size_t i = 0; i < first_vdot_.size(); ++i) moved = std::max(moved, abs(state_.vdot[i] - first_vdot_[i]));
    return moved;
  }

  void evaluate(const Equations<M>& lambda) {
    mechanism_.evaluate(state_.q.data(), state_.v.data(), lambda.data(), state_.vdot.data(), correction_.data());
    ++experience_.evaluations;
  }

  Equations<M> first_lambda_, trial_, left_;
  Array<M, static_sizes<M>().equations == 0 ? 0 : static_sizes<M>().speeds> first_vdot_;
};

}  // namespace cutjoint::runge_kutta
