// Steps that end at events, where a formula of the forces, guides or drives changes.
#pragma once

#include <limits>

#include "cutjoint/core/simulation/fault.hpp"
#include "cutjoint/core/stepping/step_control.hpp"

namespace cutjoint::stepping {

/// Numbers of steps and attempts.
template <class M>
struct Counts {
  long steps = 0, rejected = 0, events = 0;
  Array<M, static_sizes<M>().indicators, long> by_indicator;  ///< events

  explicit Counts(std::size_t indicators) : by_indicator(indicators) {}
};

/// The outcome of an attempt of a step.
template <class Real>
struct Attempt {
  Real size{0};       ///< error relative to the tolerance: 0 without an estimate, infinite if it is not a number
  bool found = true;  ///< whether all stages were found
};

/// A time before all others.
template <class Real>
constexpr Real before_all = -std::numeric_limits<Real>::infinity();

/// State of a stepper: `limit` that no step crosses, length of the next step, events and their indicators, number of the sample.
template <class Real>
struct Progress {
  Real limit{0}, h{0}, last_event{-1};
  std::size_t latest = 0;    ///< the indicator that last ended a mode
  std::size_t switched = 0;  ///< the indicator of the last event
  Real since{before_all<Real>};  ///< time of that event
  Real soon{-1};  ///< time to the next event if the last step predicts it and does not reach it; else negative
  long number = 0, events_in_a_row = 0;
  bool begun = false;
};

/// Advances a scheme by adaptive steps, or by one step per sample if the scheme has no error estimate.
///
/// A mode is the set of formulas in force (see IndicatorCells). A step whose stages all lie in one mode has the order of the method.
/// If a stage leaves the mode, the step is repeated, shorter, so that it ends just before. Its interpolant, which knows one mode only,
/// is followed to the zero of the indicator. There the step ends, and the next one begins in the new mode. The order is kept: the
/// event has an error of the interpolant's order, and there is one such step per event, whatever the step length. Interpolants of
/// methods of high order are hundreds of times less accurate beyond the step (`reaches_beyond` is false): a short step then precedes
/// the event. An equal step whose stages do not converge is divided into substeps if the scheme `divides` it.
///
/// A scheme has a present state and a trial state:
///
/// - `begin` takes the state y at t, `left` before the end, and returns the length of the first step,
/// - `attempt` tries a step of length h from the present state; it may end where it leaves the mode, unless `whole`,
/// - `advance` continues the mode at the end of the attempt, `accept` makes that end the present state,
/// - `follow` evaluates the trial state at a fraction of the last step, which may exceed 1, and returns its time,
/// - `seek` collects the indicators by which the trial state has left the mode, `found` is the first of them (see IndicatorCells),
/// - `finish` projects the trial state, which becomes the present one; it and `read` return a fault if loops do not close,
/// - `restart` discards the history of steps, as `adopt` does, and enters the mode of the present state; both return a fault if it has
/// no accelerations,
/// - `pose` has the coordinates of the present state (explicit schemes: and the velocities); `read_struck` is that state with the
/// velocities before projection, without accelerations, which `complete_struck` adds; `take_speeds` replaces its velocities,
/// - `read_end` is the present state, with accelerations and multipliers if guides need them, `read_between` a state within the last step,
/// - `read` is y at the time of a sample, which `lies_between` the ends of the last step or is that of the present state,
/// - `length` is the length of the next step: the largest that the error allows, or that of the last one.
template <class Scheme>
class Stepper {
 public:
  using Real = typename Scheme::Real;
  using Vector = typename Scheme::Vector;

  /// `end` is the end of the integration, which no step crosses. `how` are further arguments of the scheme.
  template <class Dynamics, class... How>
  Stepper(Dynamics& dynamics, const Tolerances<Real>& tolerances, Real end, How&&... how)
      : scheme_(dynamics, tolerances, std::forward<How>(how)...), end_(end), relative_(tolerances.relative), counts_(scheme_.cells().size()) {
    now_.limit = end;
  }

  /// Integrate from y at t to `until`, the time of sample `number`. Adaptive steps do not end at samples: y is interpolated. Fault: step too small.
  Fault advance(Real t, Real until, Vector& y, long number) {
    if (const Fault fault = step_to(t, until, y, number, false)) return fault;
    return scheme_.read(until, time() - until > shortest(), y);
  }

  /// Integrate from y at t to `until` or to the end of a step with an event, whichever comes first; `time` is where.
  Fault advance_to_event(Real t, Real until, Vector& y, long number) {
    if (const Fault fault = step_to(t, until, y, number, true)) return fault;
    return scheme_.read(time(), false, y);
  }

  /// Continue from another y at t with the present step length.
  void go_to(Real t, const Vector& y) {
    scheme_.go_to(t, y);
    go_on();
  }

  /// Continue after the scheme has been given its state.
  void go_on() {
    control_.restart();
    now_.soon = Real(-1);
    if (time() < now_.since) now_.since = before_all<Real>;
  }

  /// Change the end of the integration.
  void run_to(Real end) { end_ = now_.limit = end; }

  /// Let no later step cross a time.
  void limit(Real limit) { now_.limit = limit; }

  /// The time that no step crosses, at most the end of the integration.
  void limit_before_end(Real limit) { now_.limit = std::min(limit, end_); }

  /// Largest number of attempts in one call; unlimited by default.
  void bound(long most) { most_ = most; }

  Real time() const { return scheme_.time(); }

  /// Set a callback after each step.
  struct Watch {
    void (*call)(void* who, Scheme& scheme) = nullptr;
    void* who = nullptr;
  };

  void watch(const Watch& watch) { watch_ = watch; }

  /// Set a callback at events, before the new mode begins; it may change the velocities. `since` is the time of the previous event.
  struct Strike {
    void (*call)(void* who, Scheme& scheme, std::size_t which, Real since) = nullptr;
    void* who = nullptr;
  };

  void strike_by(const Strike& strike) { strike_ = strike; }

  /// Set a callback after each accepted step, before its end is final: `end` is that, less rounding.  If it returns an earlier time, the step ends there by its
  /// interpolant; if a later one, an event up to there may end it.
  struct Shorten {
    Real (*call)(void* who, Scheme& scheme, Real end) = nullptr;
    void* who = nullptr;
  };

  void shorten_by(const Shorten& shorten) { shorten_ = shorten; }

  long steps() const { return counts_.steps; }
  const Counts<typename Scheme::Subject>& counts() const { return counts_; }
  Scheme& scheme() { return scheme_; }
  const Scheme& scheme() const { return scheme_; }

  /// The indicator of the last event, or the number of indicators if none explains it.
  std::size_t last_event() const { return now_.switched; }

  /// Memory for the next steps, without their counts.
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
      if (scheme_.adaptive() && scheme_.cells().is_undecided()) now_.soon = Real(0);  // a shortest step precedes a jump at the start
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

  /// Time at which the recent attempts began.
  struct Pace {
    Real time;
    long attempts, events;
  };

  long attempts() const { return counts_.steps + counts_.rejected; }

  /// A fault if the run would need 1e8 more attempts, for example because forces jump where a motion comes to rest.
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

  /// One step, or its part before an event.
  Fault step(Real limit) {
    const Real left = limit - time();
    Real h = scheme_.adaptive() ? std::min(now_.h, left) : left;
    if (left - h < h / 1000) h = left;
    Real span_left = std::exchange(now_.soon, Real(-1));  // to where the mode is left, if it is
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
        const Real end = time() - shortest();
        if (shorten_.who && (limit = std::min(limit, shorten_.call(shorten_.who, scheme_, end))) < end) return end_at(limit);
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

  /// By how much the state at a fraction of the last step has left the mode by the sought indicators; at most zero if it has not.
  Real beyond(Real s) {
    scheme_.follow(s);
    const bool left = scheme_.found() < counts_.by_indicator.size();
    const Real distance = scheme_.cells().beyond();
    return left ? std::max(distance, std::numeric_limits<Real>::min()) : std::min(distance, Real(0));
  }

  /// Tolerance of an event's time as a fraction of a step: indicators have rounding errors of their own.
  static Real sharp() { return 2048 * std::numeric_limits<Real>::epsilon(); }

  /// Find where the state leaves the mode between `low`, where it has not, and `high`: bisection or inverse quadratic interpolation if
  /// that is safe. Source: Chandrupatla, Advances in Engineering Software 28 (1997) 145-149.
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

  /// The next trial point between a and b, the ends of the bracket.
  static Real share_of(Real a, Real b, Real c, Real fa, Real fb, Real fc) {
    using std::abs;
    const Real least = std::min(Real(0.5), sharp() / 2 / abs(b - a));
    const Real xi = (a - b) / (c - b), phi = (fa - fb) / (fc - fb);
    Real share(0.5);
    if (phi * phi < xi && (1 - phi) * (1 - phi) < 1 - xi)
      share = fa / (fb - fa) * fc / (fb - fc) + (c - a) / (b - a) * fa / (fc - fa) * fb / (fc - fb);
    return std::clamp(share, least, 1 - least);
  }

  /// The fraction of a step up to which other indicators count as simultaneous with the one at the fraction s of h, such as wheels side by
  /// side at an edge of the road: a tenth of the error that a step may have, or the effect of rounding.
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

  /// The number of sought indicators by which the state at a fraction of the last step has left the mode.
  std::size_t out_at(Real s) {
    scheme_.follow(s);
    scheme_.found();
    return scheme_.cells().count_out();
  }

  /// Continue from the end of the last step, of length h, to the end of the mode if that is close, or to the limit if that is closer.
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
    if constexpr (std::remove_cvref_t<decltype(scheme_.cells())>::has_continuous) {  // the first stage after the event has the one-sided derivative there
      scheme_.follow(high);
      if (scheme_.cells().is_continuous(scheme_.found())) high += Real(1e-6);
    }
    if (scheme_.follow(high) > limit + shortest()) return end_at(limit);
    for (Real more = sharp() / 16; more < Real(1e-3); more *= 8) {  // settling must not take the state back
      scheme_.follow(high);
      if (const Fault fault = scheme_.finish()) return fault;
      const std::size_t which = scheme_.found();
      if (which < counts_.by_indicator.size()) return change(which);
      high += more;
    }
    return scheme_.restart();
  }

  /// The last step ends at a time, in the mode that it had.
  Fault end_at(Real t) {
    scheme_.follow_to(t);
    if (const Fault fault = scheme_.finish()) return fault;
    return scheme_.restart();
  }

  /// A step too short for rounding leaves the mode.
  Fault pass(Real h) {
    scheme_.cells().advance();
    if (const Fault fault = scheme_.accept(h)) return fault;
    ++counts_.steps;
    return scheme_.seek() ? change(scheme_.found()) : count_event();
  }

  /// Enter the mode of the state; `which` is the first indicator by which it has left the last one.
  Fault change(std::size_t which) {
    leave_by(which);
    for (std::size_t i = which + 1; i < counts_.by_indicator.size(); ++i)
      if (scheme_.cells().is_sought_out(i)) leave_by(i);
    if (const Fault fault = scheme_.adopt()) return fault;
    control_.restart();
    return count_event();
  }

  /// An indicator ends the mode, or none that explains the end.
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

  /// Count an event, or a shortest step before one, less than 1e-3 of a step after the last. The run fails if some indicator keeps changing.
  Fault count_event() {
    const Real since = time() - now_.last_event;
    now_.events_in_a_row = since <= Real(1e-3) * now_.h ? now_.events_in_a_row + 1 : 0;
    now_.last_event = time();
    if (now_.events_in_a_row >= 50 + 2 * static_cast<long>(counts_.by_indicator.size()))
      return {.cause = Cause::chattering, .list = FaultList::indicators, .index = static_cast<int>(now_.latest),
              .t = static_cast<double>(time()), .step = now_.number, .value = static_cast<double>(since)};
    return {};
  }

  /// The shortest step that is not lost in rounding.
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
  Shorten shorten_;
  Counts<typename Scheme::Subject> counts_;
};

}  // namespace cutjoint::stepping
