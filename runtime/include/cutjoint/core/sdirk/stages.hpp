// The stages of a diagonally implicit step, by Newton's iteration on the accelerations.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>

#include "cutjoint/core/sdirk/table.hpp"
#include "cutjoint/core/stepping/implicit_stages.hpp"

namespace cutjoint::sdirk {

/// The unknown of a stage is its acceleration, from which follow, with w = h gamma and the sums hat over the stages before,
///
///     v = v_hat + w vdot         delta = delta_hat + w T(delta)^-1 v         q = retract(q_0, delta)
///
/// (stepping/implicit_stages.hpp).  The iteration
///
///     (M + w C + w^2 K + alpha Phi_q^T Phi_q) dvdot = -(M vdot + Phi_q^T lambda - Q + alpha Phi_q^T Phidd),    lambda += alpha (Phidd + Phi_q dvdot)
///
/// keeps its factors over stages and steps while they serve.
template <class S, class Solver>
class Stages : public stepping::ImplicitStages<Stages<S, Solver>, S, Solver, Table> {
  using Base = stepping::ImplicitStages<Stages, S, Solver, Table>;
  friend Base;

 public:
  using typename Base::Real;
  using Base::charts;

  Stages(S& system, Solver& solver, Solver& other, SwitchPlaces<S> switches, const Road<Real>* roads)
      : Base(system, solver, other, std::move(switches), roads), v_hat_(n_), delta_hat_(n_), middle_(this->template repeat<2>(v_hat_)),
        middle_forces_(this->template repeat<2>(push_)) {}

  /// Try a step of length h from the present state; whether its stages were found.  Unless it shall be `whole`, it ends where it leaves the regime.
  bool attempt(Real h, bool whole, long number) {
    this->number_ = number;
    whole_ = whole;
    cells_.begin(start_.t);
    for (std::size_t stage = 1; stage <= Table::stages; ++stage) {
      bool found = false;
      if (try_stage(stage, h, found)) {  // no factors, or no finite value
        factored_ = false;
        leaves();
        return false;
      }
      if (!found) {
        leaves();
        return false;
      }
      if (leaves()) return false;
      cells_.pass(time_);
    }
    at_.lambda = lambda_;
    return true;
  }

  /// Memory of the next steps.
  struct Memory {
    typename Base::Memory common;
    std::array<Speeds<S>, 2> middle;
    std::array<Equations<S>, 2> middle_forces;
  };

  Memory memory() const { return {Base::memory(), middle_, middle_forces_}; }

  void restore(const Memory& memory) {
    Base::restore(memory.common);
    middle_ = memory.middle;
    middle_forces_ = memory.middle_forces;
  }

 private:
  using Base::alpha_, Base::at_, Base::cells_, Base::delta_, Base::f_, Base::factored_, Base::factored_w_, Base::forces_, Base::has_factors_,
      Base::iterations_, Base::lambda_, Base::last_h_, Base::m_, Base::n_, Base::phidd_, Base::pose_, Base::push_, Base::rates_, Base::share_, Base::slopes_,
      Base::slow_, Base::start_, Base::system_, Base::time_, Base::tolerances_, Base::trial_, Base::turns_, Base::whole_, Base::x_;

  static constexpr long at_once = 1;
  static constexpr double shorter = 0.8, longer = 1.25, rest = 0.001;

  void keep_stages() {
    middle_[0].swap(slopes_[4]);
    middle_[1].swap(slopes_[2]);
    middle_forces_[0].swap(forces_[4]);
    middle_forces_[1].swap(forces_[2]);
  }

  /// Whether the attempt leaves the regime with the stage as it is, and shall end there.
  bool leaves() {
    if (cells_.empty()) return false;
    this->look_at(at_);
    cells_.look(time_);
    return cells_.crossed() && !whole_;
  }

  /// Whether a stage is `found`; a fault where an iteration has no factors.
  Fault try_stage(std::size_t stage, Real h, bool& found) {
    time_ = at_.t = start_.t + Table::nodes[stage].template as<Real>() * h;
    system_.begin_step(time_, Real(1));
    v_hat_ = start_.v;
    add_slopes(h, Table::weights[stage], slopes_, v_hat_);
    std::fill(delta_hat_.begin(), delta_hat_.end(), Real(0));
    add_slopes(h, Table::weights[stage], rates_, delta_hat_);
    delta_ = delta_hat_;
    if (stage == 1) {
      extrapolate(h, slopes_[0], middle_, at_.vdot);
      extrapolate(h, forces_[0], middle_forces_, lambda_);
    } else {
      guess(stage, slopes_, at_.vdot);
      guess(stage, forces_, lambda_);
    }
    if (const Fault fault = this->iterate(h, found); fault || !found) return fault;
    chart_rates<Real>(charts(), delta_.data(), at_.v.data(), rates_[stage].data());
    copy_states(charts(), at_.v, rates_[stage].begin());
    slopes_[stage] = at_.vdot;
    forces_[stage] = lambda_;
    return {};
  }

  template <class Numbers>
  static void guess(std::size_t stage, const std::array<Numbers, Table::stages + 1>& known, Numbers& values) {
    std::fill(values.begin(), values.end(), Real(0));
    add_slopes(Real(1), Table::guess[stage], known, values);
  }

  /// The first stage's: on the parabola through the last step's half, three quarters and end, unless that is far behind.
  template <class Numbers>
  void extrapolate(Real h, const Numbers& end, const std::array<Numbers, 2>& middle, Numbers& values) const {
    const Real s = last_h_ > Real(0) && h <= 2 * last_h_ ? h / last_h_ : Real(0);
    for (std::size_t i = 0; i < values.size(); ++i)
      values[i] = s * (s + 1) / 2 * middle[0][i] - s * (s + 2) * middle[1][i] + (s + 1) * (s + 2) / 2 * end[i];
  }

  /// An iteration.  Gaps of the equations are corrected along their directions in the pose of the tangent, Phi_q.  So are the multipliers,
  /// by alpha (Phidd + Phi_q dvdot): where Phi_q has turned, the new Phidd is another one, and alpha would enlarge the difference.
  Fault correct(bool renew, Real w) {
    this->constraint_residual(at_);
    if (renew) {
      this->linearise(at_, Real(0), {w, w * w, alpha_, turns_.data()});
      pose_ = at_.q;
      if (const Fault fault = this->factor()) return fault;
      this->has_factors_ = factored_ = true;
      this->factored_w_ = w;
    } else {
      this->dynamic_residual(at_, Real(0));
    }
    for (std::size_t i = 0; i < m_; ++i) push_[i] = alpha_ * phidd_[i];
    system_.apply_jacobian_transposed(pose_.data(), push_.data(), x_.data());
    for (std::size_t i = 0; i < n_; ++i) x_[i] = -f_[i] - x_[i];
    if (const Fault fault = this->solve()) return fault;
    system_.apply_jacobian(pose_.data(), x_.data(), push_.data());
    for (std::size_t i = 0; i < m_; ++i) lambda_[i] += alpha_ * (phidd_[i] + push_[i]);
    for (std::size_t i = 0; i < n_; ++i) at_.vdot[i] += x_[i];
    return {};
  }

  /// Speeds and coordinates of the stage's accelerations; false where a ball turns too far for its chart.
  bool follow(Real w) {
    using std::abs;
    for (std::size_t i = 0; i < n_; ++i) at_.v[i] = v_hat_[i] + w * at_.vdot[i];
    Real change(1);
    for (int pass = 0; pass < 40 && change > 4 * std::numeric_limits<Real>::epsilon(); ++pass) {
      chart_rates<Real>(charts(), delta_.data(), at_.v.data(), trial_.data());
      copy_states(charts(), at_.v, trial_.begin());
      change = Real(0);
      for (std::size_t i = 0; i < n_; ++i) {
        const Real next = delta_hat_[i] + w * trial_[i];
        change = std::max(change, abs(next - delta_[i]) / (Real(1) + abs(next)));
        delta_[i] = next;
      }
      if (turns_.empty()) change = Real(0);
    }
    retract<Real>(charts(), start_.q.data(), delta_.data(), at_.q.data());
    return change <= 64 * std::numeric_limits<Real>::epsilon();
  }

  /// The largest change of a speed by an iteration beside what its error may be; without that measure, `move`.
  Real size_of_change(Real w, Real& move) {
    using std::abs;
    Real largest(0);
    for (std::size_t i = 0; i < n_; ++i) this->note(w * abs(x_[i]) / tolerances_.of(abs(start_.v[i]), i, n_), i, largest);
    move = w * cutjoint::largest(x_);
    return largest;
  }

  Speeds<S> v_hat_, delta_hat_;
  std::array<Speeds<S>, 2> middle_;            ///< accelerations at a half and three quarters of the step before
  std::array<Equations<S>, 2> middle_forces_;  ///< the same of multipliers
};

}  // namespace cutjoint::sdirk
