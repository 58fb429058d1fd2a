// Steps of an explicit Runge-Kutta method, and what lies between their ends.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "cutjoint/core/coefficients.hpp"

namespace cutjoint::runge_kutta {

/// A method whose last stage stands at the end of the step, so that its slope begins the next one.
///
/// Between the ends, with s the share of the step,
///
///     y(s) = y + s (d + (1 - s) (b + s (c + (1 - s) w)))      d = end - y,  b = h f(y) - d,  c = d - h f(end) - b
///
/// where w is h times the slopes weighted by the table's `dense`.
template <class Dynamics, class Table>
class Formula {
 public:
  using Real = typename Dynamics::Real;
  using Vector = typename Dynamics::Vector;

  static constexpr int order = Table::order;

  explicit Formula(Dynamics& dynamics) : dynamics_(dynamics), at_(dynamics.size()), before_(at_) {
    slopes_.fill(at_);
    parts_.fill(at_);
  }

  /// The state has been changed otherwise than by a step: no slope is known.
  void restart() { begun_ = false; }

  /// The slope where the next step begins, if it is known.
  struct Memory {
    Vector slope;
    bool begun;
  };

  Memory memory() const { return {slopes_[0], begun_}; }

  void restore(const Memory& memory) {
    slopes_[0] = memory.slope;
    begun_ = memory.begun;
  }

  /// A step of h from y at t, into `end`; the estimate of its error, into `error`.
  void attempt(Real t, Real h, const Vector& y, Vector& end, Vector& error) {
    if (!begun_) dynamics_.derive(t, y, slopes_[0]);
    begun_ = true;
    for (std::size_t stage = 1; stage < Table::stages; ++stage) {
      if (stage == Table::stages - 1) before_ = at_;
      at_ = y;
      add_slopes(h, Table::weights[stage], slopes_, at_);
      dynamics_.derive(t + Table::nodes[stage].template as<Real>() * h, at_, slopes_[stage]);
    }
    end = at_;
    std::fill(error.begin(), error.end(), Real(0));
    add_slopes(h, Table::error, slopes_, error);
  }

  /// h times the largest eigenvalue, from the last two stages, both at the end (Hairer, Wanner, Solving Ordinary Differential Equations
  /// II, section IV.2); 0 where the stages agree.
  Real stiffness(Real h, const Vector& end) const {
    using std::sqrt;
    Real above(0), below(0);
    for (std::size_t i = 0; i < end.size(); ++i) {
      const Real slope = slopes_[Table::stages - 1][i] - slopes_[Table::stages - 2][i], way = end[i] - before_[i];
      above += slope * slope;
      below += way * way;
    }
    return below > Real(0) ? h * sqrt(above / below) : Real(0);
  }

  /// The attempted step from y counts; its interpolant stays until the next one does.
  void accept(Real h, const Vector& y, const Vector& end) {
    const auto &first = slopes_[0], &last = slopes_[Table::stages - 1];
    std::fill(parts_[4].begin(), parts_[4].end(), Real(0));
    add_slopes(h, Table::dense, slopes_, parts_[4]);
    for (std::size_t i = 0; i < y.size(); ++i) {
      const Real way = end[i] - y[i], bend = h * first[i] - way;
      parts_[0][i] = y[i];
      parts_[1][i] = way;
      parts_[2][i] = bend;
      parts_[3][i] = way - h * last[i] - bend;
    }
    slopes_[0].swap(slopes_[Table::stages - 1]);
  }

  /// The accepted step at the share s of its length; s somewhat above 1 goes on from it.
  void interpolate(Real s, Vector& y) const {
    const Real left = Real(1) - s;
    for (std::size_t i = 0; i < y.size(); ++i)
      y[i] = parts_[0][i] + s * (parts_[1][i] + left * (parts_[2][i] + s * (parts_[3][i] + left * parts_[4][i])));
  }

 private:
  Dynamics& dynamics_;
  Vector at_, before_;
  std::array<Vector, Table::stages> slopes_;
  std::array<Vector, 5> parts_;
  bool begun_ = false;
};

}  // namespace cutjoint::runge_kutta
