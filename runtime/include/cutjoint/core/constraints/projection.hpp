// Projects positions and velocities onto the cut joints' constraints, in the metric of the masses.
#pragma once

#include <array>
#include <limits>

#include "cutjoint/core/numbers/selection.hpp"
#include "cutjoint/core/mechanism/state.hpp"
#include "cutjoint/core/simulation/fault.hpp"
#include "cutjoint/core/mechanism/retraction.hpp"

namespace cutjoint {

/// Solves T w = right by generalised conjugate residuals (Eisenstat, Elman, Schultz 1983: GCR); all memory is taken in the constructor.
/// Each of several SIMD instances iterates as if it were alone.
template <Mechanism M>
class FallingResiduals {
 public:
  using Real = typename M::real_type;
  using Instances = Selection<Real>;
  using Mask = typename Instances::Mask;

  explicit FallingResiduals(const M& mechanism)
      : right_(sizes_of(mechanism).equations), found_(right_), step_(sizes_of(mechanism).speeds),
        number_of_tries_(std::min(most_tries, right_.size())), tries_(number_of_tries_, Try{right_, step_, right_}) {}

  /// `respond` computes for a w the step in the velocities and T w.  Directions with T w below the fraction `least` of w are
  /// ignored.  Residuals fall to the fraction `left`.  Returns the instances whose w is complete.
  Mask solve(const Equations<M>& right, Real least, Real left, Mask running, auto respond) {
    using std::sqrt;
    right_ = right;
    std::fill(found_.begin(), found_.end(), Real(0));
    std::fill(step_.begin(), step_.end(), Real(0));
    const Real enough = dot(right_, right_) * left * left;
    Mask stopped = Instances::all_if(false);
    for (std::size_t n = 0; n < number_of_tries_; ++n) {
      Mask trying = Instances::both(Instances::without(running, stopped), enough < dot(right_, right_));
      if (!Instances::any(trying)) break;
      Try& now = tries_[n];
      now.violation = right_;
      respond(now.violation, now.step, now.closed);
      for (std::size_t k = 0; k < n; ++k) now.add(-dot(now.closed, tries_[k].closed), tries_[k]);
      const Real size = sqrt(dot(now.closed, now.closed));
      stopped = Instances::either(stopped, Instances::both(trying, size <= least * sqrt(dot(now.violation, now.violation))));
      trying = Instances::without(trying, stopped);
      if (!Instances::any(trying)) break;
      now.scale(Real(1) / size);
      Real share(0);
      Instances::take(trying, dot(right_, now.closed), share);
      add(found_, share, now.violation, trying);
      add(step_, share, now.step, trying);
      add(right_, -share, now.closed, trying);
    }
    return Instances::both(Instances::without(running, stopped), dot(right_, right_) <= enough);
  }

  /// w, and its step.
  const Equations<M>& found() const { return found_; }
  const Speeds<M>& step() const { return step_; }

 private:
  static constexpr std::size_t most_tries = 64;

  /// A direction, its step, and T of it.
  struct Try {
    Equations<M> violation;
    Speeds<M> step;
    Equations<M> closed;

    void add(Real factor, const Try& other) {
      const Mask all = Instances::all_if(true);
      FallingResiduals::add(violation, factor, other.violation, all);
      FallingResiduals::add(step, factor, other.step, all);
      FallingResiduals::add(closed, factor, other.closed, all);
    }

    void scale(Real factor) {
      const auto times = [factor](auto& values) {
        for (Real& value : values) value *= factor;
      };
      times(violation), times(step), times(closed);
    }
  };

  template <class Numbers>
  static void add(Numbers& sum, Real factor, const Numbers& part, Mask which) {
    for (std::size_t i = 0; i < sum.size(); ++i) Instances::take(which, sum[i] + factor * part[i], sum[i]);
  }

  static Real dot(const Equations<M>& a, const Equations<M>& b) {
    return cutjoint::dot(std::span<const Real>(a.data(), a.size()), std::span<const Real>(b.data(), b.size()));
  }

  Equations<M> right_, found_;
  Speeds<M> step_;
  std::size_t number_of_tries_;
  Array<M, std::min(most_tries, static_sizes<M>().equations), Try> tries_;
};

/// Projects states of a mechanism; all memory is taken in the constructor.  `begin_step` has been called for the state's time.
///
/// Each iteration is a `project` of the remaining violation, which a penalty leaves.  Near a singular pose
/// much of the violation is left.  Then T w = violation is solved with T = -Phi_v project, and `project` w closes it.  Directions in which T is below
/// 1e-6 are ignored, since closing them would take a large displacement.  The iteration ends when the violation is rounding, or below 1e-12 and a
/// thousandth of the initial one, which is small beside the step's error; or when it stops decreasing below 1e-10, or 1e-6 in ignored
/// directions.
///
/// Each of several SIMD instances iterates as if it were alone.
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

  /// Positions, then speeds, of the instances in `running`; returns those that stay open.
  Mask close(StateOf<M>& state, Mask running) {
    const Mask open = close_positions(state, running);
    return Instances::either(open, close_speeds(state, Instances::without(running, open)));
  }

  /// The fault of an instance.
  Fault fault(int instance, long number) const {
    Fault fault = faults_[static_cast<std::size_t>(instance)];
    fault.step = number;
    return fault;
  }

  /// Near a singular pose, until the next call, iterate until violations stop decreasing.  A violation of 1e-13 m allows an error of 1e-9 m in a
  /// direction that the loops constrain by 1e-4, and a velocity of 1e-4 m/s, which the next projection removes with its energy.
  void close_fully(bool fully) {
    rounding_ = Real((fully ? 2 : 64) * std::numeric_limits<Scalar>::epsilon());
    share_ = Real(fully ? 0 : 1e-3);
  }

  /// The solver for near-singular loops, for other use between calls.
  FallingResiduals<M>& solver() { return solver_; }

  /// Iterations of the last positions or speeds.
  int iterations() const { return iterations_; }

  /// One iteration of each, at constant cost.
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

  Mask close_positions(StateOf<M>& state, Mask running) {
    is_measured_ = false;
    return close(state, running, state.q, violation_, Cause::loops_not_closed);
  }

  Mask close_speeds(StateOf<M>& state, Mask running) { return close(state, running, state.v, other_, Cause::speeds_not_found); }

  /// Project coordinates or velocities: the residual is in violation_, its rate in other_.  Returns the instances that stay open.
  /// No template, which might be compiled with another file's flags.
  Mask close(StateOf<M>& state, Mask running, std::span<Real> moved, const Equations<M>& open, Cause cause) {
    iterations_ = 0;
    if (violation_.empty() || !Instances::any(running)) return Instances::all_if(false);
    if (!is_measured_) measure(state, open);
    Real left = largest(open);  // for both cases: code compiled twice may round differently
    is_measured_ = true;
    const Real size = size_of(moved, cause), least = rounding_ * size, most_left = Real(1e-9) * arm_;
    const Real little = share_ * where(left < most_left, left, most_left), enough = where(little < least, least, little);
    Mask active = Instances::without(running, left <= least), lost = Instances::all_if(false), weak = lost, singular = lost;
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
    const Mask failed = Instances::without(Instances::without(running, lost), close);
    if (Instances::any(failed)) fail(state, failed, cause, open);
    return Instances::either(lost, failed);
  }

  /// The reference size of violations.
  Real size_of(std::span<const Real> moved, Cause cause) const {
    const double arm = arm_of(mechanism_);
    const std::span<const double> nominals = scaled_nominals_of(mechanism_);
    return cause == Cause::loops_not_closed ? pose_size(moved, arm, charts_of(mechanism_), nominals) : speed_size(moved, arm, nominals);
  }

  /// The step of one iteration, for `weak` instances by `solve`, which updates `singular`.
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

  /// A step `project` w with T w = open; returns the instances whose w is complete.
  Mask solve(const StateOf<M>& state, const Equations<M>& open, Mask running) {
    mechanism_.constraint_residual(state.q.data(), still_.data(), scratch_.data(), rest_.data());
    return solver_.solve(open, Real(1e-6), Real(1e-6), running, [&](const Equations<M>& violation, Speeds<M>& step, Equations<M>& closed) {
      mechanism_.project(state.q.data(), violation.data(), step.data());
      mechanism_.constraint_residual(state.q.data(), step.data(), scratch_.data(), closed.data());
      for (std::size_t i = 0; i < rest_.size(); ++i) closed[i] = rest_[i] - closed[i];
    });
  }

  Real measure(const StateOf<M>& state, const Equations<M>& open) {
    mechanism_.constraint_residual(state.q.data(), state.v.data(), violation_.data(), other_.data());
    return largest(open);
  }

  /// `project` has no finite step: the fault names the first velocity that is not finite.
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
      const std::size_t worst = index_of_largest(open.size(), [&](std::size_t i) { return std::abs(Instances::of(open[i], k)); });
      faults_[static_cast<std::size_t>(k)] = {.cause = cause, .list = FaultList::equations, .index = static_cast<int>(worst),
                                              .t = Instances::of(state.t, k), .value = Instances::of(left, k)};
    }
  }

  /// 1e-10 m or rad, times the arm if that is not 1, or the rounding of large numbers.
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
  Real rounding_{64 * std::numeric_limits<Scalar>::epsilon()}, share_{1e-3};  ///< relative rounding of a size, and allowed fraction of the initial violation
  bool is_measured_ = false;  ///< whether violation_ and other_ belong to the present state
  std::array<Fault, Instances::number> faults_{};
  FallingResiduals<M> solver_;
};

}  // namespace cutjoint
