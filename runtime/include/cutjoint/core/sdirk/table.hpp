// Coefficients of a diagonally implicit Runge-Kutta method.
#pragma once

#include <array>
#include <cstddef>

#include "cutjoint/core/coefficients.hpp"

namespace cutjoint::sdirk {

/// The L-stable method of order 4 whose last stage is the end of the step, with an estimate of order 3.  Source: Hairer, Wanner, Solving Ordinary
/// Differential Equations II (1996), section IV.6, eq. 6.16.  In each row the slope at the step's start comes before those of the stages.
struct Table {
  static constexpr int order = 4;
  static constexpr std::size_t stages = 5;
  using Row = Coefficients<stages + 1>;

  static constexpr Fraction gamma{1, 4};  ///< on the diagonal
  static constexpr Row nodes{{{0}, {1, 4}, {3, 4}, {11, 20}, {1, 2}, {1}}};
  /// Below the diagonal.
  static constexpr std::array<Row, stages + 1> weights{{
      {},
      {},
      {{{0}, {1, 2}}},
      {{{0}, {17, 50}, {-1, 25}}},
      {{{0}, {371, 1360}, {-137, 2720}, {15, 544}}},
      {{{0}, {25, 24}, {-49, 48}, {125, 16}, {-85, 12}}},
  }};
  static constexpr Row error{{{0}, {-3, 16}, {-27, 32}, {25, 32}, {0}, {1, 4}}};

  /// The guessed slopes of the stages after the first: on a polynomial through those before.
  static constexpr std::array<Row, stages + 1> guess{{
      {},
      {},
      {{{-2}, {3}}},
      {{{-8, 25}, {22, 25}, {11, 25}}},
      {{{-1, 33}, {1, 6}, {-1, 12}, {125, 132}}},
      {{{-1}, {4}, {4}, {0}, {-6}}},
  }};
};

}  // namespace cutjoint::sdirk
