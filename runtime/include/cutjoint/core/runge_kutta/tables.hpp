// Coefficients of explicit Runge-Kutta methods whose last stage is the beginning of the next step.
#pragma once

#include <array>
#include <cstddef>

#include "cutjoint/core/coefficients.hpp"

namespace cutjoint::runge_kutta {

/// The classical method of order 4, with the slope at the end as a fifth stage.  Between its ends the cubic of both slopes (Hermite).
struct ClassicalTable {
  static constexpr int order = 4;
  static constexpr bool adaptive = false;  ///< the error is not estimated
  static constexpr std::size_t stages = 5;
  using Row = Coefficients<stages>;

  static constexpr Row nodes{{{0}, {1, 2}, {1, 2}, {1}, {1}}};
  static constexpr std::array<Row, stages> weights{{
      {},
      {{{1, 2}}},
      {{{0}, {1, 2}}},
      {{{0}, {0}, {1}}},
      {{{1, 6}, {1, 3}, {1, 3}, {1, 6}}},
  }};
  static constexpr Row error{};
  static constexpr Row dense{};  ///< nothing besides the cubic
};

/// The pair of Dormand and Prince, orders 5 and 4, with an interpolant of order 4.  Sources: Dormand and Prince, J. Comput. Appl. Math. 6
/// (1980) 19-26; interpolant: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I (1993), section II.6.
struct DormandPrinceTable {
  static constexpr int order = 5;
  static constexpr bool adaptive = true;
  static constexpr std::size_t stages = 7;
  using Row = Coefficients<stages>;

  static constexpr Row nodes{{{0}, {1, 5}, {3, 10}, {4, 5}, {8, 9}, {1}, {1}}};
  static constexpr std::array<Row, stages> weights{{
      {},
      {{{1, 5}}},
      {{{3, 40}, {9, 40}}},
      {{{44, 45}, {-56, 15}, {32, 9}}},
      {{{19372, 6561}, {-25360, 2187}, {64448, 6561}, {-212, 729}}},
      {{{9017, 3168}, {-355, 33}, {46732, 5247}, {49, 176}, {-5103, 18656}}},
      {{{35, 384}, {0}, {500, 1113}, {125, 192}, {-2187, 6784}, {11, 84}}},
  }};
  static constexpr Row error{{{71, 57600}, {0}, {-71, 16695}, {71, 1920}, {-17253, 339200}, {22, 525}, {-1, 40}}};
  static constexpr Row dense{{{-12715105075, 11282082432},
                              {0},
                              {87487479700, 32700410799},
                              {-10690763975, 1880347072},
                              {701980252875, 199316789632},
                              {-1453857185, 822651844},
                              {69997945, 29380423}}};
};

/// The tolerance of the multipliers in each evaluation, where steps keep to one.
template <class Table, class Real>
Real tolerance_of_multipliers(Real tolerance) {
  return Table::adaptive ? tolerance / 100 : Real(1e-12);
}

}  // namespace cutjoint::runge_kutta
