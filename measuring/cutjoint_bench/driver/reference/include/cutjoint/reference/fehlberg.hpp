// A Runge-Kutta method of order 8 whose coefficients are fractions: exact in any precision.
#pragma once

#include <cstddef>
#include <vector>

#include "cutjoint/core/stepping/coefficients.hpp"

namespace cutjoint::reference {

/// Fehlberg's formula RK7(8) with its thirteen stages, and the difference of a step from two half ones as estimate: its own estimate does
/// not see what depends on time alone, nor a force that follows a road.  Source: Fehlberg, NASA TR R-287 (1968), table X.
template <class Dynamics>
class Fehlberg {
 public:
  using Real = typename Dynamics::Real;

  static constexpr int order = 8;  ///< of the estimate of the error

  explicit Fehlberg(Dynamics& dynamics) : dynamics_(dynamics), at_(dynamics.size()), middle_(at_), derivatives_(stages, at_) {}

  /// A step of h from y at t in two halves, into `end`; the estimate of its error, into `error`.
  void attempt(Real t, Real h, const std::vector<Real>& y, std::vector<Real>& end, std::vector<Real>& error) {
    step(t, h, y, error);
    step(t, h / 2, y, middle_);
    step(t + h / 2, h / 2, middle_, end);
    for (std::size_t i = 0; i < y.size(); ++i) error[i] = (end[i] - error[i]) / Real(255);
  }

 private:
  void step(Real t, Real h, const std::vector<Real>& y, std::vector<Real>& end) {
    for (std::size_t stage = 0; stage < stages; ++stage) {
      at_ = y;
      add_derivatives(h, weights[stage], derivatives_, at_);
      dynamics_.derive(t + nodes[stage].template as<Real>() * h, at_, derivatives_[stage]);
    }
    end = y;
    add_derivatives(h, result, derivatives_, end);
  }

  static constexpr std::size_t stages = 13;
  using Row = Coefficients<stages>;

  static constexpr Row nodes{{{0}, {2, 27}, {1, 9}, {1, 6}, {5, 12}, {1, 2}, {5, 6}, {1, 6}, {2, 3}, {1, 3}, {1}, {0}, {1}}};

  static constexpr std::array<Row, stages> weights{{
      {},
      {{{2, 27}}},
      {{{1, 36}, {1, 12}}},
      {{{1, 24}, {0}, {1, 8}}},
      {{{5, 12}, {0}, {-25, 16}, {25, 16}}},
      {{{1, 20}, {0}, {0}, {1, 4}, {1, 5}}},
      {{{-25, 108}, {0}, {0}, {125, 108}, {-65, 27}, {125, 54}}},
      {{{31, 300}, {0}, {0}, {0}, {61, 225}, {-2, 9}, {13, 900}}},
      {{{2}, {0}, {0}, {-53, 6}, {704, 45}, {-107, 9}, {67, 90}, {3}}},
      {{{-91, 108}, {0}, {0}, {23, 108}, {-976, 135}, {311, 54}, {-19, 60}, {17, 6}, {-1, 12}}},
      {{{2383, 4100}, {0}, {0}, {-341, 164}, {4496, 1025}, {-301, 82}, {2133, 4100}, {45, 82}, {45, 164}, {18, 41}}},
      {{{3, 205}, {0}, {0}, {0}, {0}, {-6, 41}, {-3, 205}, {-3, 41}, {3, 41}, {6, 41}}},
      {{{-1777, 4100}, {0}, {0}, {-341, 164}, {4496, 1025}, {-289, 82}, {2193, 4100}, {51, 82}, {33, 164}, {12, 41}, {0}, {1}}},
  }};

  static constexpr Row result{
      {{0}, {0}, {0}, {0}, {0}, {34, 105}, {9, 35}, {9, 35}, {9, 280}, {9, 280}, {0}, {41, 840}, {41, 840}}};

  Dynamics& dynamics_;
  std::vector<Real> at_, middle_;
  std::vector<std::vector<Real>> derivatives_;
};

}  // namespace cutjoint::reference
