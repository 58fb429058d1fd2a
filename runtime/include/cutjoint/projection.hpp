// Takes positions and velocities to the nearest ones that close the cut joints, nearest as the masses see it.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "cutjoint/mechanism.hpp"
#include "cutjoint/retraction.hpp"
#include "cutjoint/state.hpp"

namespace cutjoint {

/// Projects states of a mechanism; all memory is taken in the constructor.  `begin_step` has been called for the state's time.
///
/// Each iteration is a step of `project` for the gap that is left, so that what a penalty leaves of it is closed by the next one.  It ends
/// when the gap is rounding, or falls no further and is below 1e-10.
template <Mechanism M>
class Projection {
 public:
  using Real = typename M::real_type;

  explicit Projection(M& mechanism)
      : mechanism_(mechanism), d_(mechanism.description()), gap_(d_.equations.size()), other_(gap_.size()), dz_(d_.speeds.size()),
        before_(std::max(d_.coordinates.size(), d_.speeds.size())) {}

  /// Close Phi(q) = 0; returns the iterations.  Throws Failure naming the equation that stays open.
  int positions(State<Real>& state, long number = 0) {
    return close(
        state, number, state.q, gap_, "the loops cannot be closed", [&] { retract<Real>(d_.charts, before_.data(), dz_.data(), state.q.data()); });
  }

  /// Close the rate of Phi, which is linear in the speeds; returns the iterations.  Throws Failure naming the equation that stays open.
  int velocities(State<Real>& state, long number = 0) {
    return close(state, number, state.v, other_, "no speeds keep the loops closed", [&] {
      for (std::size_t i = 0; i < dz_.size(); ++i) state.v[i] = before_[i] + dz_[i];
    });
  }

 private:
  static constexpr int most = 50;

  /// Steps that `move` what is open: the gap is the residual, in gap_, or its rate, in other_.
  template <class Move>
  int close(State<Real>& state, long number, std::vector<Real>& moved, const std::vector<Real>& open, const char* what, Move move) {
    if (gap_.empty()) return 0;
    Real left = measure(state, open);
    const Real size = Real(1) + largest(moved);
    int iteration = 0;
    for (; iteration < most && !(left <= rounding() * size); ++iteration) {
      before_.assign(moved.begin(), moved.end());
      mechanism_.project(state.q.data(), open.data(), dz_.data());
      move();
      const Real next = measure(state, open);
      if (!(next < left)) {
        moved.assign(before_.begin(), before_.end());
        break;
      }
      left = next;
    }
    if (!(left <= allowed(size))) fail(state, number, what, open);
    return iteration;
  }

  Real measure(const State<Real>& state, const std::vector<Real>& open) {
    mechanism_.close(state.q.data(), state.v.data(), gap_.data(), other_.data());
    return largest(open);
  }

  /// A number that is not finite counts as largest.
  static Real largest(const std::vector<Real>& values) {
    using std::abs;
    Real result(0);
    for (const Real value : values)
      if (!(abs(value) <= result)) result = abs(value);
    return result;
  }

  [[noreturn]] void fail(const State<Real>& state, long number, const char* what, const std::vector<Real>& open) {
    const Real left = measure(state, open);
    std::size_t worst = 0;
    using std::abs;
    for (std::size_t i = 0; i < open.size(); ++i)
      if (!(abs(open[i]) <= abs(open[worst]))) worst = i;
    throw Failure(what, static_cast<double>(state.t), number, std::string(d_.equations[worst]), static_cast<double>(left),
                  "take a smaller dt; near a singular pose also a smaller penalty");
  }

  static Real rounding() { return Real(64) * std::numeric_limits<Real>::epsilon(); }

  /// 1e-10 m or rad, or what rounding leaves of large numbers.
  static Real allowed(Real size) { return std::max(Real(1e-10), Real(100) * rounding() * size); }

  M& mechanism_;
  const Description& d_;
  std::vector<Real> gap_, other_, dz_, before_;
};

}  // namespace cutjoint
