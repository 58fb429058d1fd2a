// Equal steps that are split at events.
#pragma once

#include "cutjoint/core/simulation/fault.hpp"
#include "cutjoint/core/mechanism/retraction.hpp"
#include "cutjoint/core/mechanism/state.hpp"
#include "cutjoint/core/stepping/indicator_cells.hpp"

namespace cutjoint::stepping {

/// The stages of implicit_scheme.hpp for rules of order 2 whose only stage is the end of a step.
///
/// A rule has
///
/// - `subject`, the mechanism or system, and `events`, the values of the indicators for a state,
/// - `start`, which takes a first state, and `restart`, accelerations and multipliers for coordinates and velocities,
/// - `step`, a step of a given length; if it fails the state is unchanged,
/// - `keep` after an accepted step, and `go_back` before another attempt from the last accepted state,
/// - `complete`, if accelerations and multipliers of a step only approximate those that guides need,
/// - `enter`, which sets the present time, and `project`, which projects a state as the rule does.
///
/// A remainder below the fraction `least` of a step follows the last accelerations by a Taylor step: the rule divides by the square of its step.
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

  /// Take a first state.
  Fault begin(State& state) {
    if (const Fault fault = rule_.start(state)) return fault;
    start_ = state;
    keep();
    adopt();
    return {};
  }

  /// Try a step of length h from the present state; return whether its end was found.
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

  /// Accept the attempt: its end becomes the present state, and `before` the previous one.
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

  /// Accelerations and multipliers of a state as guides need them: its own, unless the rule has better ones.
  void accelerate(State& state) {
    if constexpr (requires { rule_.complete(state); }) rule_.complete(state);
  }

  /// The displacement of the last step in the chart of its start.
  const Speeds<Subject>& moved() const { return moved_; }

  /// Replace coordinates and velocities of the present state; `restart` must follow.
  void go_to(const State& state) {
    start_.t = state.t;
    start_.q = state.q;
    start_.v = state.v;
  }

  /// Accelerations and multipliers of the present state after forces have jumped.
  Fault restart() {
    if (const Fault fault = rule_.restart(start_)) return fault;
    keep();
    return {};
  }

  /// Enter the mode of the present state.
  void adopt() {
    if (cells_.empty()) return;
    rule_.events(start_, cells_.values());
    cells_.adopt();
  }

  /// Collect the indicators by which a state has left the mode; return whether there are any.
  bool seek(const State& state) {
    rule_.events(state, cells_.values());
    return cells_.seek();
  }

  /// The first of them; the number of indicators if there is none.
  std::size_t found(const State& state) {
    rule_.events(state, cells_.values());
    return cells_.found();
  }

  /// The present state; the mechanism or system returns to its time after an attempt.
  const State& enter() {
    rule_.enter(start_.t);
    return start_;
  }

  IndicatorCells<Subject>& cells() { return cells_; }

  /// Project a state between steps.
  Fault project(State& state) { return rule_.project(state); }

  /// Why the last attempt failed.
  Fault give_up(bool, bool, long number, Real) const {
    Fault fault = fault_;
    if (!fault) fault.t = static_cast<double>(start_.t);
    if (fault.step == 0) fault.step = number;
    return fault;
  }

 private:
  /// Step to the end; if that is not found, along the last accelerations.
  bool move(Real h, long number) {
    if (h < Real(Rule::least) * dt_) {
      taylor_step(charts(), start_, h, shift_, at_);
      fault_ = rule_.project(at_);
      if (!fault_) fault_ = rule_.restart(at_);
    } else {
      fault_ = rule_.step(at_, h, number);
    }
    if (!fault_) return true;
    at_ = start_;
    taylor_step(charts(), start_, h, shift_, at_);
    return false;
  }

  void keep() {
    rule_.keep();
    tried_ = false;
  }

  Rule& rule_;
  IndicatorCells<Subject> cells_;
  Real dt_;
  State start_, at_;  ///< start of the step, and end of the attempt
  Speeds<Subject> shift_, moved_;
  Fault fault_;  ///< of the last attempt
  bool tried_ = false;
};

}  // namespace cutjoint::stepping
