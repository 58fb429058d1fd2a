// Takes positions and velocities to the nearest ones that close the cut joints, nearest as the masses see it.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>

#include "cutjoint/core/arrays.hpp"
#include "cutjoint/core/dot.hpp"
#include "cutjoint/core/fault.hpp"
#include "cutjoint/core/largest.hpp"
#include "cutjoint/core/mechanism.hpp"
#include "cutjoint/core/retraction.hpp"
#include "cutjoint/core/state.hpp"

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
      : mechanism_(mechanism), gap_(sizes_of(mechanism).equations), other_(gap_.size()), dz_(sizes_of(mechanism).speeds),
        before_(std::max(sizes_of(mechanism).coordinates, dz_.size())), right_(gap_.size()), rest_(gap_.size()), scratch_(gap_.size()),
        still_(dz_.size()), number_of_tries_(std::min(most_tries, gap_.size())), tries_(number_of_tries_, Try{gap_, dz_, gap_}) {}

  /// Close Phi(q) = 0.  A fault names the equation that stays open.
  Fault positions(StateOf<M>& state, long number = 0) {
    return close(state, number, state.q, gap_, Cause::loops_open,
                 [&] { retract<Real>(charts_of(mechanism_), before_.data(), dz_.data(), state.q.data()); });
  }

  /// Close the rate of Phi, which is linear in the speeds.  A fault names the equation that stays open.
  Fault velocities(StateOf<M>& state, long number = 0) {
    return close(state, number, state.v, other_, Cause::speeds_open, [&] {
      for (std::size_t i = 0; i < dz_.size(); ++i) state.v[i] = before_[i] + dz_[i];
    });
  }

  /// Both, at the time of a state.
  Fault close(StateOf<M>& state) {
    mechanism_.begin_step(state.t, Real(1));
    if (const Fault fault = positions(state)) return fault;
    return velocities(state);
  }

  /// Iterations of the last positions or speeds.
  int iterations() const { return iterations_; }

  /// One step of each towards closed loops, whatever is left: the same cost always.
  void approach(StateOf<M>& state) {
    if (gap_.empty()) return;
    measure(state, gap_);
    mechanism_.project(state.q.data(), gap_.data(), dz_.data());
    std::copy(state.q.begin(), state.q.end(), before_.begin());
    retract<Real>(charts_of(mechanism_), before_.data(), dz_.data(), state.q.data());
    measure(state, other_);
    mechanism_.project(state.q.data(), other_.data(), dz_.data());
    for (std::size_t i = 0; i < dz_.size(); ++i) state.v[i] += dz_[i];
  }

 private:
  static constexpr int most = 50;
  static constexpr std::size_t most_tries = 24;

  /// Steps that `move` what is open: the gap is the residual, in gap_, or its rate, in other_.
  template <class Moved, class Move>
  Fault close(StateOf<M>& state, long number, Moved& moved, const Equations<M>& open, Cause cause, Move move) {
    iterations_ = 0;
    if (gap_.empty()) return {};
    Real left = measure(state, open);
    const Real size = Real(1) + largest(moved);
    bool weak = false, singular = false;
    for (; iterations_ < most && !(left <= rounding() * size); ++iterations_) {
      std::copy(moved.begin(), moved.end(), before_.begin());
      if (weak) singular = !solve(state, open);
      else mechanism_.project(state.q.data(), open.data(), dz_.data());
      move();
      const Real next = measure(state, open);
      if (next != next) return give_up(state, number, moved);
      if (!(next < left)) std::copy_n(before_.begin(), moved.size(), moved.begin());
      if (weak && !(next < left / 2)) {
        left = std::min(next, left);
        break;
      }
      weak = !(next < left / 10);
      left = std::min(next, left);
      if (weak) measure(state, open);
    }
    if (!(left <= (singular ? Real(1e-6) * size : allowed(size)))) return fail(state, number, cause, open);
    return {};
  }

  /// dz = project(w) with T w = open, by residuals that fall (Eisenstat, Elman, Schultz 1983: GCR); whether they found all of w.
  bool solve(const StateOf<M>& state, const Equations<M>& open) {
    using std::sqrt;
    right_ = open;
    std::fill(dz_.begin(), dz_.end(), Real(0));
    mechanism_.constraint_residual(state.q.data(), still_.data(), scratch_.data(), rest_.data());
    const Real enough = dot(right_, right_) * Real(1e-12);
    for (std::size_t n = 0; n < number_of_tries_ && dot(right_, right_) > enough; ++n) {
      Try& now = tries_[n];
      now.gap = right_;
      mechanism_.project(state.q.data(), now.gap.data(), now.step.data());
      mechanism_.constraint_residual(state.q.data(), now.step.data(), scratch_.data(), now.closed.data());
      for (std::size_t i = 0; i < rest_.size(); ++i) now.closed[i] = rest_[i] - now.closed[i];
      for (std::size_t k = 0; k < n; ++k) now.add(-dot(now.closed, tries_[k].closed), tries_[k]);
      const Real size = sqrt(dot(now.closed, now.closed));
      if (size <= Real(1e-6) * sqrt(dot(now.gap, now.gap))) return false;
      now.scale(Real(1) / size);
      const Real share = dot(right_, now.closed);
      add(dz_, share, now.step);
      add(right_, -share, now.closed);
    }
    return dot(right_, right_) <= enough;
  }

  /// A gap, the step that answers it, and what this closes, -Phi_v step.
  struct Try {
    Equations<M> gap;
    Speeds<M> step;
    Equations<M> closed;

    void add(Real factor, const Try& other) {
      Projection::add(gap, factor, other.gap);
      Projection::add(step, factor, other.step);
      Projection::add(closed, factor, other.closed);
    }

    void scale(Real factor) {
      const auto times = [factor](auto& values) {
        for (Real& value : values) value *= factor;
      };
      times(gap), times(step), times(closed);
    }
  };

  template <class Numbers>
  static void add(Numbers& sum, Real factor, const Numbers& part) {
    for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += factor * part[i];
  }

  static Real dot(const Equations<M>& a, const Equations<M>& b) {
    return cutjoint::dot(std::span<const Real>(a.data(), a.size()), std::span<const Real>(b.data(), b.size()));
  }

  Real measure(const StateOf<M>& state, const Equations<M>& open) {
    mechanism_.constraint_residual(state.q.data(), state.v.data(), gap_.data(), other_.data());
    return largest(open);
  }

  /// `project` has no finite step: the fault names the first speed that is no number.
  template <class Moved>
  Fault give_up(const StateOf<M>& state, long number, Moved& moved) {
    std::copy_n(before_.begin(), moved.size(), moved.begin());
    const auto lost = std::find_if(dz_.begin(), dz_.end(), [](Real x) { return x - x != Real(0); });
    const auto speed = static_cast<std::size_t>(lost == dz_.end() ? 0 : lost - dz_.begin());
    return {.cause = Cause::masses_lost, .list = FaultList::speeds, .index = static_cast<int>(speed), .t = static_cast<double>(state.t), .step = number,
            .value = static_cast<double>(dz_[speed])};
  }

  Fault fail(const StateOf<M>& state, long number, Cause cause, const Equations<M>& open) {
    const Real left = measure(state, open);
    std::size_t worst = 0;
    using std::abs;
    for (std::size_t i = 0; i < open.size(); ++i)
      if (abs(open[i]) > abs(open[worst]) || open[i] != open[i]) worst = i;
    return {.cause = cause, .list = FaultList::equations, .index = static_cast<int>(worst), .t = static_cast<double>(state.t), .step = number,
            .value = static_cast<double>(left)};
  }

  static Real rounding() { return Real(64) * std::numeric_limits<Real>::epsilon(); }

  /// 1e-10 m or rad, or what rounding leaves of large numbers.
  static Real allowed(Real size) { return std::max(Real(1e-10), Real(100) * rounding() * size); }

  M& mechanism_;
  Equations<M> gap_, other_;
  Speeds<M> dz_;
  Array<M, std::max(static_sizes<M>().coordinates, static_sizes<M>().speeds)> before_;
  Equations<M> right_, rest_, scratch_;
  Speeds<M> still_;
  int iterations_ = 0;
  std::size_t number_of_tries_;
  Array<M, std::min(most_tries, static_sizes<M>().equations), Try> tries_;
};

}  // namespace cutjoint
