// Derivatives of a substep that ends at an event, whose time depends on the seeds.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

#include "cutjoint/core/stepping/coefficients.hpp"
#include "cutjoint/core/simulation/fault.hpp"
#include "cutjoint/core/constraints/impacts.hpp"
#include "cutjoint/core/derivatives/rule_derivatives.hpp"

namespace cutjoint {

/// `Derivatives` of a `Simulation` by a method whose steps end where an event indicator g changes mode.
///
/// The event's time t solves g(x(t), t, p) = level for the interpolant x(t) of the last step.  Hence
///
///     dt = -(g_x dx + g_p dp) / (g_x x' + g_t)        dx at the event = dx at its time + x' dt
///
/// The next substep begins at that time and ends where it did: its length changes by -dt.
template <class Simulation, Sized D, Sized S, std::size_t dofs, class ForceResidual = NoResidual>
class EventDerivatives : public RuleDerivatives<Simulation, D, S, dofs, ForceResidual> {
 public:
  using Base = RuleDerivatives<Simulation, D, S, dofs, ForceResidual>;
  using typename Base::M;
  using Steps = typename Simulation::Steps;

 protected:
  using Base::n, Base::mechanism_, Base::q_, Base::v_;
  using Subject = typename Simulation::Subject;
  static constexpr std::size_t indicators = Base::is_stepped ? Subject::sizes.indicators : 0;

  /// A substep that ends at a fraction `share` of the step taken (which may exceed 1), where `left` indicators change mode.
  struct Cut {
    bool is_made = false;
    double share = 1.0;
    std::size_t left = 0;
    Fixed<std::size_t, indicators> which;

    /// A fault at the first of these indicators.
    Fault fault(Cause cause, double t) const {
      return {.cause = cause, .list = FaultList::indicators, .index = left > 0 ? static_cast<int>(which[0]) : -1, .t = t};
    }
  };

  /// Values at the cut of a step with derivatives at fixed time, and their rates; `end` has those at the end of the step.
  template <class Table, class Stages, std::size_t count>
  void interpolate(const Dual& length, const Fixed<Dual, count>& begin, const Stages& derivatives, Fixed<Dual, count>& end, Fixed<double, count>& rate) const {
    constexpr std::size_t parts = 4 + Table::dense.size();
    const Dual share(cut_.share, (cut_.share - 1.0) / length.value * dt_begin_), left = 1.0 - share;
    [[maybe_unused]] std::array<Fixed<Dual, count>, Table::dense.size()> more{};
    if constexpr (parts > 4)
      for (std::size_t i = 0; i + 4 < parts; ++i) add_derivatives(length, Table::dense[i], derivatives, more[i]);
    for (std::size_t i = 0; i < count; ++i) {
      const Dual shift = end[i] - begin[i], quadratic = length * derivatives[0][i] - shift;
      std::array<Dual, parts> part{begin[i], shift, quadratic, shift - length * derivatives[Table::stages - 1][i] - quadratic};
      if constexpr (parts > 4)
        for (std::size_t k = 4; k < parts; ++k) part[k] = more[k - 4][i];
      Dual sum = part.back();
      double steepness = 0.0;  // by the share
      for (std::size_t k = parts - 2; k > 0; --k) {
        steepness = k % 2 > 0 ? left.value * steepness - sum.value : share.value * steepness + sum.value;
        sum = part[k] + (k % 2 > 0 ? left : share) * sum;
      }
      rate[i] = (sum.value + share.value * steepness) / length.value;
      end[i] = part[0] + share * sum;
    }
  }

  /// From derivatives of coordinates and velocities at the fixed time of the cut to those at the moving time of the event.
  bool shift_to_event([[maybe_unused]] M& mechanism, [[maybe_unused]] const StateOf<M>& end, [[maybe_unused]] std::size_t number) {
    if constexpr (indicators > 0) {
      if (cut_.left == 0) return true;
      const Tangents probe = find_probe_times(number);
      Fixed<Dual, indicators> here, beside;
      evaluate_indicators(end.t, Tangents{}, q_, v_, here);
      auto q = q_;
      auto v = v_;
      move(probe, q, v);
      evaluate_indicators(end.t, probe, q, v, beside);
      bool part = false;
      for (std::size_t k = 0; k < number; ++k)
        for (std::size_t j = 0; j < cut_.left; ++j) {
          const double open = here[cut_.which[j]].derivative[k], change = open == 0.0 ? 0.0 : -probe[k] * open / (beside[cut_.which[j]].derivative[k] - open);
          if (!(change - change == 0.0)) return false;
          if (j == 0) dt_end_[k] = change;
          part = part || std::abs(change - dt_end_[k]) > 1e-6 * std::max(std::abs(change), std::abs(dt_end_[k]));
        }
      if (part && forces_jump(mechanism, end)) return refuse(Cause::simultaneous_events, end.t);
      move(dt_end_, q_, v_);
    }
    return true;
  }

  /// Whether velocities jump at the event.
  bool speeds_jump([[maybe_unused]] const StateOf<M>& end) const {
    if constexpr (can_jump<Subject> && indicators > 0) {
      if (cut_.left == 0) return false;
      double most = 0.0, size = 1.0;
      for (std::size_t i = 0; i < n; ++i) most = std::max(most, std::abs(v_[i].value - end.v[i])), size = std::max(size, std::abs(end.v[i]));
      return most > 1e-6 * size;
    }
    return false;
  }

  bool refuse(Cause cause, double t) {
    refused_ = cut_.fault(cause, t);
    return false;
  }

  Cut cut_;
  Tangents dt_begin_{}, dt_end_{};  ///< derivatives of the times at which a substep begins and ends
  Fixed<double, indicators ? M::sizes.coordinates : 0> qdot_at_event_;  ///< rates of coordinates and velocities at the cut
  Fixed<double, indicators ? n : 0> vdot_at_event_;
  Fault refused_;  ///< why a substep has no derivative

 private:
  /// Times in which the state changes by as much as along each seed.
  Tangents find_probe_times(std::size_t number) const {
    Tangents probe{};
    double rate = 0.0;
    for (const double x : qdot_at_event_) rate = std::max(rate, std::abs(x));
    for (const double x : vdot_at_event_) rate = std::max(rate, std::abs(x));
    for (std::size_t k = 0; k < number; ++k) {
      double size = 0.0;
      for (const Dual& x : q_) size = std::max(size, std::abs(x.derivative[k]));
      for (const Dual& x : v_) size = std::max(size, std::abs(x.derivative[k]));
      probe[k] = size > 0.0 && rate > 0.0 ? size / rate : 1.0;
    }
    return probe;
  }

  template <class Q, class V>
  void move(const Tangents& time, Q& q, V& v) const {
    for (std::size_t i = 0; i < qdot_at_event_.size(); ++i) q[i].derivative += qdot_at_event_[i] * time;
    for (std::size_t i = 0; i < vdot_at_event_.size(); ++i) v[i].derivative += vdot_at_event_[i] * time;
  }

  template <class Q, class V>
  void evaluate_indicators(double t, const Tangents& time, const Q& q, const V& v, Fixed<Dual, indicators>& values) {
    auto& subject = this->subject();
    subject.begin_step(Dual(t, time), 1.0);
    subject.events(q.data(), v.data(), values.data());
  }

  /// Whether accelerations jump at the event.
  bool forces_jump(M& mechanism, const StateOf<M>& end) {
    if (!this->enter(mechanism, end)) return true;
    double most = 0.0, size = 1.0;
    for (std::size_t i = 0; i < n; ++i) {
      most = std::max(most, std::abs(this->vdot_value_[i] - vdot_at_event_[i]));
      size = std::max(size, std::abs(vdot_at_event_[i]));
    }
    return most > 1e-6 * size;
  }
};

}  // namespace cutjoint
