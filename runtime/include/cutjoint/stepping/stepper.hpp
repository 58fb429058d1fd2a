// Explicit steps that end where a formula of the forces, guides or drives changes.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "cutjoint/runge_kutta/formula.hpp"
#include "cutjoint/runge_kutta/step_control.hpp"
#include "cutjoint/state.hpp"

namespace cutjoint::runge_kutta {

/// What steps took.
struct Counts {
  long steps = 0, rejected = 0, events = 0;
  long stiff = 0;                 ///< steps whose length stability limited, not accuracy
  std::vector<long> by_switch{};  ///< events
};

/// Advances y' = f(t, y), by steps as long as the error allows, or with a table without an estimate by one step a row.
///
/// A step all of whose stages are in one regime is as accurate as the formulas are smooth.  One that leaves the regime is taken again,
/// shorter, so that it ends a little before; its interpolant, which knows one regime only, goes on to where a switch leaves its cell.
/// There the step ends, and the next one begins in the new regime.  Nothing of the order is lost: a step's end lies there with an error
/// of the order of the interpolant's, and there are as many such ends as events, however short the steps.
template <class Dynamics, class Table>
class Stepper {
 public:
  using Real = typename Dynamics::Real;

  static constexpr bool adaptive = Table::adaptive;

  /// `end` is where the integration ends: no step goes beyond.
  Stepper(Dynamics& dynamics, Tolerances<Real> tolerances, Real end)
      : dynamics_(dynamics), formula_(dynamics), tolerances_(tolerances), until_(end), y_(dynamics.size()), end_(y_), error_(y_),
        trial_(y_) {
    counts_.by_switch.resize(dynamics.switches().size());
  }

  /// Go on from y at t to `until`; `number` is the row's.  Steps of adaptive methods do not end at rows: y is then what lies between.
  /// Throws Failure where no step is small enough.
  void advance(Real t, Real until, std::vector<Real>& y, long number) {
    number_ = number;
    if (!begun_) begin(t, y);
    const Real limit = adaptive ? until_ : until;
    if (!adaptive) h_ = until - t;
    while (until - t_ > least(until)) step(limit);
    y = y_;
    if (t_ - until <= least(until)) return;
    formula_.interpolate((until - before_) / h_last_, y);
    dynamics_.settle(until, y);
  }

  long steps() const { return counts_.steps; }
  const Counts& counts() const { return counts_; }

 private:
  void begin(Real t, const std::vector<Real>& y) {
    t_ = t;
    y_ = y;
    begun_ = true;
    if constexpr (adaptive) h_ = first_length();
  }

  /// One step, or the part of it before an event.
  void step(Real limit) {
    Real h = adaptive ? std::min(h_, limit - t_) : limit - t_;
    if (limit - t_ - h < h / 1000) h = limit - t_;
    Real way(-1);  // to where the regime is left, if it is
    for (;; ++counts_.rejected) {
      dynamics_.regime().begin(t_);
      formula_.attempt(t_, h, y_, end_, error_);
      if (dynamics_.regime().crossed()) {
        if (h <= shortest()) return pass(h);
        const Real last = way;
        way = dynamics_.regime().crossing() - t_;
        const bool sure = way > last * Real(0.9) && way < last * Real(1.1);
        h = std::max(std::clamp(Real(0.9) * way, sure ? Real(0) : h / 10, Real(0.9) * h), shortest());
        continue;
      }
      const Real size = error_size();
      if (size <= Real(1)) {
        accept(h, size);
        if (way >= Real(0)) locate(limit);
        return;
      }
      if (!adaptive || !(h > least(t_))) give_up(size);
      h_ = h = control_.instead_of(h, size);
    }
  }

  void accept(Real h, Real size) {
    if constexpr (adaptive) {
      const Real next = control_.after(h, size);
      if (next > h_ || h >= h_) h_ = next;
      counts_.stiff += formula_.stiffness(h, end_) > Real(3);
    }
    formula_.accept(h, y_, end_);
    before_ = t_;
    h_last_ = h;
    ++counts_.steps;
    dynamics_.advance(t_ + h);
    finish(t_ + h, end_);
  }

  /// The step ends at t in y.
  void finish(Real t, const std::vector<Real>& y) {
    y_ = y;
    t_ = t;
    dynamics_.settle(t_, y_);
  }

  /// The state at the share s of the last step or somewhat beyond, into trial_; its time.
  Real follow(Real s) {
    formula_.interpolate(s, trial_);
    return before_ + s * h_last_;
  }

  /// Whether that state has left the regime by a switch that is sought.
  bool is_beyond(Real s) {
    const Real t = follow(s);
    return dynamics_.found(t, trial_) < counts_.by_switch.size();
  }

  /// Go on from the end of the last step to where the regime ends, if that is near, or to the limit, if that is nearer.
  void locate(Real limit) {
    Real low(1), high(1.3);
    if (const Real t = follow(high); !dynamics_.seek(t, trial_)) return;
    for (Real middle = (low + high) / 2; low < middle && middle < high; middle = (low + high) / 2) (is_beyond(middle) ? high : low) = middle;
    if (before_ + high * h_last_ > limit + shortest()) {
      follow((limit - before_) / h_last_);
      finish(limit, trial_);
      return formula_.restart();
    }
    for (Real more = std::numeric_limits<Real>::epsilon(); more < Real(1e-3); more *= 4) {  // settling must not take the state back
      const Real t = follow(high);
      finish(t, trial_);
      const std::size_t which = dynamics_.found(t_, y_);
      if (which < counts_.by_switch.size()) return change(which);
      high += more;
    }
  }

  /// A step too short to be told from none leaves the regime.
  void pass(Real h) {
    formula_.accept(h, y_, end_);
    before_ = t_;
    h_last_ = h;
    finish(t_ + h, end_);
    if (dynamics_.seek(t_, y_)) return change(dynamics_.found(t_, y_));
    if (++at_once_ >= 50) give_up_switching();
  }

  /// The regime of the state begins.
  void change(std::size_t which) {
    dynamics_.adopt(t_, y_);
    formula_.restart();
    control_.restart();
    ++counts_.events;
    at_once_ = t_ - changed_ <= Real(1e-3) * h_ ? at_once_ + 1 : 0;
    if (which < counts_.by_switch.size()) {
      ++counts_.by_switch[which];
      latest_ = which;
    }
    if (at_once_ >= 50) give_up_switching();
    changed_ = t_;
  }

  /// The largest error by its allowed size; infinite where one is no number.
  Real error_size() {
    using std::abs;
    Real largest(0);
    for (std::size_t i = 0; i < y_.size(); ++i) {
      const Real size = (abs(error_[i]) + Real(0) * end_[i]) / tolerances_.of(std::max(abs(y_[i]), abs(end_[i])));
      if (size <= largest) continue;
      largest = size;
      worst_ = i;
      if (!(size == size)) return std::numeric_limits<Real>::infinity();
    }
    return largest;
  }

  /// A first step (Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, section II.4).
  Real first_length() {
    using std::abs, std::pow;
    auto largest = [this](const std::vector<Real>& values) {
      Real result(0);
      for (std::size_t i = 0; i < values.size(); ++i) result = std::max(result, abs(values[i]) / tolerances_.of(y_[i]));
      return result;
    };
    dynamics_.derive(t_, y_, end_);
    const Real value = largest(y_), slope = largest(end_);
    const Real short_(1e-5), guess = value < short_ || slope < short_ ? Real(1e-6) : Real(0.01) * value / slope;
    const Real probe = std::min(guess, until_ - t_);
    for (std::size_t i = 0; i < y_.size(); ++i) trial_[i] = y_[i] + probe * end_[i];
    dynamics_.derive(t_ + probe, trial_, error_);
    for (std::size_t i = 0; i < y_.size(); ++i) error_[i] -= end_[i];
    const Real bend = std::max(slope, largest(error_) / probe);
    const Real by_bend = bend <= Real(1e-15) ? std::max(Real(1e-6), probe * Real(1e-3)) : pow(Real(0.01) / bend, Real(1) / Real(Table::order));
    return std::min(Real(100) * probe, by_bend);
  }

  /// The shortest step that differs from none.
  Real least(Real t) const {
    using std::abs;
    return 16 * std::numeric_limits<Real>::epsilon() * std::max(abs(t), until_ - t);
  }

  /// The shortest step before an event.
  Real shortest() const { return 256 * least(t_); }

  [[noreturn]] void give_up(Real size) const {
    const bool stiff = counts_.stiff > counts_.steps / 2;
    const char* what = adaptive ? "no step is small enough for the tolerance" : "the accelerations have no finite value";
    const char* advice = !adaptive ? "take a smaller dt, or a stable method: the integrator trapezoidal, or the method augmented"
                         : stiff   ? "the problem is stiff: take the integrator trapezoidal, or the method augmented"
                                   : "allow a larger tolerance, a smaller penalty, or take a longer precision";
    throw Failure(what, static_cast<double>(t_), number_, dynamics_.name(worst_), static_cast<double>(size), advice);
  }

  [[noreturn]] void give_up_switching() const {
    const Switch& which = dynamics_.switches()[latest_];
    throw Failure("'" + std::string(which.element) + "' (" + std::string(which.place) + ") switches to and fro without end",
                  static_cast<double>(t_), number_, std::string(which.element), static_cast<double>(t_ - changed_),
                  "make its law continuous there, or take the integrator trapezoidal");
  }

  Dynamics& dynamics_;
  Formula<Dynamics, Table> formula_;
  Tolerances<Real> tolerances_;
  StepControl<Real, Table::order> control_;
  Real until_, h_{0}, t_{0}, before_{0}, h_last_{1}, changed_{-1};
  std::vector<Real> y_, end_, error_, trial_;
  std::size_t worst_ = 0, latest_ = 0;
  long number_ = 0;
  int at_once_ = 0;
  bool begun_ = false;
  Counts counts_;
};

}  // namespace cutjoint::runge_kutta
