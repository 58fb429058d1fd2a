// Steps that end where a formula of the forces, guides or drives changes.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "cutjoint/json.hpp"
#include "cutjoint/state.hpp"
#include "cutjoint/stepping/step_control.hpp"

namespace cutjoint::stepping {

/// What steps took.
struct Counts {
  long steps = 0, rejected = 0, events = 0;
  std::vector<long> by_switch{};  ///< events
};

/// What came of an attempt of a step.
template <class Real>
struct Attempt {
  Real size{0};       ///< of the error, 1 being what is allowed: 0 where it is not estimated, infinite where it is no number
  bool found = true;  ///< whether all stages were found
};

/// Advances a scheme by steps as long as the error allows, or without an estimate by one step a row.
///
/// A step all of whose stages are in one regime is as accurate as the formulas are smooth.  One that leaves the regime is taken again,
/// shorter, so that it ends a little before; its interpolant, which knows one regime only, goes on to where a switch leaves its cell.
/// There the step ends, and the next one begins in the new regime.  Nothing of the order is lost: a step's end lies there with an error
/// of the order of the interpolant's, and there are as many such ends as events, however short the steps.
///
/// A scheme has a present state, and a trial one beside it:
///
/// - `begin` takes over y at t, `left` before the end, and returns the length of a first step,
/// - `attempt` tries a step of length h from the present state; it may end where it leaves the regime, but not if `whole`,
/// - `advance` makes the regime go on at the end of the attempt, `accept` makes that end the present state,
/// - `follow` puts the trial state at a share of the last step's length, which may be above 1, and returns its time,
/// - `seek` seeks the switches that the trial state has out of the regime, `found` is the first of these (see Regime),
/// - `finish` closes the loops of the trial state, which becomes the present one,
/// - `restart` forgets what is known of the steps before, `adopt` too, and goes over to the regime of the present state,
/// - `read` is y at the time of a row, which `lies_between` the ends of the last step or is that of the present state,
/// - `length` is that of the next step: the one that the error allows, or that of the last one.
template <class Scheme>
class Stepper {
 public:
  using Real = typename Scheme::Real;

  /// `end` is where the integration ends: no step goes beyond.  `how` is what else the scheme is made with.
  template <class Dynamics, class... How>
  Stepper(Dynamics& dynamics, const Tolerances<Real>& tolerances, Real end, How&&... how)
      : scheme_(dynamics, tolerances, std::forward<How>(how)...), until_(end) {
    counts_.by_switch.resize(scheme_.switches().size());
  }

  /// Go on from y at t to `until`; `number` is the row's.  Steps of adaptive methods do not end at rows: y is then what lies between.
  /// Throws Failure where no step is small enough.
  void advance(Real t, Real until, std::vector<Real>& y, long number) {
    number_ = number;
    if (!begun_) {
      const Real first = scheme_.begin(t, y, until_ - t);
      if (scheme_.adaptive()) h_ = first;
      begun_ = true;
    }
    if (!scheme_.adaptive()) h_ = until - time();
    while (until - time() > least(until)) step(scheme_.adaptive() ? until_ : until);
    scheme_.read(until, time() - until > least(until), y);
  }

  long steps() const { return counts_.steps; }
  const Counts& counts() const { return counts_; }
  const Scheme& scheme() const { return scheme_; }

  /// Put the counts into a run's summary.
  void summarise(Json& summary) const {
    summary["steps"] = counts_.steps;
    summary["rejected"] = counts_.rejected;
    summary["events"] = counts_.events;
    Json by_element = Json::object();
    for (std::size_t i = 0; i < counts_.by_switch.size(); ++i)
      if (const long n = counts_.by_switch[i]; n > 0) {
        Json& known = by_element[std::string(scheme_.switches()[i].element)];
        known = known.is_null() ? n : known.template get<long>() + n;
      }
    summary["events_by_element"] = by_element;
  }

 private:
  Real time() const { return scheme_.time(); }

  /// One step, or the part of it before an event.
  void step(Real limit) {
    const Real left = limit - time();
    Real h = scheme_.adaptive() ? std::min(h_, left) : left;
    if (left - h < h / 1000) h = left;
    Real way(-1);  // to where the regime is left, if it is
    for (;; ++counts_.rejected) {
      const bool whole = h <= shortest();
      const Attempt<Real> attempt = scheme_.attempt(h, whole, number_);
      if (scheme_.regime().crossed()) {
        if (whole && attempt.found) return pass(h);
        if (!whole) {
          const Real last = way;
          way = scheme_.regime().crossing() - time();
          const bool sure = way > last * Real(0.9) && way < last * Real(1.1);
          h = std::max(std::clamp(Real(0.9) * way, sure ? Real(0) : h / 10, Real(0.9) * h), shortest());
          continue;
        }
      }
      if (attempt.found && attempt.size <= Real(1)) {
        accept(h, attempt.size);
        if (way >= Real(0)) locate(limit);
        return;
      }
      if (!scheme_.adaptive() || !(h > least(time()))) scheme_.give_up(attempt, counts_, number_);
      h_ = h = attempt.found ? control_.instead_of(h, attempt.size) : h / 4;
    }
  }

  void accept(Real h, Real size) {
    if (scheme_.adaptive()) {
      const Real next = control_.after(h, size);
      if (next > h_ || h >= h_) h_ = scheme_.length(h, next);
    }
    scheme_.advance(h);
    scheme_.accept(h);
    ++counts_.steps;
  }

  /// Whether the state at a share of the last step has left the regime by a switch that is sought.
  bool is_beyond(Real s) {
    scheme_.follow(s);
    return scheme_.found() < counts_.by_switch.size();
  }

  /// Go on from the end of the last step to where the regime ends, if that is near, or to the limit, if that is nearer.
  void locate(Real limit) {
    Real low(1), high(1.3);
    scheme_.follow(high);
    if (!scheme_.seek()) return;
    for (Real middle = (low + high) / 2; low < middle && middle < high; middle = (low + high) / 2) (is_beyond(middle) ? high : low) = middle;
    if (scheme_.follow(high) > limit + shortest()) {
      scheme_.follow_to(limit);
      scheme_.finish();
      return scheme_.restart();
    }
    for (Real more = std::numeric_limits<Real>::epsilon(); more < Real(1e-3); more *= 4) {  // settling must not take the state back
      scheme_.follow(high);
      scheme_.finish();
      const std::size_t which = scheme_.found();
      if (which < counts_.by_switch.size()) return change(which);
      high += more;
    }
    scheme_.restart();
  }

  /// A step too short to be told from none leaves the regime.
  void pass(Real h) {
    scheme_.regime().advance();
    scheme_.accept(h);
    if (scheme_.seek()) return change(scheme_.found());
    if (++at_once_ >= 50) give_up_switching();
  }

  /// The regime of the state begins.
  void change(std::size_t which) {
    scheme_.adopt();
    control_.restart();
    ++counts_.events;
    at_once_ = time() - changed_ <= Real(1e-3) * h_ ? at_once_ + 1 : 0;
    if (which < counts_.by_switch.size()) {
      ++counts_.by_switch[which];
      latest_ = which;
    }
    if (at_once_ >= 50) give_up_switching();
    changed_ = time();
  }

  /// The shortest step that differs from none.
  Real least(Real t) const {
    using std::abs;
    return 16 * std::numeric_limits<Real>::epsilon() * std::max(abs(t), until_ - t);
  }

  /// The shortest step before an event.
  Real shortest() const { return 256 * least(time()); }

  [[noreturn]] void give_up_switching() const {
    const Switch& which = scheme_.switches()[latest_];
    throw Failure("'" + std::string(which.element) + "' (" + std::string(which.place) + ") switches to and fro without end",
                  static_cast<double>(time()), number_, std::string(which.element), static_cast<double>(time() - changed_),
                  "make its law continuous there, or take the integrator trapezoidal");
  }

  Scheme scheme_;
  StepControl<Real, Scheme::order> control_;
  Real until_, h_{0}, changed_{-1};
  std::size_t latest_ = 0;
  long number_ = 0;
  int at_once_ = 0;
  bool begun_ = false;
  Counts counts_;
};

}  // namespace cutjoint::stepping
