// Derivatives of the end of a part of a step, which is taken as a whole, along directions of its beginning.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

#include "cutjoint/core/coefficients.hpp"
#include "cutjoint/core/event_derivatives.hpp"

namespace cutjoint {

/// `Derivatives` of a `Simulation` with the formulas of its integrator, over numbers with derivatives, from the closed loops of a part's beginning to those of its end.
///
/// What is found by iteration, the accelerations at the end of the trapezoidal rule, multipliers, and the way to closed loops, goes on until derivatives stay
/// too, so that they are those of the solution.
template <class Simulation, Sized D, Sized S, std::size_t freedoms, class Balance = NoBalance>
class PartDerivatives : public EventDerivatives<Simulation, D, S, freedoms, Balance> {
 public:
  using Base = EventDerivatives<Simulation, D, S, freedoms, Balance>;
  using typename Base::M;

 protected:
  using typename Base::Steps;
  using Base::m, Base::n, Base::is_explicit, Base::seeks_multipliers, Base::switches;
  using Base::begun_, Base::charts, Base::cut_, Base::ended_, Base::from_, Base::is_stale_, Base::mechanism_, Base::phi_, Base::phid_, Base::q_, Base::speeds_, Base::stage_, Base::step_, Base::v_, Base::vdot_;

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
    if constexpr (is_explicit) return go_by_slopes(mechanism, from, end, h, number);
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
  bool go_by_slopes(M& mechanism, const StateOf<M>& from, const StateOf<M>& end, double h, std::size_t number) {
    if constexpr (!is_explicit) return false;
    else return go_by_table<typename Steps::Method>(mechanism, from, end, h, number);
  }

  template <class Table>
  bool go_by_table(M& mechanism, const StateOf<M>& from, const StateOf<M>& end, double h, std::size_t number) {
    constexpr std::size_t last = Table::stages - 1, all = switches > 0 ? Table::all : Table::stages;
    std::array<Fixed<Dual, M::sizes.coordinates>, all> place_slopes;
    std::array<Fixed<Dual, n>, all> speed_slopes;
    const Dual length(h, -begun_);
    from_ = q_;
    speeds_ = v_;
    stage_ = from;
    Dual now;
    const auto lead = [&](std::size_t stage) {
      q_ = from_;
      v_ = speeds_;
      std::array<typename Table::Row::value_type, all> weights;
      std::copy_n(Table::weights[stage].begin(), all, weights.begin());
      add_slopes(length, weights, place_slopes, q_);
      add_slopes(length, weights, speed_slopes, v_);
      const double node = Table::nodes[stage].template as<double>();
      now = Dual(stage_.t = from.t + node * h, (1.0 - node) * begun_);
      mechanism.begin_step(stage_.t, 1.0);
    };
    const auto derive = [&] {
      for (std::size_t i = 0; i < q_.size(); ++i) stage_.q[i] = q_[i].value;
      for (std::size_t i = 0; i < n; ++i) stage_.v[i] = v_[i].value;
      if (!this->enter(mechanism, stage_)) return false;
      mechanism_.begin_step(now, 1.0);
      if (!this->find_accelerations(mechanism, number)) return false;
      coordinate_rates<Dual>(charts(), q_.data(), v_.data(), turn_.data());
      return true;
    };
    const auto keep = [&](std::size_t stage) { place_slopes[stage] = turn_, speed_slopes[stage] = vdot_; };
    if (!is_slope_known_) coordinate_rates<Dual>(charts(), q_.data(), v_.data(), turn_.data());
    for (std::size_t stage = 0; stage < last;) {
      keep(stage);
      lead(++stage);
      if ((stage < last || wants_slope_ || cut_.is_made) && !derive()) return false;
    }
    ended_ = Slopes{};
    if constexpr (switches > 0)
      if (cut_.is_made) {
        keep(last);
        const auto places = q_;
        const auto speeds = v_;
        for (std::size_t stage = Table::stages; stage < all; ++stage) {
          lead(stage);
          if (!derive()) return false;
          keep(stage);
        }
        q_ = places;
        v_ = speeds;
        this->template interpolate<Table>(length, from_, place_slopes, q_, this->turning_);
        this->template interpolate<Table>(length, speeds_, speed_slopes, v_, this->bending_);
        mechanism.begin_step(stage_.t = end.t, 1.0);
        this->take_inputs(mechanism);
        if (!this->meet_event(mechanism, end, number)) return false;
      }
    this->take_inputs(mechanism);
    mechanism_.begin_step(Dual(stage_.t, ended_), 1.0);
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

  /// Whether numbers and their derivatives are so small, as those of a gap that numbers hardly change for are by the rounding of parameters.
  template <class Numbers>
  static bool is_at_most(const Numbers& numbers, double most) {
    const Dual found = Base::largest(numbers);
    for (std::size_t k = 0; k < directions; ++k)
      if (!(found.slope[k] <= most)) return false;
    return found.value <= most;
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
      if (left <= rounding || (iteration > 0 && factor > 0.5 && (left <= 1e-9 || is_at_most(gap, rounding)))) return true;
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
