// Derivatives of the end of a part of a step, which is taken as a whole, along directions of its beginning.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

#include "cutjoint/core/coefficients.hpp"
#include "cutjoint/core/rule_derivatives.hpp"

namespace cutjoint {

/// `Derivatives` of a `Simulation` with the formulas of its integrator, over numbers with derivatives, from the closed loops of a part's beginning to those of its end.
///
/// What is found by iteration, the accelerations at the end of the trapezoidal rule, multipliers, and the way to closed loops, goes on until derivatives stay
/// too, so that they are those of the solution.
template <class Simulation, Sized D, Sized S, std::size_t freedoms, class Balance = NoBalance>
class PartDerivatives : public RuleDerivatives<Simulation, D, S, freedoms, Balance> {
 public:
  using Base = RuleDerivatives<Simulation, D, S, freedoms, Balance>;
  using typename Base::M;

 protected:
  using Base::m, Base::n, Base::seeks_multipliers;
  using Base::charts, Base::from_, Base::is_stale_, Base::mechanism_, Base::phi_, Base::phid_, Base::q_, Base::speeds_, Base::stage_, Base::step_, Base::v_, Base::vdot_;
  using Steps = typename Simulation::Steps;
  static constexpr bool is_explicit = requires { typename Steps::Scheme; };

  /// Whether a step begins with the accelerations that the one before has found, before loops are closed at its end.
  static constexpr bool goes_on = !is_explicit && !Base::has_system;

  /// Whether it begins with the slope that the one before has found where its last stage stood, before loops were closed.
  static constexpr bool carries_slope = is_explicit && m > 0;
  Fixed<Dual, M::sizes.coordinates> turn_;  ///< rates of coordinates of that slope
  bool is_slope_known_ = false;             ///< that slope is there where a part begins, in `turn_` and in accelerations
  bool wants_slope_ = false;                ///< it is to be there at the end

  /// Get ready for a part from a state to another; false where its end has no derivative.
  bool find_part(Simulation& simulation, const StateOf<M>& from, const StateOf<M>& end, double h) {
    if constexpr (is_explicit) return true;
    else if constexpr (seeks_multipliers) return this->find_rule(simulation, from, end, h);
    else return starts_by_balance() || (!is_stale_ && h == this->inverse_of_) || this->find_inverse(simulation, from, end, h);
  }

  /// From the beginning of the part to its end along directions; false where that has no derivative.
  bool go(Simulation& simulation, const StateOf<M>& from, const StateOf<M>& end, double h, std::size_t number) {
    M& mechanism = simulation.mechanism();
    if constexpr (is_explicit) return go_by_slopes(mechanism, from, h, number);
    else if constexpr (seeks_multipliers) return this->go_by_rule(mechanism, from, h, number);
    else {
      if constexpr (Base::has_balance)
        if (this->by_balance_) return !(this->has_no_slope_ = !this->go_by_balance(mechanism, from, end, h));
      return this->go_by_fixed_point(mechanism, from, end, h);
    }
  }

  /// Parts that follow get ready anew, not as one before.
  void forget_part() { is_stale_ = true; }
  bool can_get_ready_anew(const StateOf<M>& end) const { return !is_explicit && !seeks_multipliers && this->inverse_at_ != end.t; }

  /// The projection of the part's end; false where loops stay open.
  bool close_end(Simulation& simulation) {
    if constexpr (seeks_multipliers) return this->close_rates(), true;
    else return !(is_explicit || simulation.settings().fixed_point.proximal) || close_loops();
  }

 private:
  /// Begin a part by the balance of forces, where there is one and it has not just failed.
  bool starts_by_balance() {
    this->by_balance_ = Base::has_balance && !this->has_no_slope_;
    this->has_no_slope_ = this->is_settled_ = false;
    return this->by_balance_;
  }

  /// An explicit method, whose last stage begins the next step.
  bool go_by_slopes(M& mechanism, const StateOf<M>& from, double h, std::size_t number) {
    if constexpr (!is_explicit) return false;
    else return go_by_table<typename Steps::Method>(mechanism, from, h, number);
  }

  template <class Table>
  bool go_by_table(M& mechanism, const StateOf<M>& from, double h, std::size_t number) {
    constexpr std::size_t stages = Table::stages - 1;
    std::array<Fixed<Dual, M::sizes.coordinates>, stages> place_slopes;
    std::array<Fixed<Dual, n>, stages> speed_slopes;
    from_ = q_;
    speeds_ = v_;
    stage_ = from;
    for (std::size_t stage = 0;;) {
      if (stage > 0 || !is_slope_known_) coordinate_rates<Dual>(charts(), q_.data(), v_.data(), turn_.data());
      place_slopes[stage] = turn_;
      speed_slopes[stage] = vdot_;
      q_ = from_;
      v_ = speeds_;
      std::array<typename Table::Row::value_type, stages> weights;
      std::copy_n(Table::weights[++stage].begin(), stages, weights.begin());
      add_slopes(Dual(h), weights, place_slopes, q_);
      add_slopes(Dual(h), weights, speed_slopes, v_);
      stage_.t = from.t + Table::nodes[stage].template as<double>() * h;
      mechanism.begin_step(stage_.t, 1.0);
      if (stage == stages && !wants_slope_) break;
      for (std::size_t i = 0; i < q_.size(); ++i) stage_.q[i] = q_[i].value;
      for (std::size_t i = 0; i < n; ++i) stage_.v[i] = v_[i].value;
      if (!this->enter(mechanism, stage_)) return false;
      mechanism_.begin_step(stage_.t, 1.0);
      if (!this->find_accelerations(mechanism, number)) return false;
      if (stage < stages) continue;
      coordinate_rates<Dual>(charts(), q_.data(), v_.data(), turn_.data());
      break;
    }
    this->take_inputs(mechanism);
    mechanism_.begin_step(stage_.t, 1.0);
    normalise<Dual>(charts(), q_.data());
    return true;
  }

  /// The projection of a step's end; false where loops stay open.
  bool close_loops() {
    if constexpr (m > 0) {
      const auto measure = [this] { mechanism_.constraint_residual(q_.data(), v_.data(), phi_.data(), phid_.data()); };
      const bool closed = close(phi_, q_, measure, [this] { retract<Dual>(charts(), from_.data(), step_.data(), q_.data()); }, from_);
      return closed && close(phid_, v_, measure, [this] { for (std::size_t i = 0; i < n; ++i) v_[i] = speeds_[i] + step_[i]; }, speeds_);
    }
    return true;
  }

  /// Moves until a gap and its derivatives are rounding, or the next one leaves no more.
  template <class Numbers, class Measure, class Move>
  bool close(const Fixed<Dual, m>& gap, Numbers& numbers, Measure measure, Move move, Numbers& before) {
    constexpr double rounding = 64 * std::numeric_limits<double>::epsilon();
    double factor = 1.0, last = std::numeric_limits<double>::infinity();
    for (int iteration = 0; iteration < 50; ++iteration) {
      measure();
      const double left = this->largest_share(gap, numbers);
      if (!(left <= std::numeric_limits<double>::max())) return false;
      if (iteration > 0) factor = left / last;
      if (left <= rounding || (factor > 0.5 && left <= 1e-9)) return true;
      before = numbers;
      mechanism_.project(q_.data(), gap.data(), step_.data());
      move();
      if (left * std::min(1.0, factor) <= rounding && iteration > 0) return true;
      last = left;
    }
    return false;
  }
};

}  // namespace cutjoint
