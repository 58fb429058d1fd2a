// Derivatives of what charts make of coordinates, and their transposes.
#pragma once

#include <array>

#include "cutjoint/core/numbers/dual.hpp"
#include "cutjoint/core/mechanism/retraction.hpp"

namespace cutjoint {

/// The derivatives of four numbers of a ball by four others and by three.
struct BallDerivatives {
  double by[4][7];
};

/// Of what `rotate` makes of e and theta.
inline BallDerivatives turn_derivatives(const double* e, const double* theta) {
  const double x = theta[0] / 2, y = theta[1] / 2, z = theta[2] / 2, square = e[0] * e[0] + e[1] * e[1] + e[2] * e[2] + e[3] * e[3];
  const double share = 1.0 / (1.0 + x * x + y * y + z * z), scale = std::sqrt(share / square), half = scale / 2;
  BallDerivatives found{{{scale, -x * scale, -y * scale, -z * scale, -e[1] * half, -e[2] * half, -e[3] * half},
                    {x * scale, scale, -z * scale, y * scale, e[0] * half, e[3] * half, -e[2] * half},
                    {y * scale, z * scale, scale, -x * scale, -e[3] * half, e[0] * half, e[1] * half},
                    {z * scale, -y * scale, x * scale, scale, e[2] * half, -e[1] * half, e[0] * half}}};
  const double lengths[7] = {e[0] / square, e[1] / square, e[2] / square, e[3] / square, x / 2 * share, y / 2 * share, z / 2 * share};
  for (auto& row : found.by) {
    const double turned = row[0] * e[0] + row[1] * e[1] + row[2] * e[2] + row[3] * e[3];
    for (std::size_t k = 0; k < 7; ++k) row[k] -= turned * lengths[k];
  }
  return found;
}

/// Of what `make` makes of numbers.
BallDerivatives derivatives_of_ball(const double* e, const double* x, auto make) {
  std::array<Dual, 7> from;
  for (std::size_t i = 0; i < 7; ++i) {
    from[i] = i < 4 ? e[i] : x ? x[i - 4] : 0.0;
    from[i].derivative[i] = 1.0;
  }
  std::array<Dual, 4> made;
  make(from.data(), from.data() + 4, made.data());
  BallDerivatives derivatives;
  for (std::size_t i = 0; i < 4; ++i)
    for (std::size_t k = 0; k < 7; ++k) derivatives.by[i][k] = made[i].derivative[k];
  return derivatives;
}

/// The derivatives `by` the four numbers, added to those by the others.
inline void ball_vjp(const BallDerivatives& derivatives, const double* by, double* by_e, double* by_x) {
  for (std::size_t i = 0; i < 4; ++i) {
    for (std::size_t k = 0; k < 4; ++k) by_e[k] += by[i] * derivatives.by[i][k];
    for (std::size_t k = 0; by_x && k < 3; ++k) by_x[k] += by[i] * derivatives.by[i][4 + k];
  }
}

inline constexpr Chart one_ball[] = {{.q = 0, .v = 0, .scalars = 0, .ball = true}};

/// Of q = q_0 (+) delta, of so many balls.
template <std::size_t balls>
class RetractionDerivatives {
 public:
  RetractionDerivatives() = default;
  RetractionDerivatives(std::span<const Chart> charts, const double* q_0, const double* delta) {
    std::size_t place = 0;
    for (const Chart& chart : charts)
      if (chart.ball) by_[place++] = turn_derivatives(q_0 + chart.q + chart.scalars, delta + chart.v + chart.scalars);
  }

  const BallDerivatives& operator[](std::size_t ball) const { return by_[ball]; }

  /// How q changes along directions with delta: in place of the change of q_0, or beside what another change of delta has made.
  void jvp(std::span<const Chart> charts, const auto& delta, auto& q, bool from_start) const {
    std::size_t place = 0;
    for (const Chart& chart : charts) {
      for (int i = 0; i < chart.scalars; ++i) q[static_cast<std::size_t>(chart.q + i)].derivative += delta[static_cast<std::size_t>(chart.v + i)].derivative;
      if (balls == 0 || !chart.ball) continue;
      const auto e = static_cast<std::size_t>(chart.q + chart.scalars), w = static_cast<std::size_t>(chart.v + chart.scalars);
      Tangents turned[4];
      for (std::size_t c = 0; c < 4; ++c) {
        turned[c] = from_start ? by_[place].by[c][0] * q[e].derivative : q[e + c].derivative;
        for (std::size_t j = from_start ? 1 : 4; j < 7; ++j) turned[c] += by_[place].by[c][j] * (j < 4 ? q[e + j].derivative : delta[w + j - 4].derivative);
      }
      for (std::size_t c = 0; c < 4; ++c) q[e + c].derivative = turned[c];
      ++place;
    }
  }

  void vjp(std::span<const Chart> charts, const double* by_q, double* by_q_0, double* by_delta) const {
    std::size_t place = 0;
    for (const Chart& chart : charts) {
      for (int i = 0; i < chart.scalars; ++i) by_q_0[chart.q + i] += by_q[chart.q + i], by_delta[chart.v + i] += by_q[chart.q + i];
      if (!chart.ball) continue;
      const int q = chart.q + chart.scalars;
      ball_vjp(by_[place++], by_q + q, by_q_0 + q, by_delta + chart.v + chart.scalars);
    }
  }

 private:
  std::array<BallDerivatives, balls> by_;
};

/// Of the rates of coordinates.
inline void rates_vjp(std::span<const Chart> charts, const double* q, const double* v, const double* by_rate, double* by_q, double* by_v) {
  for (const Chart& chart : charts) {
    for (int i = 0; i < chart.scalars; ++i) by_v[chart.v + i] += by_rate[chart.q + i];
    if (!chart.ball) continue;
    const int e = chart.q + chart.scalars, w = chart.v + chart.scalars;
    const auto make = [](const Dual* e, const Dual* x, Dual* to) { coordinate_rates<Dual>(one_ball, e, x, to); };
    ball_vjp(derivatives_of_ball(q + e, v + w, make), by_rate + e, by_q + e, by_v + w);
  }
}

/// Of quaternions whose length is made 1; `by` is that of those before, afterwards.
inline void lengths_vjp(std::span<const Chart> charts, const double* q, double* by) {
  for (const Chart& chart : charts) {
    if (!chart.ball) continue;
    const int e = chart.q + chart.scalars;
    const std::array<double, 4> behind{by[e], by[e + 1], by[e + 2], by[e + 3]};
    std::fill_n(by + e, 4, 0.0);
    const auto make = [](const Dual* e, const Dual*, Dual* to) {
      std::copy_n(e, 4, to);
      normalise<Dual>(one_ball, to);
    };
    ball_vjp(derivatives_of_ball(q + e, nullptr, make), behind.data(), by + e, nullptr);
  }
}

}  // namespace cutjoint
