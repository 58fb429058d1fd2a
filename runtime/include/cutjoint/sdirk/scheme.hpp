// Implicit steps as long as the tolerance allows, or of equal length.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "cutjoint/runge_kutta/step_control.hpp"
#include "cutjoint/sdirk/interpolant.hpp"
#include "cutjoint/sdirk/stages.hpp"

namespace cutjoint::sdirk {

/// Advances stages from row to row; adaptive steps do not end at rows, which lie on the interpolant.
template <class S>
class Stepper {
 public:
  using Real = typename S::real_type;

  /// `end` is where the integration ends: no step goes beyond.
  Stepper(Stages<S>& stages, Tolerances<Real> tolerances, Real end, bool adaptive)
      : stages_(stages), interpolant_(stages.charts(), stages.present()), before_(stages.present()), between_(before_), end_(end),
        adaptive_(adaptive) {
    stages_.set_tolerances(tolerances);
    h_ = first_length(tolerances);
  }

  /// Go on to `until`; y is then the state there.  `number` is the row's.  Throws Failure.
  void advance(Real, Real until, std::vector<Real>& y, long number) {
    while (until - present().t > least(until)) step(adaptive_ ? end_ : until, number);
    between_ = present();
    if (present().t - until > least(until)) {
      interpolant_.at((until - before_.t) / (present().t - before_.t), y);
      std::copy_n(y.begin(), between_.q.size(), between_.q.begin());
      std::copy_n(y.begin() + static_cast<std::ptrdiff_t>(between_.q.size()), between_.v.size(), between_.v.begin());
      between_.t = until;
    }
    residuals_ = stages_.settle(between_);
    std::copy(between_.v.begin(), between_.v.end(), std::copy(between_.q.begin(), between_.q.end(), y.begin()));
  }

  long steps() const { return steps_; }
  long rejected() const { return rejected_; }
  const Residuals& residuals() const { return residuals_; }  ///< of the last row

 private:
  const State<Real>& present() const { return stages_.present(); }

  void step(Real limit, long number) {
    const Real left = limit - present().t;
    Real h = adaptive_ ? std::min(h_, left) : left;
    if (left - h < h / 1000) h = left;
    for (;; ++rejected_) {
      const bool found = stages_.attempt(h, number);
      const Real size = !found ? std::numeric_limits<Real>::infinity() : adaptive_ ? stages_.error(h) : Real(0);
      if (size <= Real(1)) return accept(h, size);
      if (!adaptive_ || !(h > least(present().t))) give_up(size, found, number);
      h_ = h = found ? control_.instead_of(h, size) : h / 4;
    }
  }

  /// A step that would be only a little longer keeps its length, since that keeps its factors.
  void accept(Real h, Real size) {
    stages_.accept(h, before_);
    interpolant_.join(before_, present());
    ++steps_;
    const Real next = control_.after(h, size);
    if (h < h_ && next <= h_) return;
    h_ = next >= h && next <= Real(1.2) * h ? h : next;
  }

  /// Short enough for the accelerations to change no speed by more than the root of what is allowed.
  Real first_length(const Tolerances<Real>& tolerances) const {
    using std::abs, std::pow;
    Real h = end_ - present().t;
    for (std::size_t i = 0; i < present().v.size(); ++i) {
      const Real size = Real(1) + abs(present().v[i]), allowed = tolerances.of(abs(present().v[i])) / size;
      h = std::min(h, pow(allowed, Real(0.25)) * size / (Real(1) + abs(present().vdot[i])));
    }
    return h;
  }

  /// The shortest step that differs from none.
  Real least(Real t) const {
    using std::abs;
    return 16 * std::numeric_limits<Real>::epsilon() * std::max(abs(t), end_ - t);
  }

  [[noreturn]] void give_up(Real size, bool found, long number) const {
    const char* what = found        ? "no step is small enough for the tolerance"
                       : adaptive_ ? "Newton's iteration converges with no step, however small"
                                   : "Newton's iteration did not converge in a stage";
    const char* advice = adaptive_ ? "allow a larger tolerance; look for a force that jumps, or for a singular pose"
                                   : "take a smaller dt, or the integrator sdirk4, which chooses its steps";
    throw Failure(what, static_cast<double>(present().t), number, stages_.worst(), static_cast<double>(size), advice);
  }

  Stages<S>& stages_;
  Interpolant<Real> interpolant_;
  runge_kutta::StepControl<Real, Table::order> control_;
  State<Real> before_, between_;
  Residuals residuals_;
  Real end_, h_{0};
  bool adaptive_;
  long steps_ = 0, rejected_ = 0;
};

}  // namespace cutjoint::sdirk
