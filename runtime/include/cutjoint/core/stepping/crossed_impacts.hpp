// Equal steps across jumps of guides' rates.
#pragma once

#include "cutjoint/core/simulation/fault.hpp"
#include "cutjoint/core/constraints/impacts.hpp"
#include "cutjoint/core/mechanism/retraction.hpp"

namespace cutjoint {

/// Finds jumps within a step before it is taken, and starts the step from an equivalent state behind them.
///
/// From the start of the step the state follows a Taylor step of second order to the jump, receives the impulse, and goes back by a Taylor step
/// with the accelerations after it. A step from there has an error of the rule's order.
///
/// Indicators show when guides change their formulas.
template <class S>
class CrossedImpacts {
  using Indicators = Array<S, static_sizes<S>().indicators>;

 public:
  using Real = typename S::real_type;

  CrossedImpacts(S& subject, double end)
      : subject_(subject), impacts_(subject, end), before_(design_state(subject)), shift_(sizes_of(subject).speeds),
        from_(indicators()), now_(from_) {}

  /// Apply the jumps within a step of h; `accelerate` finds accelerations and multipliers, `watch` is as for Impacts. Returns whether there were any.
  bool meet(StateOf<S>& state, Real h, auto accelerate, auto watch) {
    if (!impacts_.possible()) return false;
    using std::abs;
    const Real begin = state.t, end = begin + h;
    bool met = false;
    const Real after = abs(searched_ - begin) <= impacts_.width(end) ? searched_ : begin;  // rounding leaves nothing out between steps, nor has it twice
    searched_ = end;
    for (Jump jump = find(state, after, end); jump.is_found; jump = find(state, jump.after, end)) {
      taylor_step(charts_of(subject_), state, jump.before - begin, shift_, state);
      state.t = jump.before;
      accelerate(state);
      watch.reach(state);
      const Real work = impacts_.strike(state, jump.after);
      accelerate(state);
      watch.leave(state, work, jump.which);
      taylor_step(charts_of(subject_), state, begin - jump.before, shift_, state);
      state.t = begin;
      met = true;
    }
    return met;
  }

  /// A step of h beginning with the jumps within it: `step` receives whether there are any. The state is unchanged on failure.
  Fault over(StateOf<S>& state, Real h, auto accelerate, const ImpactWatch<S>& watch, auto step) {
    if (!impacts_.possible()) return step(false);
    before_ = state;
    const bool met = meet(state, h, accelerate, watch);
    const Fault fault = step(met);
    if (fault) state = before_;
    return fault;
  }

  /// Time up to which jumps have been sought.
  using Memory = Real;

  Memory memory() const { return searched_; }
  void restore(Memory searched) { searched_ = searched; }

 private:
  /// Between two times, by an indicator.
  struct Jump {
    Real before{0}, after{0};
    std::size_t which = 0;
    bool is_found = false;
  };

  std::size_t indicators() const {
    if constexpr (Sized<S>) return S::sizes.indicators;
    else return subject_.description().indicators.size();
  }

  /// The first jump at which an indicator changes sign while the state does not change.
  Jump find(const StateOf<S>& state, Real from, Real to) {
    if (from_.empty()) return {};
    while (from < to) {
      look(state, from, from_);
      if (changed(state, to) == now_.size()) return {};
      Real low = from, high = to;
      while (high - low > impacts_.width(to)) {
        const Real middle = low + (high - low) / 2;
        (changed(state, middle) < now_.size() ? high : low) = middle;
      }
      const std::size_t which = changed(state, high);
      low -= impacts_.width(to);  // where a condition holds at its end too, a guide has changed there already
      if (impacts_.jumps(state.q, low, high)) return {low, high, which, true};
      from = high;
    }
    return {};
  }

  /// Values of the indicators at a time; reference implementations and systems have none.
  void look(const StateOf<S>& state, Real t, Indicators& values) {
    if constexpr (requires { subject_.events(state.q.data(), state.v.data(), values.data()); }) {
      subject_.begin_step(t, Real(1));
      subject_.events(state.q.data(), state.v.data(), values.data());
    }
  }

  /// The first indicator whose sign differs from that at the last `from`; the number of indicators if there is none.
  std::size_t changed(const StateOf<S>& state, Real t) {
    look(state, t, now_);
    std::size_t i = 0;
    while (i < now_.size() && (now_[i] > Real(0)) == (from_[i] > Real(0))) ++i;
    return i;
  }

  S& subject_;
  Impacts<S> impacts_;
  StateOf<S> before_;
  Speeds<S> shift_;
  Indicators from_, now_;
  Real searched_{-std::numeric_limits<Real>::infinity()};
};

/// Impacts for classes whose guides can jump.
template <class S>
using CrossedIf = std::conditional_t<can_jump<S>, CrossedImpacts<S>, NoImpacts>;

}  // namespace cutjoint
