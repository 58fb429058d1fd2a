// Steps that end where a formula of the forces, guides or drives changes.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
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
/// - `read_end` is the present state, with accelerations and multipliers where guides need them, `read_between` one at a time of the last step,
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
    while (until - time() > least(until)) {
      step(scheme_.adaptive() ? until_ : until);
      if (stepped_) stepped_(scheme_);
    }
    scheme_.read(until, time() - until > least(until), y);
  }

  /// What is called after each step.
  using Watch = std::function<void(Scheme&)>;

  void watch(Watch stepped) { stepped_ = std::move(stepped); }

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
          latest_ = scheme_.regime().first();
          const bool sure = attempt.found && way > last * Real(0.9) && way < last * Real(1.1);
          h = std::max(std::clamp(Real(0.9) * way, sure ? Real(0) : h / 10, Real(0.9) * h), shortest());
          continue;
        }
      }
      if (attempt.found && attempt.size <= Real(1)) {
        accept(h, attempt.size);
        if (way >= Real(0) && whole) count_event();
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

  /// How far the state at a share of the last step has left the regime by a switch that is sought; at most zero where it has not.
  Real beyond(Real s) {
    scheme_.follow(s);
    const bool left = scheme_.found() < counts_.by_switch.size();
    const Real distance = scheme_.regime().beyond();
    return left ? std::max(distance, std::numeric_limits<Real>::min()) : std::min(distance, Real(0));
  }

  /// How exactly the end of a regime is sought, as a share of a step: switches have rounding of their own.
  static Real sharp() { return 2048 * std::numeric_limits<Real>::epsilon(); }

  /// Where the state leaves the regime, between `low`, where it has not, and `high`: by halves or on the parabola through three places, if that is
  /// sure to hold.  Source: Chandrupatla, Advances in Engineering Software 28 (1997) 145-149.
  Real find_end(Real low, Real high, Real at_low, Real at_high) {
    Real newest = high, opposite = low, at_newest = at_high, at_opposite = at_low, share(0.5);
    using std::abs;
    while (abs(opposite - newest) > sharp()) {
      const Real middle = newest + share * (opposite - newest), value = beyond(middle);
      Real third = newest, at_third = at_newest;
      if ((value > Real(0)) != (at_newest > Real(0))) {
        third = std::exchange(opposite, newest);
        at_third = std::exchange(at_opposite, at_newest);
      }
      newest = middle;
      at_newest = value;
      share = share_of(newest, opposite, third, at_newest, at_opposite, at_third);
    }
    return at_newest > Real(0) ? newest : opposite;
  }

  /// Where to look next on the way from a to b, the ends of the bracket.
  static Real share_of(Real a, Real b, Real c, Real fa, Real fb, Real fc) {
    using std::abs;
    const Real least = std::min(Real(0.5), sharp() / 2 / abs(b - a));
    const Real xi = (a - b) / (c - b), phi = (fa - fb) / (fc - fb);
    Real share(0.5);
    if (phi * phi < xi && (1 - phi) * (1 - phi) < 1 - xi)
      share = fa / (fb - fa) * fc / (fb - fc) + (c - a) / (b - a) * fa / (fc - fa) * fb / (fc - fb);
    return std::clamp(share, least, 1 - least);
  }

  /// Go on from the end of the last step to where the regime ends, if that is near, or to the limit, if that is nearer.
  void locate(Real limit) {
    const Real low(1);
    Real high(1.3);
    scheme_.follow(high);
    if (!scheme_.seek()) return;
    const Real at_high = beyond(high), at_low = beyond(low);
    if (at_high > Real(0)) high = at_low > Real(0) ? low : find_end(low, high, at_low, at_high);
    if (scheme_.follow(high) > limit + shortest()) {
      scheme_.follow_to(limit);
      scheme_.finish();
      return scheme_.restart();
    }
    for (Real more = sharp() / 16; more < Real(1e-3); more *= 8) {  // settling must not take the state back
      scheme_.follow(high);
      scheme_.finish();
      const std::size_t which = scheme_.found();
      if (which < counts_.by_switch.size()) return change(which);
      high += more;
    }
    scheme_.restart();
  }

  /// A step that rounding would swallow leaves the regime.
  void pass(Real h) {
    scheme_.regime().advance();
    scheme_.accept(h);
    scheme_.seek() ? change(scheme_.found()) : count_event();
  }

  /// The regime of the state begins.
  void change(std::size_t which) {
    scheme_.adopt();
    control_.restart();
    ++counts_.events;
    if (which < counts_.by_switch.size()) {
      ++counts_.by_switch[which];
      latest_ = which;
    }
    count_event();
  }

  /// Count an event, or a shortest step before one, if the last one was less than a thousandth of a step ago.  The run fails when the count
  /// is so large that some switch must have changed again and again.
  void count_event() {
    const Real since = time() - last_event_;
    events_in_a_row_ = since <= Real(1e-3) * h_ ? events_in_a_row_ + 1 : 0;
    last_event_ = time();
    if (events_in_a_row_ >= 50 + 2 * static_cast<long>(counts_.by_switch.size())) give_up_switching(since);
  }

  /// The shortest step that differs from none.
  Real least(Real t) const {
    using std::abs;
    return 16 * std::numeric_limits<Real>::epsilon() * std::max(abs(t), until_ - t);
  }

  /// The shortest step before an event.
  Real shortest() const { return 256 * least(time()); }

  [[noreturn]] void give_up_switching(Real since) const {
    const Switch& which = scheme_.switches()[latest_];
    throw Failure("'" + std::string(which.element) + "' (" + std::string(which.place) + ") switches to and fro without end",
                  static_cast<double>(time()), number_, std::string(which.element), static_cast<double>(since),
                  "make its law continuous there, or let steps go over it with events: crossed");
  }

  Scheme scheme_;
  StepControl<Real, Scheme::order> control_;
  Real until_, h_{0}, last_event_{-1};
  std::size_t latest_ = 0;
  long number_ = 0;
  long events_in_a_row_ = 0;
  bool begun_ = false;
  Watch stepped_;
  Counts counts_;
};

}  // namespace cutjoint::stepping
