// Derivatives of a part of a step that ends at an event, whose time changes along directions.
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

/// `Derivatives` of a `Simulation` by a method whose steps end where an indicator g leaves its formula.
///
/// The method goes on from the last whole step by its interpolant x(t), to the time t at which g(x(t), t, p) stands on its level.  So along directions
///
///     dt = -(g_x dx + g_p dp) / (g_x x' + g_t)        dx at the event = dx at its time + x' dt
///
/// The part behind begins then, and ends where it did: it is as much shorter.
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

  /// Where a part ends between the ends of the step that was made, or beyond: at a share of its length, where so many indicators leave their formulas, or none.
  struct Cut {
    bool is_made = false;
    double share = 1.0;
    std::size_t left = 0;
    Fixed<std::size_t, indicators> which;

    /// A fault of a run at one of these indicators.
    Fault fault(Cause cause, double t) const {
      return {.cause = cause, .list = FaultList::indicators, .index = left > 0 ? static_cast<int>(which[0]) : -1, .t = t};
    }
  };

  /// The numbers of a step at its cut, along directions for its present time, and their rates; `end` are those at the end of the step.
  template <class Table, class Stages, std::size_t count>
  void interpolate(const Dual& length, const Fixed<Dual, count>& begin, const Stages& derivatives, Fixed<Dual, count>& end, Fixed<double, count>& rate) const {
    constexpr std::size_t parts = 4 + Table::dense.size();
    const Dual share(cut_.share, (cut_.share - 1.0) / length.value * begun_), left = 1.0 - share;
    [[maybe_unused]] std::array<Fixed<Dual, count>, Table::dense.size()> more{};
    if constexpr (parts > 4)
      for (std::size_t i = 0; i + 4 < parts; ++i) add_derivatives(length, Table::dense[i], derivatives, more[i]);
    for (std::size_t i = 0; i < count; ++i) {
      const Dual shift = end[i] - begin[i], bend = length * derivatives[0][i] - shift;
      std::array<Dual, parts> part{begin[i], shift, bend, shift - length * derivatives[Table::stages - 1][i] - bend};
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

  /// From coordinates and speeds where a part is cut, along directions for the time of that, to those along them where its event then is.
  bool meet_event([[maybe_unused]] M& mechanism, [[maybe_unused]] const StateOf<M>& end, [[maybe_unused]] std::size_t number) {
    if constexpr (indicators > 0) {
      if (cut_.left == 0) return true;
      const Tangents reach = find_reach(number);
      Fixed<Dual, indicators> here, beside;
      look(end.t, Tangents{}, q_, v_, here);
      auto q = q_;
      auto v = v_;
      move(reach, q, v);
      look(end.t, reach, q, v, beside);
      bool part = false;
      for (std::size_t k = 0; k < number; ++k)
        for (std::size_t j = 0; j < cut_.left; ++j) {
          const double open = here[cut_.which[j]].derivative[k], change = open == 0.0 ? 0.0 : -reach[k] * open / (beside[cut_.which[j]].derivative[k] - open);
          if (!(change - change == 0.0)) return false;
          if (j == 0) ended_[k] = change;
          part = part || std::abs(change - ended_[k]) > 1e-6 * std::max(std::abs(change), std::abs(ended_[k]));
        }
      if (part && forces_jump(mechanism, end)) return refuse(Cause::simultaneous_events, end.t);
      move(ended_, q_, v_);
    }
    return true;
  }

  /// Whether the speeds behind an event are others than those that lead there.
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
  Tangents begun_{}, ended_{};  ///< how the time at which a part begins changes along directions, and that at which it ends
  Fixed<double, indicators ? M::sizes.coordinates : 0> turning_;  ///< rates of coordinates and speeds where a part is cut
  Fixed<double, indicators ? n : 0> bending_;
  Fault refused_;  ///< why a part has no derivative

 private:
  /// How far to go in time so that indicators change by as much as along directions.
  Tangents find_reach(std::size_t number) const {
    Tangents reach{};
    double rate = 0.0;
    for (const double x : turning_) rate = std::max(rate, std::abs(x));
    for (const double x : bending_) rate = std::max(rate, std::abs(x));
    for (std::size_t k = 0; k < number; ++k) {
      double size = 0.0;
      for (const Dual& x : q_) size = std::max(size, std::abs(x.derivative[k]));
      for (const Dual& x : v_) size = std::max(size, std::abs(x.derivative[k]));
      reach[k] = size > 0.0 && rate > 0.0 ? size / rate : 1.0;
    }
    return reach;
  }

  template <class Q, class V>
  void move(const Tangents& time, Q& q, V& v) const {
    for (std::size_t i = 0; i < turning_.size(); ++i) q[i].derivative += turning_[i] * time;
    for (std::size_t i = 0; i < bending_.size(); ++i) v[i].derivative += bending_[i] * time;
  }

  template <class Q, class V>
  void look(double t, const Tangents& time, const Q& q, const V& v, Fixed<Dual, indicators>& values) {
    auto& subject = this->subject();
    subject.begin_step(Dual(t, time), 1.0);
    subject.events(q.data(), v.data(), values.data());
  }

  /// Whether accelerations behind the event are others than before it.
  bool forces_jump(M& mechanism, const StateOf<M>& end) {
    if (!this->enter(mechanism, end)) return true;
    double most = 0.0, size = 1.0;
    for (std::size_t i = 0; i < n; ++i) {
      most = std::max(most, std::abs(this->still_[i] - bending_[i]));
      size = std::max(size, std::abs(bending_[i]));
    }
    return most > 1e-6 * size;
  }
};

}  // namespace cutjoint
