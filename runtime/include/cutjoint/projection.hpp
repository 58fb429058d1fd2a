// Takes positions and velocities to the nearest ones that close the cut joints, nearest as the masses see it.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "cutjoint/largest.hpp"
#include "cutjoint/mechanism.hpp"
#include "cutjoint/retraction.hpp"
#include "cutjoint/state.hpp"

namespace cutjoint {

/// Projects states of a mechanism; all memory is taken in the constructor.  `begin_step` has been called for the state's time.
///
/// Each iteration is a step of `project` for the gap that is left, so that what a penalty leaves of it is closed by the next one.  Where that
/// leaves much, near a singular pose, T w = gap is solved with T = -Phi_v project, and `project` w closes it; directions in which T is below
/// 1e-6 are left alone, since closing them would take a leap.  It ends when the gap is rounding, or falls no further and is
/// below 1e-10; what is left in such directions may be 1e-6.
template <Mechanism M>
class Projection {
 public:
  using Real = typename M::real_type;

  explicit Projection(M& mechanism)
      : mechanism_(mechanism), d_(mechanism.description()), gap_(d_.equations.size()), other_(gap_.size()), dz_(d_.speeds.size()),
        before_(std::max(d_.coordinates.size(), d_.speeds.size())), right_(gap_.size()), rest_(gap_.size()),
        scratch_(gap_.size()), still_(dz_.size()),
        tries_(std::min(std::size_t(24), gap_.size()), Try{gap_, dz_, gap_}) {}

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

  /// One step of each towards closed loops, whatever is left: the same cost always.
  void approach(State<Real>& state) {
    if (gap_.empty()) return;
    measure(state, gap_);
    mechanism_.project(state.q.data(), gap_.data(), dz_.data());
    before_.assign(state.q.begin(), state.q.end());
    retract<Real>(d_.charts, before_.data(), dz_.data(), state.q.data());
    measure(state, other_);
    mechanism_.project(state.q.data(), other_.data(), dz_.data());
    for (std::size_t i = 0; i < dz_.size(); ++i) state.v[i] += dz_[i];
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
    bool weak = false, singular = false;
    for (; iteration < most && !(left <= rounding() * size); ++iteration) {
      before_.assign(moved.begin(), moved.end());
      if (weak) singular = !solve(state, open);
      else mechanism_.project(state.q.data(), open.data(), dz_.data());
      move();
      const Real next = measure(state, open);
      if (!(next < left)) moved.assign(before_.begin(), before_.end());
      if (weak && !(next < left / 2)) {
        left = std::min(next, left);
        break;
      }
      weak = !(next < left / 10);
      left = std::min(next, left);
      if (weak) measure(state, open);
    }
    if (!(left <= (singular ? Real(1e-6) * size : allowed(size)))) fail(state, number, what, open);
    return iteration;
  }

  /// dz = project(w) with T w = open, by residuals that fall (Eisenstat, Elman, Schultz 1983: GCR); whether they found all of w.
  bool solve(const State<Real>& state, const std::vector<Real>& open) {
    using std::sqrt;
    right_.assign(open.begin(), open.end());
    std::fill(dz_.begin(), dz_.end(), Real(0));
    mechanism_.constraint_residual(state.q.data(), still_.data(), scratch_.data(), rest_.data());
    const Real enough = dot(right_, right_) * Real(1e-12);
    for (std::size_t n = 0; n < tries_.size() && dot(right_, right_) > enough; ++n) {
      Try& now = tries_[n];
      now.gap.assign(right_.begin(), right_.end());
      mechanism_.project(state.q.data(), now.gap.data(), now.step.data());
      mechanism_.constraint_residual(state.q.data(), now.step.data(), scratch_.data(), now.closed.data());
      for (std::size_t i = 0; i < rest_.size(); ++i) now.closed[i] = rest_[i] - now.closed[i];
      for (std::size_t k = 0; k < n; ++k) now.add(-dot(now.closed, tries_[k].closed), tries_[k]);
      const Real size = sqrt(dot(now.closed, now.closed));
      if (!(size > Real(1e-6) * sqrt(dot(now.gap, now.gap)))) return false;
      now.scale(Real(1) / size);
      const Real share = dot(right_, now.closed);
      add(dz_, share, now.step);
      add(right_, -share, now.closed);
    }
    return dot(right_, right_) <= enough;
  }

  /// A gap, the step that answers it, and what this closes, -Phi_v step.
  struct Try {
    std::vector<Real> gap, step, closed;

    void add(Real factor, const Try& other) {
      Projection::add(gap, factor, other.gap);
      Projection::add(step, factor, other.step);
      Projection::add(closed, factor, other.closed);
    }

    void scale(Real factor) {
      for (std::vector<Real>* values : {&gap, &step, &closed})
        for (Real& value : *values) value *= factor;
    }
  };

  static void add(std::vector<Real>& sum, Real factor, const std::vector<Real>& part) {
    for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += factor * part[i];
  }

  static Real dot(const std::vector<Real>& a, const std::vector<Real>& b) {
    Real result(0);
    for (std::size_t i = 0; i < a.size(); ++i) result += a[i] * b[i];
    return result;
  }

  Real measure(const State<Real>& state, const std::vector<Real>& open) {
    mechanism_.constraint_residual(state.q.data(), state.v.data(), gap_.data(), other_.data());
    return largest(open);
  }

  [[noreturn]] void fail(const State<Real>& state, long number, const char* what, const std::vector<Real>& open) {
    const Real left = measure(state, open);
    std::size_t worst = 0;
    using std::abs;
    for (std::size_t i = 0; i < open.size(); ++i)
      if (abs(open[i]) > abs(open[worst]) || open[i] != open[i]) worst = i;
    throw Failure(what, static_cast<double>(state.t), number, std::string(d_.equations[worst]), static_cast<double>(left),
                  "not tried: a smaller dt");
  }

  static Real rounding() { return Real(64) * std::numeric_limits<Real>::epsilon(); }

  /// 1e-10 m or rad, or what rounding leaves of large numbers.
  static Real allowed(Real size) { return std::max(Real(1e-10), Real(100) * rounding() * size); }

  M& mechanism_;
  const Description& d_;
  std::vector<Real> gap_, other_, dz_, before_;
  std::vector<Real> right_, rest_, scratch_, still_;
  std::vector<Try> tries_;
};

}  // namespace cutjoint
