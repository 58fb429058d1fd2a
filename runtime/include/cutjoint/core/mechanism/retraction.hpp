// From coordinates and a step of the speeds' integrals to new coordinates.
#pragma once

#include <cmath>

#include "cutjoint/core/mechanism/mechanism.hpp"

namespace cutjoint {

typedef double Four __attribute__((vector_size(32)));

/// The unit quaternion e turned by the rotation vector theta, by the Cayley map, e' = (1, theta/2)/|.| e/|e|, which agrees with the exponential map
/// to third order and keeps the length without trigonometry.  Numbers are plain ones or vectors of them.
template <class Number>
[[gnu::always_inline]] inline void rotate(const Number (&e)[4], const Number (&theta)[3], Number (&turned)[4]) {
  using std::sqrt;
  const Number x = theta[0] / 2, y = theta[1] / 2, z = theta[2] / 2;
  const Number square = (1 + x * x + y * y + z * z) * (e[0] * e[0] + e[1] * e[1] + e[2] * e[2] + e[3] * e[3]);
  Number scale{};
  if constexpr (std::is_same_v<Number, Four>)
    for (int k = 0; k < 4; ++k) scale[k] = sqrt(square[k]);
  else scale = sqrt(square);
  scale = 1 / scale;
  turned[0] = (e[0] - x * e[1] - y * e[2] - z * e[3]) * scale;
  turned[1] = (e[1] + x * e[0] + y * e[3] - z * e[2]) * scale;
  turned[2] = (e[2] + y * e[0] + z * e[1] - x * e[3]) * scale;
  turned[3] = (e[3] + z * e[0] + x * e[2] - y * e[1]) * scale;
}

/// Four balls side by side.
struct Balls {
  int q[4], v[4];  ///< where their quaternions and speeds begin
  int number = 0;

  void add(const Chart& chart) {
    q[number] = chart.q + chart.scalars;
    v[number++] = chart.v + chart.scalars;
  }

  [[gnu::always_inline]] void rotate(const double* q_0, const double* delta, double* to) {
    for (int k = number; k < 4; ++k) q[k] = q[0], v[k] = v[0];
    Four e[4], theta[3], turned[4];
    for (int i = 0; i < 4; ++i) e[i] = Four{q_0[q[0] + i], q_0[q[1] + i], q_0[q[2] + i], q_0[q[3] + i]};
    for (int i = 0; i < 3; ++i) theta[i] = Four{delta[v[0] + i], delta[v[1] + i], delta[v[2] + i], delta[v[3] + i]};
    cutjoint::rotate(e, theta, turned);
    for (int k = 0; k < 4; ++k)
      for (int i = 0; i < 4; ++i) to[q[k] + i] = turned[i][k];
    number = 0;
  }
};

/// q = q_0 (+) delta: scalars add, quaternions are turned.  It is inlined, so that the caller's flags compile it.
template <class Real>
[[gnu::always_inline]] inline void retract(std::span<const Chart> charts, const Real* q_0, const Real* delta, Real* q) {
  Balls balls;
  for (const Chart& chart : charts) {
    for (int i = 0; i < chart.scalars; ++i) q[chart.q + i] = q_0[chart.q + i] + delta[chart.v + i];
    if (!chart.ball) continue;
    if constexpr (std::is_same_v<Real, double>) {
      balls.add(chart);
      if (balls.number == 4) balls.rotate(q_0, delta, q);
    } else {
      const Real *from = q_0 + chart.q + chart.scalars, *by = delta + chart.v + chart.scalars;
      Real turned[4];
      rotate<Real>({from[0], from[1], from[2], from[3]}, {by[0], by[1], by[2]}, turned);
      std::copy(turned, turned + 4, q + chart.q + chart.scalars);
    }
  }
  if constexpr (std::is_same_v<Real, double>)
    if (balls.number > 0) balls.rotate(q_0, delta, q);
}

/// The place of the first-order states, which stand behind the speeds of the charts.
inline std::size_t first_state(std::span<const Chart> charts) {
  return charts.empty() ? 0 : static_cast<std::size_t>(charts.back().v + charts.back().scalars + (charts.back().ball ? 3 : 0));
}

/// Numbers of the first-order states are copied.
void copy_states(std::span<const Chart> charts, const auto& from, auto to) {
  const std::size_t first = first_state(charts);
  std::copy(from.begin() + static_cast<std::ptrdiff_t>(first), from.end(), to + static_cast<std::ptrdiff_t>(first));
}

/// The retraction of a mechanism or system with these charts; coordinates without charts, natural ones, add.
template <class Numbers>
[[gnu::always_inline]] inline void displace(std::span<const Chart> charts, const Numbers& from, const typename Numbers::value_type* delta, Numbers& to) {
  if (charts.empty())
    for (std::size_t i = 0; i < from.size(); ++i) to[i] = from[i] + delta[i];
  else retract(charts, from.data(), delta, to.data());
}

/// A Taylor step of second order by a time h from a state with accelerations, for coordinates, velocities and time of `to`, which may be that state.
template <class State, class Numbers>
[[gnu::always_inline]] inline void taylor_step(std::span<const Chart> charts, const State& from, typename Numbers::value_type h, Numbers& shift, State& to) {
  for (std::size_t i = 0; i < shift.size(); ++i) {
    shift[i] = h * from.v[i] + h * h / 2 * from.vdot[i];
    to.v[i] = from.v[i] + h * from.vdot[i];
  }
  displace(charts, from.q, shift.data(), to.q);
  to.t = from.t + h;
}

/// How fast the turn of `retract` changes with its rotation vector: d(turn) = T d(theta), T = (1 + theta~/2)/(1 + |theta|^2/4), of each ball's
/// share of delta, by rows.
template <class Real>
void ball_tangents(std::span<const Chart> charts, const Real* delta, Real* T) {
  for (const Chart& chart : charts) {
    if (!chart.ball) continue;
    const Real* theta = delta + chart.v + chart.scalars;
    const Real x = theta[0] / 2, y = theta[1] / 2, z = theta[2] / 2;
    const Real scale = Real(1) / (Real(1) + x * x + y * y + z * z);
    const Real rows[9] = {Real(1), -z, y, z, Real(1), -x, -y, x, Real(1)};
    for (const Real entry : rows) *T++ = scale * entry;
  }
}

/// How fast the rotation vector of `retract` changes with angular velocities, delta' = T^-1 v: with x = theta/2,
/// theta' = omega - x x omega + x (x . omega); scalars have their speeds.
template <class Real>
void chart_rates(std::span<const Chart> charts, const Real* delta, const Real* v, Real* rate) {
  for (const Chart& chart : charts) {
    for (int i = 0; i < chart.scalars; ++i) rate[chart.v + i] = v[chart.v + i];
    if (!chart.ball) continue;
    const int at = chart.v + chart.scalars;
    const Real x = delta[at] / 2, y = delta[at + 1] / 2, z = delta[at + 2] / 2;
    const Real *w = v + at, along = x * w[0] + y * w[1] + z * w[2];
    rate[at] = w[0] - (y * w[2] - z * w[1]) + x * along;
    rate[at + 1] = w[1] - (z * w[0] - x * w[2]) + y * along;
    rate[at + 2] = w[2] - (x * w[1] - y * w[0]) + z * along;
  }
}

/// The derivative of `chart_rates` with respect to time, delta'' of accelerations vdot.
template <class Real>
void chart_accelerations(std::span<const Chart> charts, const Real* delta, const Real* v, const Real* vdot, Real* second) {
  chart_rates<Real>(charts, delta, vdot, second);
  for (const Chart& chart : charts) {
    if (!chart.ball) continue;
    const int at = chart.v + chart.scalars;
    Real rate[3], x[3];
    const Chart here{0, 0, 0, true};
    chart_rates<Real>(std::span(&here, 1), delta + at, v + at, rate);
    const Real* w = v + at;
    for (int i = 0; i < 3; ++i) {
      rate[i] /= 2;
      x[i] = delta[at + i] / 2;
    }
    const Real along = x[0] * w[0] + x[1] * w[1] + x[2] * w[2], turned = rate[0] * w[0] + rate[1] * w[1] + rate[2] * w[2];
    for (int i = 0; i < 3; ++i) {
      const int j = (i + 1) % 3, k = (i + 2) % 3;
      second[at + i] += rate[i] * along + x[i] * turned - (rate[j] * w[k] - rate[k] * w[j]);
    }
  }
}

/// Rates of coordinates, of a quaternion e (0, omega)/2 e with the angular velocity on the left.
template <class Real>
void coordinate_rates(std::span<const Chart> charts, const Real* q, const Real* v, Real* rate) {
  for (const Chart& chart : charts) {
    for (int i = 0; i < chart.scalars; ++i) rate[chart.q + i] = v[chart.v + i];
    if (!chart.ball) continue;
    const Real *w = v + chart.v + chart.scalars, *e = q + chart.q + chart.scalars;
    Real* quaternion_rate = rate + chart.q + chart.scalars;
    quaternion_rate[0] = (-w[0] * e[1] - w[1] * e[2] - w[2] * e[3]) / Real(2);
    quaternion_rate[1] = (w[0] * e[0] + w[1] * e[3] - w[2] * e[2]) / Real(2);
    quaternion_rate[2] = (w[1] * e[0] + w[2] * e[1] - w[0] * e[3]) / Real(2);
    quaternion_rate[3] = (w[2] * e[0] + w[0] * e[2] - w[1] * e[1]) / Real(2);
  }
}

/// Quaternions get their length back.
template <class Real>
void normalise(std::span<const Chart> charts, Real* q) {
  using std::sqrt;
  for (const Chart& chart : charts) {
    if (!chart.ball) continue;
    Real* e = q + chart.q + chart.scalars;
    const Real length = sqrt(e[0] * e[0] + e[1] * e[1] + e[2] * e[2] + e[3] * e[3]);
    for (int i = 0; i < 4; ++i) e[i] /= length;
  }
}

/// Speeds of a rate of change, v = T rate.
template <class Real>
void chart_speeds(std::span<const Chart> charts, const Real* delta, const Real* rate, Real* v) {
  for (const Chart& chart : charts) {
    for (int i = 0; i < chart.scalars; ++i) v[chart.v + i] = rate[chart.v + i];
    if (!chart.ball) continue;
    const int at = chart.v + chart.scalars;
    const Real x = delta[at] / 2, y = delta[at + 1] / 2, z = delta[at + 2] / 2;
    const Real scale = Real(1) / (Real(1) + x * x + y * y + z * z), *r = rate + at;
    v[at] = scale * (r[0] + y * r[2] - z * r[1]);
    v[at + 1] = scale * (r[1] + z * r[0] - x * r[2]);
    v[at + 2] = scale * (r[2] + x * r[1] - y * r[0]);
  }
}

/// The delta of `retract` from q_0 to q, for turns of less than half a revolution.
template <class Real>
void displacement(std::span<const Chart> charts, const Real* q_0, const Real* q, Real* delta) {
  for (const Chart& chart : charts) {
    for (int i = 0; i < chart.scalars; ++i) delta[chart.v + i] = q[chart.q + i] - q_0[chart.q + i];
    if (!chart.ball) continue;
    const Real *a = q + chart.q + chart.scalars, *b = q_0 + chart.q + chart.scalars;
    Real* theta = delta + chart.v + chart.scalars;
    const Real scale = Real(2) / (a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]);
    theta[0] = scale * (a[1] * b[0] - a[0] * b[1] - a[2] * b[3] + a[3] * b[2]);
    theta[1] = scale * (a[2] * b[0] - a[0] * b[2] - a[3] * b[1] + a[1] * b[3]);
    theta[2] = scale * (a[3] * b[0] - a[0] * b[3] - a[1] * b[2] + a[2] * b[1]);
  }
}

}  // namespace cutjoint
