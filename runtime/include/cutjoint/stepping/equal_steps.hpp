// Steps of equal length that are split at events.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "cutjoint/mechanism.hpp"
#include "cutjoint/core/retraction.hpp"
#include "cutjoint/core/road.hpp"
#include "cutjoint/state.hpp"
#include "cutjoint/core/stepping/regime.hpp"

namespace cutjoint::stepping {

/// The stages of core/stepping/implicit_scheme.hpp by a rule of order 2, whose one stage is the end of a step.
///
/// A rule has
///
/// - `description`, `blank`, a state with room for all, and `events`, the values of the switches in a state,
/// - `begin`, which makes a start the first state, and `restart`, accelerations and multipliers of a state's coordinates and speeds,
/// - `step`, a step of a given length; throws Failure, the state being then that before,
/// - `keep`, after a step that counts, and `go_back`, before another attempt from the last state that does,
/// - `enter`, which makes a time the present one,
/// - `project`, which closes the loops of a state as far as the rule does, `measure`, the residuals of one, and `summarise`.
///
/// Less than the share `least` of a step is left to the parabola of the last accelerations, with new ones at its end: a rule that divides by the
/// square of its step would keep no digits there.
template <class Rule>
class EqualSteps {
 public:
  using Real = typename Rule::Real;
  using Subject = typename Rule::Subject;

  static constexpr int order = 2;
  static constexpr bool estimates = false;

  EqualSteps(Rule& rule, const std::vector<Road<Real>>& roads, Real dt)
      : rule_(rule), places_(places_of(rule.description().switches)), regime_(places_, roads.data()), dt_(dt), start_(rule.blank()), at_(start_), way_(start_.v), moved_(start_.v) {}

  std::size_t size() const { return start_.q.size() + start_.v.size(); }
  std::span<const Chart> charts() const { return rule_.description().charts; }

  std::vector<Real> begin(const State<Real>& start) {
    rule_.begin(start, start_);
    keep();
    adopt();
    std::vector<Real> y(start_.q);
    y.insert(y.end(), start_.v.begin(), start_.v.end());
    return y;
  }

  /// The state of a row, which is the end of a step.
  const State<Real>& complete(Real, const std::vector<Real>&) const { return start_; }

  /// Try a step of length h from the present state; whether its end was found.
  bool attempt(Real h, bool, long number) {
    regime_.begin(start_.t);
    if (std::exchange(tried_, true)) rule_.go_back(start_);
    at_ = start_;
    const bool found = move(h, number);
    at_.t = start_.t + h;
    if (!regime_.empty()) {
      rule_.events(at_, regime_.values());
      regime_.look(at_.t);
    }
    return found;
  }

  /// The attempted step counts: its end becomes the present state, and `before` the one before it.
  Fault accept(Real h, State<Real>& before) {
    std::swap(before, start_);
    std::swap(start_, at_);
    if (h < Real(1e-4) * dt_)  // a difference of coordinates has their rounding, which a rate over so short a time must not have
      for (std::size_t i = 0; i < moved_.size(); ++i) moved_[i] = h / 2 * (before.v[i] + start_.v[i]);
    else
      displacement<Real>(charts(), before.q.data(), start_.q.data(), moved_.data());
    keep();
    return {};
  }

  const State<Real>& present() const { return start_; }

  /// Accelerations and multipliers of a state as guides need them: those that it has.
  void accelerate(State<Real>&) const {}

  /// The displacement by the last step, in the chart of its start.
  const std::vector<Real>& moved() const { return moved_; }

  /// Coordinates and speeds of another state become those of the present one; `restart` has to follow.
  void go_to(const State<Real>& state) {
    start_.t = state.t;
    start_.q = state.q;
    start_.v = state.v;
  }

  /// Accelerations and multipliers of the present state, which forces that jump change.  Throws Failure, as the rule does.
  Fault restart() {
    rule_.restart(start_);
    keep();
    return {};
  }

  /// Go over to the regime of the present state.
  void adopt() {
    if (regime_.empty()) return;
    rule_.events(start_, regime_.values());
    regime_.adopt();
  }

  /// Seek the switches that a state has out of the regime; whether there are any.
  bool seek(const State<Real>& state) {
    rule_.events(state, regime_.values());
    return regime_.seek();
  }

  /// The first of them that a state has out of the regime; as many as there are switches if there is none.
  std::size_t found(const State<Real>& state) {
    rule_.events(state, regime_.values());
    return regime_.found();
  }

  /// The mechanism or system goes to the time of the present state, which an attempt has left.
  Real enter() {
    rule_.enter(start_.t);
    return start_.t;
  }

  Regime<Subject>& regime() { return regime_; }

  /// Close the loops of a state that lies between steps.  Throws Failure, as the rule does.
  Fault project(State<Real>& state) {
    rule_.project(state);
    return {};
  }

  long evaluations() const { return rule_.evaluations(); }

  /// Throws the Failure of the last attempt, which has no end.
  [[noreturn]] Fault give_up(bool, bool, long, Real) const { throw Failure(*failure_); }

 private:
  /// To the end of a step; where that is not found, to where the last accelerations would lead.
  bool move(Real h, long number) {
    try {
      if (h < Real(Rule::least) * dt_) {
        extrapolate(h);
        rule_.project(at_);
        rule_.restart(at_);
      } else {
        rule_.step(at_, h, number);
      }
      return true;
    } catch (const Failure& failure) {
      failure_ = failure;
      at_ = start_;
      extrapolate(h);
      return false;
    }
  }

  void extrapolate(Real h) {
    for (std::size_t i = 0; i < way_.size(); ++i) {
      way_[i] = h * start_.v[i] + h * h / 2 * start_.vdot[i];
      at_.v[i] = start_.v[i] + h * start_.vdot[i];
    }
    retract<Real>(charts(), start_.q.data(), way_.data(), at_.q.data());
    at_.t = start_.t + h;
  }

  void keep() {
    rule_.keep();
    tried_ = false;
  }

  Rule& rule_;
  std::vector<SwitchPlace> places_;
  Regime<Subject> regime_;
  Real dt_;
  State<Real> start_, at_;  ///< at the step's start, and its attempted end
  std::vector<Real> way_, moved_;
  std::optional<Failure> failure_;
  bool tried_ = false;
};

}  // namespace cutjoint::stepping
