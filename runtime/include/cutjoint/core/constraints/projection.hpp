// Takes positions and velocities to the nearest ones that close the cut joints, nearest as the masses see it.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>

#include "cutjoint/core/numbers/arrays.hpp"
#include "cutjoint/core/numbers/falling_residuals.hpp"
#include "cutjoint/core/simulation/fault.hpp"
#include "cutjoint/core/numbers/largest.hpp"
#include "cutjoint/core/mechanism/mechanism.hpp"
#include "cutjoint/core/mechanism/retraction.hpp"
#include "cutjoint/core/numbers/selection.hpp"
#include "cutjoint/core/mechanism/state.hpp"

namespace cutjoint {

/// Projects states of a mechanism; all memory is taken in the constructor.  `begin_step` has been called for the state's time.
///
/// Each iteration is a step of `project` for the remaining violation: the next one closes the part that a penalty leaves.  Near a singular pose
/// much of the violation is left.  Then T w = violation is solved with T = -Phi_v project, and `project` w closes it.  Directions in which T is below
/// 1e-6 are left alone, since closing them would take a leap.  The iteration ends when the violation is rounding, or below 1e-12 and a thousandth of what
/// it was, so that little is left beside the error of the step that opened it; or when it falls no further and is below 1e-10, or 1e-6 in directions
/// that are left alone.
///
/// Of several instances side by side each goes as if it were alone.
template <Mechanism M>
class Projection {
 public:
  using Real = typename M::real_type;
  using Instances = Selection<Real>;
  using Mask = typename Instances::Mask;
  using Scalar = typename Instances::Scalar;

  explicit Projection(M& mechanism)
      : mechanism_(mechanism), arm_(arm_of(mechanism)), violation_(sizes_of(mechanism).equations), other_(violation_.size()), dz_(sizes_of(mechanism).speeds),
        before_(std::max(sizes_of(mechanism).coordinates, dz_.size())), rest_(violation_.size()), scratch_(violation_.size()), still_(dz_.size()),
        solver_(mechanism) {}

  /// Close Phi(q) = 0.  A fault names the equation that stays open.
  Fault positions(StateOf<M>& state, long number = 0) {
    return Instances::any(close_positions(state, Instances::all_if(true))) ? fault(0, number) : Fault{};
  }

  /// Close the rate of Phi, which is linear in the speeds.  A fault names the equation that stays open.
  Fault velocities(StateOf<M>& state, long number = 0) {
    is_measured_ = false;
    return Instances::any(close_speeds(state, Instances::all_if(true))) ? fault(0, number) : Fault{};
  }

  /// Both, at the time of a state.
  Fault close(StateOf<M>& state) {
    mechanism_.begin_step(state.t, Real(1));
    return Instances::any(close(state, Instances::all_if(true))) ? fault(0, 0) : Fault{};
  }

  /// Positions, then speeds, of the instances in `going`; returns those that stay open.
  Mask close(StateOf<M>& state, Mask going) {
    const Mask open = close_positions(state, going);
    return Instances::either(open, close_speeds(state, Instances::without(going, open)));
  }

  /// Why an instance stayed open.
  Fault fault(int instance, long number) const {
    Fault fault = faults_[static_cast<std::size_t>(instance)];
    fault.step = number;
    return fault;
  }

  /// Near a singular pose, until the next call, violations close until they fall no further.  A violation of 1e-13 m leaves a place of 1e-9 m open along a
  /// direction that the loops hold to 1e-4, and a speed of 1e-4 m/s beside it, which the next projection takes away with its energy.
  void close_fully(bool fully) {
    rounding_ = Real((fully ? 2 : 64) * std::numeric_limits<Scalar>::epsilon());
    share_ = Real(fully ? 0 : 1e-3);
  }

  /// The solver of what near-singular loops leave, for another use between calls.
  FallingResiduals<M>& solver() { return solver_; }

  /// Iterations of the last positions or speeds.
  int iterations() const { return iterations_; }

  /// One step of each towards closed loops, whatever is left: the same cost always.
  void approach(StateOf<M>& state) {
    if (violation_.empty()) return;
    measure(state, violation_);
    mechanism_.project(state.q.data(), violation_.data(), dz_.data());
    std::copy(state.q.begin(), state.q.end(), before_.begin());
    retract<Real>(charts_of(mechanism_), before_.data(), dz_.data(), state.q.data());
    measure(state, other_);
    mechanism_.project(state.q.data(), other_.data(), dz_.data());
    for (std::size_t i = 0; i < dz_.size(); ++i) state.v[i] += dz_[i];
  }

 private:
  static constexpr int most = 50;

  Mask close_positions(StateOf<M>& state, Mask going) {
    is_measured_ = false;
    return close(state, going, state.q, violation_, Cause::loops_not_closed);
  }

  Mask close_speeds(StateOf<M>& state, Mask going) { return close(state, going, state.v, other_, Cause::speeds_not_found); }

  /// Steps that move coordinates or speeds by what is open: the residual, in violation_, or its rate, in other_.  Returns the instances of which it stays
  /// open.  No template, which the flags of another file might compile.
  Mask close(StateOf<M>& state, Mask going, std::span<Real> moved, const Equations<M>& open, Cause cause) {
    iterations_ = 0;
    if (violation_.empty() || !Instances::any(going)) return Instances::all_if(false);
    if (!is_measured_) measure(state, open);
    Real left = largest(open);  // of both ways: what is compiled twice may round otherwise
    is_measured_ = true;
    const Real size = arm_ * (Real(1) + largest(moved)), least = rounding_ * size, most_left = Real(1e-9) * arm_;
    const Real little = share_ * where(left < most_left, left, most_left), enough = where(little < least, least, little);
    Mask active = Instances::without(going, left <= least), lost = Instances::all_if(false), weak = lost, singular = lost;
    for (; iterations_ < most && Instances::any(active); ++iterations_) {
      std::copy(moved.begin(), moved.end(), before_.begin());
      find_step(state, open, active, weak, singular);
      if (cause == Cause::loops_not_closed) retract<Real>(charts_of(mechanism_), before_.data(), dz_.data(), moved.data());
      else
        for (std::size_t i = 0; i < dz_.size(); ++i) moved[i] = before_[i] + dz_[i];
      const Real next = measure(state, open);
      const Mask fallen = Instances::both(active, next < left), odd = Instances::without(active, Instances::is_number(next));
      const Mask stays = Instances::without(Instances::all_if(true), fallen);
      is_measured_ = !Instances::any(stays);
      if (!is_measured_)
        for (std::size_t i = 0; i < moved.size(); ++i) Instances::take(stays, before_[i], moved[i]);
      if (Instances::any(odd)) give_up(state, odd);
      lost = Instances::either(lost, odd);
      active = Instances::without(active, odd);
      const Mask slow = Instances::both(weak, Instances::without(active, next < left / Real(2)));
      weak = Instances::without(active, next < left / Real(10));
      Instances::take(Instances::without(active, left < next), next, left);
      active = Instances::without(active, slow);
      if (Instances::any(Instances::both(active, weak))) {
        measure(state, open);
        is_measured_ = true;
      }
      active = Instances::without(active, left <= enough);
    }
    const Mask close = Instances::either(left <= allowed(size), Instances::both(singular, left <= Real(1e-6) * size));
    const Mask failed = Instances::without(Instances::without(going, lost), close);
    if (Instances::any(failed)) fail(state, failed, cause, open);
    return Instances::either(lost, failed);
  }

  /// The step that closes what is open, of `weak` ones by `solve`; which of these are singular is told anew.
  void find_step(const StateOf<M>& state, const Equations<M>& open, Mask active, Mask weak, Mask& singular) {
    const Mask solved = Instances::both(active, weak);
    if (Instances::any(solved)) {
      const Mask all_found = solve(state, open, solved);
      singular = Instances::either(Instances::without(singular, solved), Instances::without(solved, all_found));
    }
    if (Instances::any(Instances::without(active, solved))) mechanism_.project(state.q.data(), open.data(), dz_.data());
    if (Instances::any(solved))
      for (std::size_t i = 0; i < dz_.size(); ++i) Instances::take(solved, solver_.step()[i], dz_[i]);
  }

  /// A step `project` w with T w = open; of which instances all of w was found.
  Mask solve(const StateOf<M>& state, const Equations<M>& open, Mask going) {
    mechanism_.constraint_residual(state.q.data(), still_.data(), scratch_.data(), rest_.data());
    return solver_.solve(open, Real(1e-6), Real(1e-6), going, [&](const Equations<M>& violation, Speeds<M>& step, Equations<M>& closed) {
      mechanism_.project(state.q.data(), violation.data(), step.data());
      mechanism_.constraint_residual(state.q.data(), step.data(), scratch_.data(), closed.data());
      for (std::size_t i = 0; i < rest_.size(); ++i) closed[i] = rest_[i] - closed[i];
    });
  }

  Real measure(const StateOf<M>& state, const Equations<M>& open) {
    mechanism_.constraint_residual(state.q.data(), state.v.data(), violation_.data(), other_.data());
    return largest(open);
  }

  /// `project` has no finite step: the fault names the first speed that is no number.
  void give_up(const StateOf<M>& state, Mask odd) {
    for (int k = 0; k < Instances::number; ++k) {
      if (!Instances::has(odd, k)) continue;
      const auto lost = std::find_if(dz_.begin(), dz_.end(), [k](Real x) { return !std::isfinite(Instances::of(x, k)); });
      const auto speed = static_cast<std::size_t>(lost == dz_.end() ? 0 : lost - dz_.begin());
      faults_[static_cast<std::size_t>(k)] = {.cause = Cause::mass_matrix_singular, .list = FaultList::speeds, .index = static_cast<int>(speed),
                                              .t = Instances::of(state.t, k), .value = Instances::of(dz_[speed], k)};
    }
  }

  void fail(const StateOf<M>& state, Mask failed, Cause cause, const Equations<M>& open) {
    const Real left = measure(state, open);
    for (int k = 0; k < Instances::number; ++k) {
      if (!Instances::has(failed, k)) continue;
      const auto size = [&](std::size_t i) { return std::abs(Instances::of(open[i], k)); };
      std::size_t worst = 0;
      for (std::size_t i = 0; i < open.size(); ++i)
        if (size(i) > size(worst) || size(i) != size(i)) worst = i;
      faults_[static_cast<std::size_t>(k)] = {.cause = cause, .list = FaultList::equations, .index = static_cast<int>(worst),
                                              .t = Instances::of(state.t, k), .value = Instances::of(left, k)};
    }
  }

  /// 1e-10 m or rad, of the arm where that is not a metre, or what rounding leaves of large numbers.
  Real allowed(Real size) const {
    const Real least = Real(1e-10) * arm_, left = Real(6400 * std::numeric_limits<Scalar>::epsilon()) * size;
    return where(least < left, left, least);
  }

  M& mechanism_;
  Real arm_;
  Equations<M> violation_, other_;
  Speeds<M> dz_;
  Array<M, std::max(static_sizes<M>().coordinates, static_sizes<M>().speeds)> before_;
  Equations<M> rest_, scratch_;
  Speeds<M> still_;
  int iterations_ = 0;
  Real rounding_{64 * std::numeric_limits<Scalar>::epsilon()}, share_{1e-3};  ///< shares of a size that is rounding, of a violation that may be left
  bool is_measured_ = false;  ///< whether violation_ and other_ are those of the present coordinates and speeds: positions leave them to speeds
  std::array<Fault, Instances::number> faults_{};
  FallingResiduals<M> solver_;
};

}  // namespace cutjoint
