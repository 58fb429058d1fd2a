// Steps of equal length that are split at events.
#pragma once

#include <cstddef>
#include <span>
#include <utility>

#include "cutjoint/core/numbers/arrays.hpp"
#include "cutjoint/core/simulation/fault.hpp"
#include "cutjoint/core/mechanism/mechanism.hpp"
#include "cutjoint/core/mechanism/retraction.hpp"
#include "cutjoint/core/roads/road.hpp"
#include "cutjoint/core/mechanism/state.hpp"
#include "cutjoint/core/stepping/indicator_cells.hpp"

namespace cutjoint::stepping {

/// The stages of implicit_scheme.hpp by a rule of order 2, whose one stage is the end of a step.
///
/// A rule has
///
/// - `subject`, what is stepped, and `events`, the values of the indicators in a state,
/// - `start`, which takes over a first state, and `restart`, accelerations and multipliers of a state's coordinates and speeds,
/// - `step`, a step of a given length; where it fails the state is that before,
/// - `keep`, after a step that counts, and `go_back`, before another attempt from the last state that does,
/// - `complete`, if accelerations and multipliers of a step only come near to those that guides need,
/// - `enter`, which makes a time the present one, and `project`, which closes the loops of a state as far as the rule does.
///
/// Less than the share `least` of a step is left to the parabola of the last accelerations, with new ones at its end: a rule that divides by the
/// square of its step would keep no digits there.
template <class Rule>
class EqualSteps {
 public:
  using Real = typename Rule::Real;
  using Subject = typename Rule::Subject;
  using State = StateOf<Subject>;

  static constexpr int order = 2;
  static constexpr bool estimates = false;

  EqualSteps(Rule& rule, IndicatorPlaces<Subject> indicators, const Road<Real>* roads, Real dt)
      : rule_(rule), cells_(std::move(indicators), roads), dt_(dt), start_(design_state(rule.subject())), at_(start_), shift_(start_.v), moved_(start_.v) {}

  std::size_t size() const { return start_.q.size() + start_.v.size(); }
  std::span<const Chart> charts() const { return charts_of(rule_.subject()); }

  /// Take over a first state.
  Fault begin(State& state) {
    if (const Fault fault = rule_.start(state)) return fault;
    start_ = state;
    keep();
    adopt();
    return {};
  }

  /// Try a step of length h from the present state; whether its end was found.
  bool attempt(Real h, bool, long number) {
    cells_.begin(start_.t);
    if (std::exchange(tried_, true)) rule_.go_back(start_);
    at_ = start_;
    const bool found = move(h, number);
    at_.t = start_.t + h;
    if (!cells_.empty()) {
      rule_.events(at_, cells_.values());
      cells_.look(at_.t);
    }
    return found;
  }

  /// The attempted step counts: its end becomes the present state, and `before` the one before it.
  Fault accept(Real h, State& before) {
    std::swap(before, start_);
    std::swap(start_, at_);
    for (std::size_t i = 0; i < moved_.size(); ++i) moved_[i] = h / 2 * (before.v[i] + start_.v[i]);
    if (!(h < Real(1e-4) * dt_))  // a difference of coordinates has their rounding, which a rate over so short a time must not have
      displacement<Real>(charts(), before.q.data(), start_.q.data(), moved_.data());
    keep();
    return {};
  }

  const State& present() const { return start_; }

  /// Accelerations and multipliers of a state as guides need them: those that it has, unless the rule has better ones.
  void accelerate(State& state) {
    if constexpr (requires { rule_.complete(state); }) rule_.complete(state);
  }

  /// The displacement by the last step, in the chart of its start.
  const Speeds<Subject>& moved() const { return moved_; }

  /// Coordinates and speeds of another state become those of the present one; `restart` has to follow.
  void go_to(const State& state) {
    start_.t = state.t;
    start_.q = state.q;
    start_.v = state.v;
  }

  /// Accelerations and multipliers of the present state, which forces that jump change.
  Fault restart() {
    if (const Fault fault = rule_.restart(start_)) return fault;
    keep();
    return {};
  }

  /// Go over to the regime of the present state.
  void adopt() {
    if (cells_.empty()) return;
    rule_.events(start_, cells_.values());
    cells_.adopt();
  }

  /// Seek the indicators that a state has out of the regime; whether there are any.
  bool seek(const State& state) {
    rule_.events(state, cells_.values());
    return cells_.seek();
  }

  /// The first of them that a state has out of the regime; as many as there are indicators if there is none.
  std::size_t found(const State& state) {
    rule_.events(state, cells_.values());
    return cells_.found();
  }

  /// The present state, to whose time the mechanism or system goes, which an attempt has left.
  const State& enter() {
    rule_.enter(start_.t);
    return start_;
  }

  IndicatorCells<Subject>& cells() { return cells_; }

  /// Close the loops of a state that lies between steps.
  Fault project(State& state) { return rule_.project(state); }

  /// Why the last attempt has no end.
  Fault give_up(bool, bool, long number, Real) const {
    Fault fault = fault_;
    if (!fault) fault.t = static_cast<double>(start_.t);
    if (fault.step == 0) fault.step = number;
    return fault;
  }

 private:
  /// To the end of a step; where that is not found, to where the last accelerations would lead.
  bool move(Real h, long number) {
    if (h < Real(Rule::least) * dt_) {
      extrapolate(h);
      fault_ = rule_.project(at_);
      if (!fault_) fault_ = rule_.restart(at_);
    } else {
      fault_ = rule_.step(at_, h, number);
    }
    if (!fault_) return true;
    at_ = start_;
    extrapolate(h);
    return false;
  }

  void extrapolate(Real h) {
    for (std::size_t i = 0; i < shift_.size(); ++i) {
      shift_[i] = h * start_.v[i] + h * h / 2 * start_.vdot[i];
      at_.v[i] = start_.v[i] + h * start_.vdot[i];
    }
    retract<Real>(charts(), start_.q.data(), shift_.data(), at_.q.data());
    at_.t = start_.t + h;
  }

  void keep() {
    rule_.keep();
    tried_ = false;
  }

  Rule& rule_;
  IndicatorCells<Subject> cells_;
  Real dt_;
  State start_, at_;  ///< at the step's start, and its attempted end
  Speeds<Subject> shift_, moved_;
  Fault fault_;  ///< of the last attempt
  bool tried_ = false;
};

}  // namespace cutjoint::stepping
