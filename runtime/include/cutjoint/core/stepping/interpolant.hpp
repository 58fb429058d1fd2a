// Interpolated states within a step.
#pragma once

#include <array>

#include "cutjoint/core/mechanism/retraction.hpp"
#include "cutjoint/core/mechanism/state.hpp"

namespace cutjoint::stepping {

/// The polynomial of degree 5 through displacements, their rates and second derivatives at both ends of a step, in the chart of its start.
/// Velocities are its derivative: the cubic through rates and second derivatives, plus a term for the difference (surplus) of the displacement and
/// the integral of that cubic.  Dividing the surplus by h would amplify rounding of coordinates, so the displacement is the one computed by
/// the stages.
template <class S>
class Interpolant {
 public:
  using Real = typename S::real_type;
  using Vector = Array<S, static_sizes<S>().coordinates + static_sizes<S>().speeds>;  ///< y = (q, v)

  /// For states of the size of `like`.
  Interpolant(std::span<const Chart> charts, const StateOf<S>& like)
      : charts_(charts), now_{like.q, like.v, like.v, {like.v, like.v, like.v}, {like.v, like.v, like.v}, Real(1)}, delta_(like.v), rate_(like.v) {}

  /// Interpolate between two states with accelerations, a step of h apart; `found` is the displacement computed by the stages.
  void join(Real h, const StateOf<S>& start, const StateOf<S>& end, const Speeds<S>& found) {
    now_.q = start.q;
    now_.h = h;
    auto &shift = now_.parts[0], &derivative = now_.parts[1], &bend = now_.parts[2], &second = delta_;
    displacement<Real>(charts_, start.q.data(), end.q.data(), shift.data());
    chart_rates<Real>(charts_, shift.data(), end.v.data(), rate_.data());
    chart_accelerations<Real>(charts_, shift.data(), end.v.data(), end.vdot.data(), second.data());
    copy_states(charts_, end.v, rate_.begin());
    copy_states(charts_, end.vdot, second.begin());
    derivative = start.v;
    bend = start.vdot;
    for (std::size_t i = 0; i < shift.size(); ++i) {  // Taylor's polynomial, and powers 3 to 5 from the three conditions at the end
      const Real v = h * derivative[i], a = h * h * bend[i] / 2;
      const Real violation = shift[i] - v - a, rate = h * rate_[i] - v - 2 * a, curve = h * h * second[i] - 2 * a;
      const Real change = rate_[i] - derivative[i], surplus = found[i] - h * (derivative[i] + rate_[i]) / 2 - h * h * (bend[i] - second[i]) / 12;
      now_.rates[0][i] = 3 * change - 2 * h * bend[i] - h * second[i];
      now_.rates[1][i] = h * (bend[i] + second[i]) - 2 * change;
      now_.rates[2][i] = 30 * surplus / h;
      shift[i] = 10 * violation - 4 * rate + curve / 2;
      derivative[i] = -15 * violation + 7 * rate - curve;
      bend[i] = 6 * violation - 3 * rate + curve / 2;
    }
    now_.v = start.v;
    now_.vdot = start.vdot;
  }

  /// The state at the fraction s of the step: y = (q, v).
  void at(Real s, Vector& y) {
    const auto& [q, speed, vdot, parts, rates, h] = now_;
    for (std::size_t i = 0; i < delta_.size(); ++i) {
      const Real a = parts[0][i], b = parts[1][i], c = parts[2][i], v = h * speed[i], half = h * h * vdot[i] / 2;
      delta_[i] = s * (v + s * (half + s * (a + s * (b + s * c))));
      rate_[i] = speed[i] + s * (h * vdot[i] + s * (rates[0][i] + s * rates[1][i] + (1 - s) * (1 - s) * rates[2][i]));
    }
    retract<Real>(charts_, q.data(), delta_.data(), y.data());
    chart_speeds<Real>(charts_, delta_.data(), rate_.data(), y.data() + q.size());
    copy_states(charts_, rate_, y.begin() + static_cast<std::ptrdiff_t>(q.size()));
  }

  /// The last step: coordinates, speeds and accelerations of its start, the factors of s^3, s^4, s^5 in displacements, those of s^2, s^3 and
  /// s^2 (1 - s)^2 in rates, and its length.
  struct Memory {
    Coordinates<S> q;
    Speeds<S> v, vdot;
    std::array<Speeds<S>, 3> parts, rates;
    Real h;
  };

  const Memory& memory() const { return now_; }
  void restore(const Memory& memory) { now_ = memory; }

 private:
  std::span<const Chart> charts_;
  Memory now_;
  Speeds<S> delta_, rate_;
};

}  // namespace cutjoint::stepping
