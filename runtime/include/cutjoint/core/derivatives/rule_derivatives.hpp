// Derivatives of the end of a step by the trapezoidal rule.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <limits>
#include <type_traits>

#include "cutjoint/core/derivatives/derivatives.hpp"
#include "cutjoint/core/newton/closed_end_derivatives.hpp"
#include "cutjoint/core/newton/step_rule.hpp"

namespace cutjoint {

/// How the beginning of a step of length h, and accelerations at its end, lead there by a rule (StepRule), the trapezoidal one unless it `averages`.
template <class M, bool averages>
class RuleLead {
 public:
  static constexpr std::size_t stages = 1, n = M::sizes.speeds, joints = M::sizes.joint_speeds(), balls = M::sizes.coordinates - joints;

  /// What speeds or coordinates change by: accelerations a of the rule at the beginning, those of the state there, and those at the end.
  struct Shares {
    double mean, begin, end;
  };

  template <class Numbers>
  void begin(const StateOf<M>& from, const Numbers& means, double h, const StepRule& of = {}) {
    const StepRule rule = averages ? of : StepRule{};
    from_ = from.q;
    h_ = h;
    mean_ = {-rule.alpha_m / (1 - rule.alpha_m), rule.alpha_f / (1 - rule.alpha_m), (1 - rule.alpha_f) / (1 - rule.alpha_m)};
    const auto shares = [&](double scale, double all, double by_end) { return Shares{scale * (all - by_end + by_end * mean_.mean), scale * by_end * mean_.begin, scale * by_end * mean_.end}; };
    by_speed_ = shares(h, 1.0, rule.gamma), by_place_ = shares(h * h, 0.5, rule.beta);
    for (std::size_t i = 0; i < n; ++i) {
      speeds_[i] = from.v[i] + by_speed_.mean * means[i], shift_[i] = h * from.v[i] + by_place_.mean * means[i];
      if (averages) speeds_[i] += by_speed_.begin * from.vdot[i], shift_[i] += by_place_.begin * from.vdot[i];
    }
  }

  /// Coordinates and speeds at the end, by accelerations there.
  void lead(StateOf<M>& end) {
    for (std::size_t i = 0; i < n; ++i) delta_[i] = shift_[i] + by_place_.end * end.vdot[i], end.v[i] = speeds_[i] + by_speed_.end * end.vdot[i];
    retract<double>(M::charts, from_.data(), delta_.data(), end.q.data());
  }

  /// Accelerations that lead to these coordinates and states, and the speeds to which they do.
  void find(StateOf<M>& end) {
    displacement<double>(M::charts, from_.data(), end.q.data(), delta_.data());
    for (std::size_t i = 0; i < n; ++i) {
      end.vdot[i] = i < joints ? (delta_[i] - shift_[i]) / by_place_.end : (end.v[i] - speeds_[i]) / by_speed_.end;
      end.v[i] = speeds_[i] + by_speed_.end * end.vdot[i];
    }
    turn();
  }

  /// Derivatives are of the last end from here on.
  void turn() { turning_ = {M::charts, from_.data(), delta_.data()}; }

  const double* delta() const { return delta_.data(); }
  const Shares& by_speed() const { return by_speed_; }
  const Shares& by_place() const { return by_place_; }
  const Shares& by_mean() const { return mean_; }  ///< of accelerations a of the rule at the end

  /// Use each unknown by which a coordinate or speed at the end changes, and how steeply it does.
  template <class Residual, class Use>
  void visit_shares(std::size_t column, std::size_t, std::size_t, Use use) const {
    if (column >= Residual::first_speed) return use(column - Residual::first_speed, by_speed_.end);
    const std::size_t unknown = Residual::unknown_of(column);
    if (!Residual::turns(column)) return use(unknown, by_place_.end);
    const auto [ball, c] = Residual::ball_of(column);
    for (std::size_t k = 0; balls > 0 && k < 3; ++k) use(unknown + k, by_place_.end * turning_[ball].by[c][4 + k]);
  }

  /// In place of changes of coordinates and speeds at the beginning those that they, and accelerations there, make at the end.
  template <class Q, class V>
  void leave(Q& q, V& v, const V& means, const V& before, const Tangents&) const {
    std::array<Along, n> delta;
    for (std::size_t i = 0; i < n; ++i) {
      delta[i].derivative = h_ * v[i].derivative + by_place_.mean * means[i].derivative;
      v[i].derivative += by_speed_.mean * means[i].derivative;
      if (averages) delta[i].derivative += by_place_.begin * before[i].derivative, v[i].derivative += by_speed_.begin * before[i].derivative;
    }
    turning_.jvp(M::charts, delta, q, true);
  }

  /// What accelerations at the end add.
  template <class Q, class V>
  void arrive(const Along* change, Q& q, V& v) const {
    std::array<Along, n> delta;
    for (std::size_t i = 0; i < n; ++i) delta[i] = by_place_.end * change[i], v[i].derivative += by_speed_.end * change[i].derivative;
    turning_.jvp(M::charts, delta, q, false);
  }

  /// From derivatives by coordinates and speeds at the end to those by the beginning, and, added, by accelerations at the end.
  template <class Q, class V, class Point>
  void vjp(const std::array<Q, 1>& by_q, const std::array<V, 1>& by_v, Point& begun, std::array<V, 1>& by_vdot) const {
    V by_delta;
    turning_.vjp(M::charts, by_q[0].data(), begun.q.data(), by_delta.data());
    for (std::size_t i = 0; i < n; ++i) {
      begun.v[i] = by_v[0][i] + h_ * by_delta[i];
      const auto by = [&](double Shares::* share) { return by_speed_.*share * by_v[0][i] + by_place_.*share * by_delta[i]; };
      by_vdot[0][i] += by(&Shares::end);
      begun.vdot[i] = by(averages ? &Shares::begin : &Shares::mean);
      if constexpr (averages) begun.mean[i] = by(&Shares::mean);
    }
  }

 private:
  double h_ = 0.0;
  Shares by_speed_{}, by_place_{}, mean_{};
  Coordinates<M> from_;
  Fixed<double, n> speeds_, shift_, delta_;  ///< where the beginning leads but for accelerations at the end, and the way to the end
  RetractionDerivatives<balls> turning_;
};

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
  using Base::m, Base::n;
  using Base::charts, Base::du_, Base::lambda_, Base::mechanism_, Base::phi_, Base::phid_, Base::q_, Base::v_, Base::values_, Base::vdot_;
  static constexpr std::size_t no_row = std::numeric_limits<std::size_t>::max();
  static constexpr bool is_stepped = requires { typename Simulation::Steps::Scheme; };   ///< steps end at events
  static constexpr bool is_explicit = requires { typename Simulation::Steps::Method; };
  static constexpr bool has_stages = is_stepped && !is_explicit;  ///< that are coupled
  static constexpr bool averages = [] {
    if constexpr (requires { Simulation::Steps::averages; }) return Simulation::Steps::averages;
    return false;
  }();
  static constexpr bool seeks_multipliers = Base::has_system && m > 0 && !has_stages;

  void enter_end(M& mechanism, const StateOf<M>& end) {
    mechanism.begin_step(end.t, 1.0);
    this->take_inputs(mechanism);
    mechanism_.begin_step(end.t, 1.0);
  }

  /// An implicit step along directions, of a length that changes too: its beginning and accelerations in its stages `lead` to coordinates and speeds of these, `solve` finds
  /// how accelerations and multipliers change with what these do.  False where they have no derivatives.
  template <class Lead, class Solve>
  bool go_by(Lead& lead, const StateOf<M>& end, const Tangents& length, Solve solve) {
    std::array<Along, Lead::stages * (n + m)> change;
    before_ = vdot_;
    lead.leave(q_, v_, means(), before_, length);
    for (std::size_t i = 0; i < q_.size(); ++i) q_[i].value = end.q[i];
    for (std::size_t i = 0; i < n; ++i) v_[i].value = end.v[i];
    if (!solve(change)) return false;
    lead.arrive(change.data(), q_, v_);
    const Along* const last = change.data() + change.size() - n - m;
    for (std::size_t i = 0; i < n; ++i) vdot_[i] = {end.vdot[i], last[i].derivative};
    for (std::size_t i = 0; i < m; ++i) lambda_[i] = {end.lambda[i], last[n + i].derivative};
    return true;
  }

  /// The accelerations a of a rule that averages, else those of the state, where a step begins.
  const auto& means() const {
    if constexpr (averages) return mean_;
    else return before_;
  }

  /// Those at the end.
  void average() {
    for (std::size_t i = 0; averages && i < n; ++i)
      mean_[i].derivative = lead_.by_mean().mean * mean_[i].derivative + lead_.by_mean().begin * before_[i].derivative + lead_.by_mean().end * vdot_[i].derivative;
  }

  /// Get ready for a step by the rule.
  void begin_rule(const StateOf<M>& from, double h) {
    if constexpr (averages) lead_.begin(from, means_, h, rule_);
    else lead_.begin(from, from.vdot, h);
  }

  /// The end of a step by the rule along directions; false where the force residual has a derivative there that is no number.
  bool go_by_fixed_point(M& mechanism, const StateOf<M>& from, const StateOf<M>& end, double h) {
    enter_end(mechanism, end);
    if (!(is_settled_ ? linearise_end(end.t, h) : settle_end(mechanism, from, end, h))) return false;  // others may have gone to the beginning
    is_settled_ = true;
    return go_by(lead_, stage_, {}, [this](auto& change) { return this->force_residual_.solve_end(q_, v_, du_, this->dheld_, change); });
  }

  /// The end of a step by the rule, before its loops are closed, in the stage, with the matrix there; false where that is singular.
  bool settle_end(M& mechanism, const StateOf<M>& from, const StateOf<M>& end, double h) {
    begin_rule(from, h);
    if (!settle(mechanism, end, h)) return false;
    lead_.lead(stage_);
    lead_.turn();
    return linearise_end(end.t, h);
  }

  /// The fixed point of plain accelerations and multipliers from those of the end; derivatives of an earlier step correct these as long as errors fall, then those of the
  /// present ones.
  bool settle(M& mechanism, const StateOf<M>& end, double h) {
    stage_ = end;
    double before = std::numeric_limits<double>::infinity();
    for (int iteration = 0; iteration < 30; ++iteration) {
      lead_.lead(stage_);
      mechanism.evaluate(stage_.q.data(), stage_.v.data(), stage_.lambda.data(), values_.data(), this->violation_.data());
      for (std::size_t i = 0; i < n; ++i) values_[i] -= stage_.vdot[i];
      for (std::size_t i = 0; i < m; ++i) stage_.lambda[i] += this->violation_[i];
      const double share = this->size_of(values_) / (1.0 + this->size_of(stage_.vdot));
      if (!(share <= std::numeric_limits<double>::max())) return false;
      if (share == 0.0 || (share > before / 2 && share <= (iteration > 2 ? 1e-5 : 1e-8))) return true;
      if (!this->force_residual_.knows(h) || share > before / 2) lead_.turn();
      const bool has_matrix = this->force_residual_.decompose_end(h, lead_);
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
    return this->force_residual_.decompose_end(h, lead_);
  }

  /// The end of a step as Newton's iteration has left it, its accelerations as its places tell them, with the derivatives of force residual there.
  bool find_rule(M& mechanism, const StateOf<M>& from, const StateOf<M>& end, double h) {
    stage_ = end;
    begin_rule(from, h);
    lead_.find(stage_);
    mechanism.begin_step(end.t, 1.0);
    this->along_ = {};
    this->take_inputs(mechanism);
    return ends_.find(this->force_residual_, lead_, stage_, end);
  }

  /// Its end along directions, with projected speeds and accelerations.
  bool go_by_rule(M& mechanism, const StateOf<M>& end) {
    enter_end(mechanism, end);
    typename ForceResidual::Changes first, change;
    auto& held = this->dheld_;
    const auto solve = [&](auto& found) {
      mechanism_.constraint_residual(q_.data(), v_.data(), phi_.data(), phid_.data());
      const bool is_found = ends_.solve_rule(this->force_residual_, q_, v_, phi_, du_, held, found);
      first = found;
      return is_found;
    };
    if (!go_by(lead_, stage_, {}, solve)) return false;
    speeds_ = v_;
    for (std::size_t i = 0; i < n; ++i) v_[i].value = end.v[i];
    mechanism_.constraint_residual(q_.data(), v_.data(), phi_.data(), phid_.data());
    if (!ends_.solve_speeds(this->force_residual_, q_, speeds_, phid_, du_, held, first, change)) return false;
    for (std::size_t i = 0; i < n; ++i) v_[i].derivative += change[i].derivative;
    if (!ends_.solve_accelerations(this->force_residual_, q_, speeds_, v_, du_, held, first, change)) return false;
    for (std::size_t i = 0; i < n; ++i) vdot_[i] = {end.vdot[i], first[i].derivative + change[i].derivative};
    return true;
  }

  std::size_t loaded_ = no_row;  ///< the first of the directions with whose changes parameters are loaded

  StateOf<M> stage_;
  RuleLead<M, averages> lead_;
  StepRule rule_;
  Fixed<double, averages ? n : 0> means_;  ///< accelerations a of the rule where a part begins
  Fixed<Dual, averages ? n : 0> mean_;
  Fixed<Dual, M::sizes.coordinates> from_;
  Fixed<Dual, n> speeds_, before_;
  bool is_settled_ = false;  ///< the end of a part is found
  double share_left_ = 1.0;                       ///< what the last correction of a step left of its error
  [[no_unique_address]] std::conditional_t<seeks_multipliers, ClosedEndDerivatives<ForceResidual>, typename Base::None> ends_;  ///< whose multipliers close the loops
};

}  // namespace cutjoint
