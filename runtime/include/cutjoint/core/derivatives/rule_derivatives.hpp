// Derivatives of the end of a step by the trapezoidal rule.
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <type_traits>

#include "cutjoint/core/derivatives/derivatives.hpp"
#include "cutjoint/core/newton/closed_end_derivatives.hpp"

namespace cutjoint {

/// `Derivatives` of a `Simulation` with the formulas of the trapezoidal rule, whose accelerations at the end follow from those to which they lead.
///
/// Newton's iteration has the multipliers at the end among its unknowns, so that Phi = 0 there.  It then closes the rates of loops, and theirs by accelerations, at the
/// smallest cost in the norm of its tangent, which may be that of an earlier step; here that is the norm of the masses, which it comes near to as steps get short.
template <class Simulation, Sized D, Sized S, std::size_t dofs, class ForceResidual = NoResidual>
class RuleDerivatives : public Derivatives<Simulation, D, S, dofs, ForceResidual> {
 public:
  using Base = Derivatives<Simulation, D, S, dofs, ForceResidual>;
  using typename Base::M;

 protected:
  using Base::joints, Base::m, Base::n;
  using Base::charts, Base::delta_, Base::du_, Base::lambda_, Base::mechanism_, Base::phi_, Base::phid_, Base::place_, Base::q_,
      Base::v_, Base::values_, Base::vdot_;
  static constexpr std::size_t no_row = std::numeric_limits<std::size_t>::max();
  static constexpr bool is_stepped = requires { typename Simulation::Steps::Scheme; };   ///< steps end at events
  static constexpr bool is_explicit = requires { typename Simulation::Steps::Method; };
  static constexpr bool has_stages = is_stepped && !is_explicit;  ///< that are coupled
  static constexpr bool seeks_multipliers = Base::has_system && m > 0 && !has_stages;

  void enter_end(M& mechanism, const StateOf<M>& end) {
    mechanism.begin_step(end.t, 1.0);
    this->take_inputs(mechanism);
    mechanism_.begin_step(end.t, 1.0);
  }

  /// The end of a step by the rule along directions; false where the force residual has a derivative there that is no number.
  bool go_by_fixed_point(M& mechanism, const StateOf<M>& from, const StateOf<M>& end, double h) {
    enter_end(mechanism, end);
    if (!(is_settled_ ? linearise_end(end.t, h) : settle_end(mechanism, from, end, h))) return false;  // others may have gone to the beginning
    is_settled_ = true;
    for (std::size_t i = 0; i < n; ++i) {
      shift_[i].derivative = h * v_[i].derivative + h * h / 4 * vdot_[i].derivative;
      v_[i] = {stage_.v[i], v_[i].derivative + h / 2 * vdot_[i].derivative};
    }
    move_along(shift_, 1.0, true);
    typename ForceResidual::Changes change;
    if (!this->force_residual_.solve_end(q_, v_, du_, this->dheld_, change)) return false;
    for (std::size_t i = 0; i < n; ++i) {
      vdot_[i] = {stage_.vdot[i], change[i].derivative};
      v_[i].derivative += h / 2 * change[i].derivative;
    }
    for (std::size_t i = 0; i < m; ++i) lambda_[i] = {stage_.lambda[i], change[n + i].derivative};
    move_along(change, h * h / 4, false);
    for (std::size_t i = 0; i < q_.size(); ++i) q_[i].value = stage_.q[i];
    return true;
  }

  /// The end of a step by the rule, before its loops are closed, in the stage, with the matrix there; false where that is singular.
  bool settle_end(M& mechanism, const StateOf<M>& from, const StateOf<M>& end, double h) {
    for (std::size_t i = 0; i < n; ++i) {
      speeds_[i].value = from.v[i] + h / 2 * from.vdot[i];
      shift_[i].value = h * from.v[i] + h * h / 4 * from.vdot[i];
    }
    if (!settle(mechanism, from, end, h)) return false;
    lead_stage(h);
    return linearise_end(end.t, h);
  }

  /// Derivatives of coordinates that a way, so many times, leads to, from those where it begins, or beside those of another.
  template <class Numbers>
  void move_along(const Numbers& shift, double share, bool from_start) {
    const auto* turn = this->force_residual_.turns();
    for (const Chart& chart : charts()) {
      for (int i = 0; i < chart.scalars; ++i) q_[static_cast<std::size_t>(chart.q + i)].derivative += share * shift[static_cast<std::size_t>(chart.v + i)].derivative;
      if (!chart.ball) continue;
      const auto place = static_cast<std::size_t>(chart.q + chart.scalars), at = static_cast<std::size_t>(chart.v + chart.scalars);
      const auto& by = (turn++)->by;
      Tangents turned[4];
      for (std::size_t c = 0; c < 4; ++c) {
        turned[c] = from_start ? by[c][0] * q_[place].derivative : q_[place + c].derivative;
        for (std::size_t j = 1; j < 4 && from_start; ++j) turned[c] += by[c][j] * q_[place + j].derivative;
        for (std::size_t j = 0; j < 3; ++j) turned[c] += share * by[c][4 + j] * shift[at + j].derivative;
      }
      for (std::size_t c = 0; c < 4; ++c) q_[place + c].derivative = turned[c];
    }
  }

  /// The fixed point of plain accelerations and multipliers from those of the end; derivatives of an earlier step correct these as long as errors fall, then those of the
  /// present ones.
  bool settle(M& mechanism, const StateOf<M>& from, const StateOf<M>& end, double h) {
    from_values_ = from.q;
    stage_ = end;
    double before = std::numeric_limits<double>::infinity();
    for (int iteration = 0; iteration < 30; ++iteration) {
      lead_stage(h);
      mechanism.evaluate(stage_.q.data(), stage_.v.data(), stage_.lambda.data(), values_.data(), this->violation_.data());
      for (std::size_t i = 0; i < n; ++i) values_[i] -= stage_.vdot[i];
      for (std::size_t i = 0; i < m; ++i) stage_.lambda[i] += this->violation_[i];
      const double share = this->size_of(values_) / (1.0 + this->size_of(stage_.vdot));
      if (!(share <= std::numeric_limits<double>::max())) return false;
      if (share == 0.0 || (share > before / 2 && share <= (iteration > 2 ? 1e-5 : 1e-8))) return true;
      const bool has_matrix = this->force_residual_.knows(h) || this->force_residual_.decompose_end(h, charts(), from_values_.data(), place_.data());
      if ((!has_matrix || share > before / 2) && !linearise_end(end.t, h)) return false;
      if (iteration > 0) share_left_ = std::min(1.0, share / before);
      before = share;
      this->force_residual_.correct(values_, this->room_of_forces_);
      for (std::size_t i = 0; i < n; ++i) stage_.vdot[i] += values_[i];
      for (std::size_t i = 0; i < m; ++i) stage_.lambda[i] += this->room_of_forces_[i];
      if (share * share_left_ <= 1e-12) return true;
    }
    return false;
  }

  /// Derivatives of the force residual at the stage, and their matrix; false where that is singular.
  bool linearise_end(double t, double h) {
    this->force_residual_.find(t, stage_.q, stage_.v, stage_.vdot, stage_.lambda, this->u_);
    return this->force_residual_.decompose_end(h, charts(), from_values_.data(), place_.data());
  }

  /// The end of a step as Newton's iteration has left it, its accelerations as its places tell them, with the derivatives of force residual there.
  bool find_rule(M& mechanism, const StateOf<M>& from, const StateOf<M>& end, double h) {
    stage_ = end;
    displacement<double>(charts(), from.q.data(), end.q.data(), place_.data());
    for (std::size_t i = 0; i < n; ++i) {
      stage_.vdot[i] = (i < joints ? 4 / (h * h) * (place_[i] - h * from.v[i]) : 2 / h * (end.v[i] - from.v[i])) - from.vdot[i];
      stage_.v[i] = from.v[i] + h / 2 * (from.vdot[i] + stage_.vdot[i]);
    }
    mechanism.begin_step(end.t, 1.0);
    this->along_ = {};
    this->take_inputs(mechanism);
    return ends_.find(this->force_residual_, h, charts(), from.q.data(), stage_, end);
  }

  /// Its end along directions, with projected speeds and accelerations.
  bool go_by_rule(M& mechanism, const StateOf<M>& from, const StateOf<M>& end, double h) {
    leave_start(from, h);
    for (std::size_t i = 0; i < n; ++i) found_[i] = stage_.vdot[i];
    enter_end(mechanism, end);
    lead(h);
    mechanism_.constraint_residual(q_.data(), v_.data(), phi_.data(), phid_.data());
    typename ForceResidual::Changes first, change;
    auto& held = this->dheld_;
    if (!ends_.solve_rule(this->force_residual_, q_, v_, phi_, du_, held, first)) return false;
    for (std::size_t i = 0; i < n; ++i) found_[i].derivative = first[i].derivative;
    for (std::size_t i = 0; i < m; ++i) lambda_[i] = {end.lambda[i], first[n + i].derivative};
    lead(h);
    speeds_ = v_;
    for (std::size_t i = 0; i < n; ++i) v_[i].value = end.v[i];
    mechanism_.constraint_residual(q_.data(), v_.data(), phi_.data(), phid_.data());
    if (!ends_.solve_speeds(this->force_residual_, q_, speeds_, phid_, du_, held, first, change)) return false;
    for (std::size_t i = 0; i < n; ++i) v_[i].derivative += change[i].derivative;
    if (!ends_.solve_accelerations(this->force_residual_, q_, speeds_, v_, du_, held, first, change)) return false;
    for (std::size_t i = 0; i < n; ++i) vdot_[i] = {end.vdot[i], first[i].derivative + change[i].derivative};
    return true;
  }

  /// Where the beginning leads along directions, but for accelerations at the end.
  void leave_start(const StateOf<M>& from, double h) {
    for (std::size_t i = 0; i < n; ++i) {
      const Dual before(from.vdot[i], vdot_[i]);
      speeds_[i] = v_[i] + h / 2 * before;
      shift_[i] = h * v_[i] + h * h / 4 * before;
    }
    from_ = q_;
  }

  /// Coordinates and speeds to which accelerations at the end lead, of the stage as numbers; `place_` is the way to these.
  void lead_stage(double h) {
    for (std::size_t i = 0; i < n; ++i) {
      stage_.v[i] = speeds_[i].value + h / 2 * stage_.vdot[i];
      place_[i] = shift_[i].value + h * h / 4 * stage_.vdot[i];
    }
    retract<double>(charts(), from_values_.data(), place_.data(), stage_.q.data());
  }

  void lead(double h) {
    for (std::size_t i = 0; i < n; ++i) {
      v_[i] = speeds_[i] + h / 2 * found_[i];
      delta_[i] = shift_[i] + h * h / 4 * found_[i];
    }
    retract<Dual>(charts(), from_.data(), delta_.data(), q_.data());
  }

  std::size_t loaded_ = no_row;  ///< the first of the directions with whose changes parameters are loaded

  StateOf<M> stage_{M::sizes.coordinates, n, m};
  Fixed<Dual, M::sizes.coordinates> from_;
  Coordinates<M> from_values_;
  Fixed<Dual, n> speeds_, shift_, found_;
  bool is_settled_ = false;  ///< the end of a part is found
  double share_left_ = 1.0;                       ///< what the last correction of a step left of its error
  [[no_unique_address]] std::conditional_t<seeks_multipliers, ClosedEndDerivatives<ForceResidual>, typename Base::None> ends_;  ///< whose multipliers close the loops
};

}  // namespace cutjoint
