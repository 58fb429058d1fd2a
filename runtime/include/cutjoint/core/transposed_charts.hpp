// From slopes by coordinates that charts make to slopes by what they make them of.
#pragma once

#include <array>
#include <cstddef>
#include <span>

#include "cutjoint/core/dual.hpp"
#include "cutjoint/core/retraction.hpp"

namespace cutjoint {

/// The slopes of four numbers of a ball that `make` makes of four and three others, by rows.
using BallSlopes = std::array<double, 28>;

template <class Make>
BallSlopes slopes_of_ball(const double* e, const double* x, Make make) {
  std::array<Dual, 7> from;
  for (std::size_t i = 0; i < 7; ++i) {
    from[i] = i < 4 ? e[i] : x ? x[i - 4] : 0.0;
    from[i].slope[i] = 1.0;
  }
  std::array<Dual, 4> made;
  make(from.data(), from.data() + 4, made.data());
  BallSlopes slopes;
  for (std::size_t i = 0; i < 4; ++i)
    for (std::size_t k = 0; k < 7; ++k) slopes[7 * i + k] = made[i].slope[k];
  return slopes;
}

/// The slopes `by` the four numbers, added to those by the others.
inline void pull_ball(const BallSlopes& slopes, const double* by, double* by_e, double* by_x) {
  for (std::size_t i = 0; i < 4; ++i) {
    for (std::size_t k = 0; k < 4; ++k) by_e[k] += by[i] * slopes[7 * i + k];
    for (std::size_t k = 0; by_x && k < 3; ++k) by_x[k] += by[i] * slopes[7 * i + 4 + k];
  }
}

inline constexpr Chart one_ball[] = {{.q = 0, .v = 0, .scalars = 0, .ball = true}};

/// Of q = q_0 (+) delta, of so many balls.
template <std::size_t balls>
class RetractionSlopes {
 public:
  RetractionSlopes(std::span<const Chart> charts, const double* q_0, const double* delta) : charts_(charts) {
    std::size_t place = 0;
    for (const Chart& chart : charts)
      if (chart.ball)
        slopes_[place++] = slopes_of_ball(q_0 + chart.q + chart.scalars, delta + chart.v + chart.scalars,
                                          [](const Dual* e, const Dual* x, Dual* to) { retract<Dual>(one_ball, e, x, to); });
  }

  void pull(const double* by_q, double* by_q_0, double* by_delta) const {
    std::size_t place = 0;
    for (const Chart& chart : charts_) {
      for (int i = 0; i < chart.scalars; ++i) by_q_0[chart.q + i] += by_q[chart.q + i], by_delta[chart.v + i] += by_q[chart.q + i];
      if (!chart.ball) continue;
      const int q = chart.q + chart.scalars;
      pull_ball(slopes_[place++], by_q + q, by_q_0 + q, by_delta + chart.v + chart.scalars);
    }
  }

 private:
  std::span<const Chart> charts_;
  std::array<BallSlopes, balls> slopes_;
};

/// Of the rates of coordinates.
inline void pull_rates(std::span<const Chart> charts, const double* q, const double* v, const double* by_rate, double* by_q, double* by_v) {
  for (const Chart& chart : charts) {
    for (int i = 0; i < chart.scalars; ++i) by_v[chart.v + i] += by_rate[chart.q + i];
    if (!chart.ball) continue;
    const int e = chart.q + chart.scalars, w = chart.v + chart.scalars;
    const auto make = [](const Dual* e, const Dual* x, Dual* to) { coordinate_rates<Dual>(one_ball, e, x, to); };
    pull_ball(slopes_of_ball(q + e, v + w, make), by_rate + e, by_q + e, by_v + w);
  }
}

/// Of quaternions whose length is made 1; `by` is that of those before, afterwards.
inline void pull_lengths(std::span<const Chart> charts, const double* q, double* by) {
  for (const Chart& chart : charts) {
    if (!chart.ball) continue;
    const int e = chart.q + chart.scalars;
    const std::array<double, 4> behind{by[e], by[e + 1], by[e + 2], by[e + 3]};
    std::fill_n(by + e, 4, 0.0);
    const auto make = [](const Dual* e, const Dual*, Dual* to) {
      std::copy_n(e, 4, to);
      normalise<Dual>(one_ball, to);
    };
    pull_ball(slopes_of_ball(q + e, nullptr, make), behind.data(), by + e, nullptr);
  }
}

}  // namespace cutjoint
