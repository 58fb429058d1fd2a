// Steps that end where a formula of the forces, guides or drives changes.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <type_traits>
#include <utility>

#include "cutjoint/core/numbers/arrays.hpp"
#include "cutjoint/core/simulation/fault.hpp"
#include "cutjoint/core/stepping/step_control.hpp"

namespace cutjoint::stepping {

/// Counts of steps and attempts.
template <class M>
struct Counts {
  long steps = 0, rejected = 0, events = 0;
  Array<M, static_sizes<M>().indicators, long> by_indicator;  ///< events

  explicit Counts(std::size_t indicators) : by_indicator(indicators) {}
};

/// The outcome of an attempt of a step.
template <class Real>
struct Attempt {
  Real size{0};       ///< of the error, 1 being what is allowed: 0 where it is not estimated, infinite where it is no number
  bool found = true;  ///< whether all stages were found
};

/// A time before any.
template <class Real>
constexpr Real before_all = -std::numeric_limits<Real>::infinity();

/// Where a stepper stands: `limit`, beyond which no step goes, the length of the next step, events and the indicators behind them, the row's number.
template <class Real>
struct Progress {
  Real limit{0}, h{0}, last_event{-1};
  std::size_t latest = 0;    ///< the indicator by which a regime was left last
  std::size_t switched = 0;  ///< that of the last event
  Real since{before_all<Real>};  ///< when that was
  Real soon{-1};  ///< how far the next event is, where the last step has told it and does not reach there; below zero else
  long number = 0, events_in_a_row = 0;
  bool begun = false;
};

/// Advances a scheme by steps as long as the error allows, or without an estimate by one step a row.
///
/// A step all of whose stages are in one regime is as accurate as the formulas are smooth.  One that leaves the regime is taken again,
/// shorter, so that it ends a little before.  Its interpolant knows one regime only, and goes on to where an indicator leaves its cell.  There
/// the step ends, and the next one begins in the new regime.  Nothing of the order is lost: a step's end lies there with an error of the
/// order of the interpolant's, and there are as many such ends as events, however short the steps.  Beyond a step of a method of high order its
/// interpolant loses hundreds of times as much as within (such a scheme has no `reaches_beyond`): another, short step then ends before the event.
/// An equal step whose stages are not found is taken in parts, if the scheme `divides` it.
///
/// A scheme has a present state, and a trial one beside it:
///
/// - `begin` takes over y at t, `left` before the end, and returns the length of a first step,
/// - `attempt` tries a step of length h from the present state; it may end where it leaves the regime, but not if `whole`,
/// - `advance` makes the regime go on at the end of the attempt, `accept` makes that end the present state,
/// - `follow` puts the trial state at a share of the last step's length, which may be above 1, and returns its time,
/// - `seek` seeks the indicators that the trial state has out of the regime, `found` is the first of these (see IndicatorCells),
/// - `finish` closes the loops of the trial state, which becomes the present one; these and `read` return a fault where loops do not close,
/// - `restart` forgets what is known of the steps before, `adopt` too, and goes over to the regime of the present state; they return a fault where it has
///   no accelerations,
/// - `pose` has the coordinates of the present state, of an explicit scheme with the speeds behind them; `read_struck` is that state with the speeds that it had before its loops were closed, without
///   accelerations, which `complete_struck` finds, and `take_speeds` gives it others,
/// - `read_end` is the present state, with accelerations and multipliers where guides need them, `read_between` one at a time of the last step,
/// - `read` is y at the time of a row, which `lies_between` the ends of the last step or is that of the present state,
/// - `length` is that of the next step: the one that the error allows, or that of the last one.
template <class Scheme>
class Stepper {
 public:
  using Real = typename Scheme::Real;
  using Vector = typename Scheme::Vector;

  /// `end` is where the integration ends: no step goes beyond.  `how` is what else the scheme is made with.
  template <class Dynamics, class... How>
  Stepper(Dynamics& dynamics, const Tolerances<Real>& tolerances, Real end, How&&... how)
      : scheme_(dynamics, tolerances, std::forward<How>(how)...), end_(end), relative_(tolerances.relative), counts_(scheme_.cells().size()) {
    now_.limit = end;
  }

  /// Go on from y at t to `until`; `number` is the row's.  Steps of adaptive methods do not end at rows: y is then what lies between.
  /// There is a fault where no step is small enough.
  Fault advance(Real t, Real until, Vector& y, long number) {
    if (const Fault fault = step_to(t, until, y, number, false)) return fault;
    return scheme_.read(until, time() - until > shortest(), y);
  }

  /// Go on from y at t, to `until` or to the end of a step at which an event lies; `time` says where.
  Fault advance_to_event(Real t, Real until, Vector& y, long number) {
    if (const Fault fault = step_to(t, until, y, number, true)) return fault;
    return scheme_.read(time(), false, y);
  }

  /// Go on from another y at t, with steps as long as before.
  void go_to(Real t, const Vector& y) {
    scheme_.go_to(t, y);
    go_on();
  }

  /// Go on where the scheme has been given its state.
  void go_on() {
    control_.restart();
    now_.soon = Real(-1);
    if (time() < now_.since) now_.since = before_all<Real>;
  }

  /// The integration ends elsewhere.
  void run_to(Real end) { end_ = now_.limit = end; }

  /// No step goes beyond from now on.
  void limit(Real limit) { now_.limit = limit; }

  /// No step goes beyond, nor beyond the end of the integration.
  void limit_before_end(Real limit) { now_.limit = std::min(limit, end_); }

  /// Steps that one call may try; without a bound as many as it takes.
  void bound(long most) { most_ = most; }

  Real time() const { return scheme_.time(); }

  /// A call after each step.
  struct Watch {
    void (*call)(void* who, Scheme& scheme) = nullptr;
    void* who = nullptr;
  };

  void watch(const Watch& watch) { watch_ = watch; }

  /// A call where a step has ended at an event of an indicator, before the new regime begins: it may change the speeds.  `since` is when the event before was.
  struct Strike {
    void (*call)(void* who, Scheme& scheme, std::size_t which, Real since) = nullptr;
    void* who = nullptr;
  };

  void strike_by(const Strike& strike) { strike_ = strike; }

  long steps() const { return counts_.steps; }
  const Counts<typename Scheme::Subject>& counts() const { return counts_; }
  Scheme& scheme() { return scheme_; }
  const Scheme& scheme() const { return scheme_; }

  /// The indicator of the last event; as many as there are indicators for one that none of them explains.
  std::size_t last_event() const { return now_.switched; }

  /// Memory of the next steps, besides their counts.
  struct Memory {
    typename Scheme::Memory scheme;
    StepControl<Real, Scheme::order> control;
    Progress<Real> now;
  };

  Memory memory() const { return {.scheme = scheme_.memory(), .control = control_, .now = now_}; }

  void restore(const Memory& memory) {
    scheme_.restore(memory.scheme);
    control_ = memory.control;
    now_ = memory.now;
  }

 private:
  Fault step_to(Real t, Real until, const Vector& y, long number, bool to_event) {
    now_.number = number;
    if (!now_.begun) {
      const Real first = scheme_.begin(t, y, now_.limit - t);
      if (scheme_.adaptive()) now_.h = first;
      now_.begun = true;
    }
    if (!scheme_.adaptive()) now_.h = until - time();
    const long events = counts_.events, tried = attempts();
    Pace pace{time(), tried, events};
    while (until - time() > least(until) && !(to_event && counts_.events > events)) {
      if (attempts() - tried >= most_)
        return {.cause = Cause::too_many_steps, .t = static_cast<double>(time()), .step = number, .iterations = static_cast<int>(most_)};
      if (const Fault fault = step(scheme_.adaptive() ? now_.limit : until)) return fault;
      if (const Fault fault = keep(pace)) return fault;
      if (watch_.call) watch_.call(watch_.who, scheme_);
    }
    return {};
  }

  /// Where the attempts of the last while began.
  struct Pace {
    Real time;
    long attempts, events;
  };

  long attempts() const { return counts_.steps + counts_.rejected; }

  /// A fault where a row's attempts bring a run so little forward that the rest of it would take a hundred million of them.  Forces that jump where
  /// a motion comes to rest make steps so short: at their events, or over these.
  Fault keep(Pace& pace) {
    constexpr long some = 2000, rest = 50000;
    if (attempts() - pace.attempts < some) return {};
    const Real span_left = time() - pace.time;
    const bool has_events = counts_.events > pace.events;
    pace = {time(), attempts(), counts_.events};
    if (!(end_ - time() > Real(rest) * span_left)) return {};
    Fault fault{.cause = Cause::chattering, .list = FaultList::indicators, .index = static_cast<int>(now_.latest),
                .t = static_cast<double>(time()), .step = now_.number};
    if (!has_events) {
      fault = scheme_.give_up(typename Scheme::Attempt{}, counts_.steps, now_.number);
      if (fault.cause != Cause::pose_singular) fault.cause = Cause::step_size_too_small;
    }
    fault.value = static_cast<double>(span_left) / some;
    return fault;
  }

  /// One step, or the part of it before an event.
  Fault step(Real limit) {
    const Real left = limit - time();
    Real h = scheme_.adaptive() ? std::min(now_.h, left) : left;
    if (left - h < h / 1000) h = left;
    Real span_left = std::exchange(now_.soon, Real(-1));  // to where the regime is left, if it is
    if (span_left >= Real(0)) h = std::min(h, std::max(Real(0.9) * span_left, shortest()));
    for (;; ++counts_.rejected) {
      const bool whole = h <= shortest();
      const Attempt<Real> attempt = scheme_.attempt(h, whole, now_.number);
      if (scheme_.cells().crossed()) {
        if (whole && attempt.found) return pass(h);
        if (!whole) {
          const Real last = span_left;
          span_left = scheme_.cells().crossing() - time();
          now_.latest = scheme_.cells().first();
          const bool sure = attempt.found && span_left > last * Real(0.9) && span_left < last * Real(1.1);
          h = std::max(std::clamp(Real(0.9) * span_left, sure ? Real(0) : h / 10, Real(0.9) * h), shortest());
          continue;
        }
      }
      if (attempt.found && attempt.size <= Real(1)) {
        if (const Fault fault = accept(h, attempt.size)) return fault;
        if (!(span_left >= Real(0))) return {};
        if (whole)
          if (const Fault fault = count_event()) return fault;
        return locate(limit, h);
      }
      const bool divides = scheme_.adaptive() || (Scheme::divides && !attempt.found && h > left / 64);
      if (!divides || !(h > least(time()))) return scheme_.give_up(attempt, counts_.steps, now_.number);
      now_.h = h = attempt.found ? control_.instead_of(h, attempt.size) : h / 4;
    }
  }

  Fault accept(Real h, Real size) {
    if (scheme_.adaptive()) {
      const Real next = control_.after(h, size);
      if (next > now_.h || h >= now_.h) now_.h = scheme_.length(h, next);
    }
    scheme_.advance(h);
    if (const Fault fault = scheme_.accept(h)) return fault;
    ++counts_.steps;
    return {};
  }

  /// How far the state at a share of the last step has left the regime by an indicator that is sought; at most zero where it has not.
  Real beyond(Real s) {
    scheme_.follow(s);
    const bool left = scheme_.found() < counts_.by_indicator.size();
    const Real distance = scheme_.cells().beyond();
    return left ? std::max(distance, std::numeric_limits<Real>::min()) : std::min(distance, Real(0));
  }

  /// How exactly the end of a regime is sought, as a share of a step: indicators have rounding of their own.
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

  /// The share of a step in which an indicator leaves the regime together with the one that leaves it at the share s of h: wheels side by side meet an edge of
  /// the road, and a law has conditions that say the same in other units.  That is ten times less than a whole step may err by, or what rounding moves.
  Real share_together(Real s, Real h) {
    constexpr Real most(0x1p-10);
    using std::abs;
    const Real least = std::clamp(relative_ / 10 * now_.h / h, Real(0x1p-34), Real(0x1p-14));
    scheme_.follow(s);
    const std::size_t which = scheme_.found();
    if (which == counts_.by_indicator.size()) return least;
    const auto& cells = scheme_.cells().memory();
    const Real value = cells.values[which];
    scheme_.follow(s + least);
    scheme_.found();
    return std::clamp(16 * cells.noise[which] * least / abs(cells.values[which] - value), least, most);
  }

  /// How many of the indicators that are sought the state at a share of the last step has out of the regime.
  std::size_t out_at(Real s) {
    scheme_.follow(s);
    scheme_.found();
    return scheme_.cells().count_out();
  }

  /// Go on from the end of the last step, of length h, to where the regime ends, if that is near, or to the limit, if that is nearer.
  Fault locate(Real limit, Real h) {
    const Real low(1);
    Real high(1.3);
    scheme_.follow(high);
    if (!scheme_.seek()) return {};
    const Real at_high = beyond(high), at_low = beyond(low);
    if (at_high > Real(0)) high = at_low > Real(0) ? low : find_end(low, high, at_low, at_high);
    if (!Scheme::reaches_beyond && high > Real(1.01) && h > Real(0.3) * now_.h) {
      now_.soon = (high - low) * h;
      return {};
    }
    if (const Real more = share_together(high, h); out_at(high + more) > out_at(high)) high += more;
    if constexpr (std::remove_cvref_t<decltype(scheme_.cells())>::has_continuous) {  // the first stage behind has the derivative of its side
      scheme_.follow(high);
      if (scheme_.cells().is_continuous(scheme_.found())) high += Real(1e-6);
    }
    if (scheme_.follow(high) > limit + shortest()) {
      scheme_.follow_to(limit);
      if (const Fault fault = scheme_.finish()) return fault;
      return scheme_.restart();
    }
    for (Real more = sharp() / 16; more < Real(1e-3); more *= 8) {  // settling must not take the state back
      scheme_.follow(high);
      if (const Fault fault = scheme_.finish()) return fault;
      const std::size_t which = scheme_.found();
      if (which < counts_.by_indicator.size()) return change(which);
      high += more;
    }
    return scheme_.restart();
  }

  /// A step that rounding would swallow leaves the regime.
  Fault pass(Real h) {
    scheme_.cells().advance();
    if (const Fault fault = scheme_.accept(h)) return fault;
    ++counts_.steps;
    return scheme_.seek() ? change(scheme_.found()) : count_event();
  }

  /// The regime of the state begins, of which `which` is the first indicator that it has out of the last one.
  Fault change(std::size_t which) {
    leave_by(which);
    for (std::size_t i = which + 1; i < counts_.by_indicator.size(); ++i)
      if (scheme_.cells().is_sought_out(i)) leave_by(i);
    if (const Fault fault = scheme_.adopt()) return fault;
    control_.restart();
    return count_event();
  }

  /// A indicator leaves the regime, or none that explains why it ends.
  void leave_by(std::size_t which) {
    if (strike_.call) strike_.call(strike_.who, scheme_, which, now_.since);
    ++counts_.events;
    now_.switched = which;
    now_.since = time();
    if (which < counts_.by_indicator.size()) {
      ++counts_.by_indicator[which];
      now_.latest = which;
    }
  }

  /// Count an event, or a shortest step before one, if the last one was less than a thousandth of a step ago.  The run fails when the count
  /// is so large that some indicator must have changed again and again.
  Fault count_event() {
    const Real since = time() - now_.last_event;
    now_.events_in_a_row = since <= Real(1e-3) * now_.h ? now_.events_in_a_row + 1 : 0;
    now_.last_event = time();
    if (now_.events_in_a_row >= 50 + 2 * static_cast<long>(counts_.by_indicator.size()))
      return {.cause = Cause::chattering, .list = FaultList::indicators, .index = static_cast<int>(now_.latest),
              .t = static_cast<double>(time()), .step = now_.number, .value = static_cast<double>(since)};
    return {};
  }

  /// The shortest step that differs from none.
  Real least(Real t) const {
    using std::abs;
    return 16 * std::numeric_limits<Real>::epsilon() * std::max(abs(t), end_ - t);
  }

  /// The shortest step before an event.
  Real shortest() const { return 256 * least(time()); }

  Scheme scheme_;
  StepControl<Real, Scheme::order> control_;
  Real end_, relative_;
  long most_ = std::numeric_limits<long>::max();
  Progress<Real> now_;
  Watch watch_;
  Strike strike_;
  Counts<typename Scheme::Subject> counts_;
};

}  // namespace cutjoint::stepping
