// A matrix-free solver for linear equations of the loops.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <span>

#include "cutjoint/core/numbers/arrays.hpp"
#include "cutjoint/core/numbers/dot.hpp"
#include "cutjoint/core/mechanism/mechanism.hpp"
#include "cutjoint/core/numbers/selection.hpp"
#include "cutjoint/core/mechanism/state.hpp"

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
  template <class Respond>
  Mask solve(const Equations<M>& right, Real least, Real left, Mask running, Respond respond) {
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

}  // namespace cutjoint
