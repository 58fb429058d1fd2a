// What lies between the ends of a step.
#pragma once

#include <span>
#include <vector>

#include "cutjoint/core/retraction.hpp"
#include "cutjoint/state.hpp"

namespace cutjoint::stepping {

/// The polynomial of degree 5 through displacements, their rates and second derivatives at both ends of a step, in the chart of its start; speeds
/// are those of its derivative, the cubic through rates and second derivatives and what the displacement is more than the integral of that one.
/// Of that surplus a speed has the h-th part, so that it must not have the rounding of coordinates: it is that of the displacement as the stages
/// found it.
template <class Real>
class Interpolant {
 public:
  /// For states as long as `like`.
  Interpolant(std::span<const Chart> charts, const State<Real>& like)
      : charts_(charts), q_(like.q), v_(like.v), vdot_(like.vdot), parts_(4, v_), rates_(3, v_), rate_(v_) {}

  /// Between two states with accelerations, a step of h apart; `found` is the displacement as the stages found it.
  void join(Real h, const State<Real>& start, const State<Real>& end, const std::vector<Real>& found) {
    q_ = start.q;
    h_ = h;
    auto &way = parts_[0], &slope = parts_[1], &bend = parts_[2], &second = parts_[3];
    displacement<Real>(charts_, start.q.data(), end.q.data(), way.data());
    chart_rates<Real>(charts_, way.data(), end.v.data(), rate_.data());
    chart_accelerations<Real>(charts_, way.data(), end.v.data(), end.vdot.data(), second.data());
    slope = start.v;
    bend = start.vdot;
    for (std::size_t i = 0; i < way.size(); ++i) {  // Taylor's polynomial, and what the three conditions at the end ask of powers 3 to 5
      const Real v = h_ * slope[i], a = h_ * h_ * bend[i] / 2;
      const Real gap = way[i] - v - a, rate = h_ * rate_[i] - v - 2 * a, curve = h_ * h_ * second[i] - 2 * a;
      const Real change = rate_[i] - slope[i], surplus = found[i] - h_ * (slope[i] + rate_[i]) / 2 - h_ * h_ * (bend[i] - second[i]) / 12;
      rates_[0][i] = 3 * change - 2 * h_ * bend[i] - h_ * second[i];
      rates_[1][i] = h_ * (bend[i] + second[i]) - 2 * change;
      rates_[2][i] = 30 * surplus / h_;
      way[i] = 10 * gap - 4 * rate + curve / 2;
      slope[i] = -15 * gap + 7 * rate - curve;
      bend[i] = 6 * gap - 3 * rate + curve / 2;
    }
    v_ = start.v;
    vdot_ = start.vdot;
  }

  /// The state at the share s of the step: y = (q, v).
  void at(Real s, std::vector<Real>& y) {
    auto& delta = parts_[3];
    for (std::size_t i = 0; i < delta.size(); ++i) {
      const Real a = parts_[0][i], b = parts_[1][i], c = parts_[2][i], v = h_ * v_[i], half = h_ * h_ * vdot_[i] / 2;
      delta[i] = s * (v + s * (half + s * (a + s * (b + s * c))));
      rate_[i] = v_[i] + s * (h_ * vdot_[i] + s * (rates_[0][i] + s * rates_[1][i] + (1 - s) * (1 - s) * rates_[2][i]));
    }
    retract<Real>(charts_, q_.data(), delta.data(), y.data());
    chart_speeds<Real>(charts_, delta.data(), rate_.data(), y.data() + q_.size());
  }

 private:
  std::span<const Chart> charts_;
  std::vector<Real> q_, v_, vdot_;          ///< of the start
  std::vector<std::vector<Real>> parts_;  ///< the factors of s^3, s^4, s^5, and room
  std::vector<std::vector<Real>> rates_;  ///< the factors of s^2, s^3 and s^2 (1 - s)^2 in the rates
  std::vector<Real> rate_;
  Real h_{1};
};

}  // namespace cutjoint::stepping
