// From coordinates and a step of the speeds' integrals to new coordinates.
#pragma once

#include <span>

#include "cutjoint/mechanism.hpp"

namespace cutjoint {

/// q = q_0 (+) delta: scalars add; a quaternion is turned by the Cayley map of its rotation vector theta, e = (1, theta/2)/|.| e_0,
/// which agrees with the exponential map to third order and keeps the length without trigonometry.
template <class Real>
void retract(std::span<const Chart> charts, const Real* q_0, const Real* delta, Real* q) {
  using std::sqrt;
  for (const Chart& chart : charts) {
    for (int i = 0; i < chart.scalars; ++i) q[chart.q + i] = q_0[chart.q + i] + delta[chart.v + i];
    if (!chart.ball) continue;
    const Real* theta = delta + chart.v + chart.scalars;
    const Real* e = q_0 + chart.q + chart.scalars;
    const Real x = theta[0] / 2, y = theta[1] / 2, z = theta[2] / 2;
    const Real scale = Real(1) / sqrt((Real(1) + x * x + y * y + z * z) * (e[0] * e[0] + e[1] * e[1] + e[2] * e[2] + e[3] * e[3]));
    Real* out = q + chart.q + chart.scalars;
    const Real w0 = e[0] - x * e[1] - y * e[2] - z * e[3];
    const Real w1 = e[1] + x * e[0] + y * e[3] - z * e[2];
    const Real w2 = e[2] + y * e[0] + z * e[1] - x * e[3];
    const Real w3 = e[3] + z * e[0] + x * e[2] - y * e[1];
    out[0] = w0 * scale;
    out[1] = w1 * scale;
    out[2] = w2 * scale;
    out[3] = w3 * scale;
  }
}

/// How fast the turn of `retract` changes with its rotation vector: d(turn) = T d(theta), T = (1 + theta~/2)/(1 + |theta|^2/4), of each ball's
/// share of delta, by rows.
template <class Real>
void turn_matrices(std::span<const Chart> charts, const Real* delta, Real* T) {
  for (const Chart& chart : charts) {
    if (!chart.ball) continue;
    const Real* theta = delta + chart.v + chart.scalars;
    const Real x = theta[0] / 2, y = theta[1] / 2, z = theta[2] / 2;
    const Real scale = Real(1) / (Real(1) + x * x + y * y + z * z);
    const Real rows[9] = {Real(1), -z, y, z, Real(1), -x, -y, x, Real(1)};
    for (const Real entry : rows) *T++ = scale * entry;
  }
}

}  // namespace cutjoint
