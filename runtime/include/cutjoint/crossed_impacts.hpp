// Steps of equal length over instants at which guides' rates jump.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

#include "cutjoint/core/retraction.hpp"
#include "cutjoint/energy_balance.hpp"
#include "cutjoint/impacts.hpp"
#include "cutjoint/json.hpp"
#include "cutjoint/state.hpp"

namespace cutjoint {

/// Finds the jumps within a step before it is taken, and lets it begin as if the motion after them had come from there.
///
/// From the start of the step the motion goes along its parabola to the jump, is struck, and goes back along the parabola of the accelerations
/// after it: a step from there has an error of the order of the rule's.
///
/// When guides change their formulas, switches say.  Natural coordinates have none; their equations have the guides' rates, which grow by more than the
/// integral of their accelerations (Simpson's rule) where they jump.
template <class Subject>
class CrossedImpacts {
 public:
  using Real = typename Subject::real_type;

  CrossedImpacts(Subject& subject, double end)
      : subject_(subject), impacts_(subject, end), still_(speeds_of(subject.description()).size()), way_(still_),
        from_(subject.description().switches.size()), now_(from_), phi_(subject.description().equations.size()) {
    courses_.fill({phi_, phi_});
  }

  /// Meet what lies within a step of h from a state; `accelerate` finds accelerations and multipliers of a state.  Returns whether something did.
  template <class Accelerate>
  bool meet(State<Real>& state, Real h, Accelerate accelerate, std::optional<EnergyBalance<Subject>>& energy) {
    if (!impacts_.possible()) return false;
    const Real begin = state.t, end = begin + h;
    bool met = false;
    Real after = searched_ > begin - h / 2 ? searched_ : begin;  // rounding leaves nothing out between steps, nor has it twice
    searched_ = end;
    while (const std::optional<Jump> jump = find(state, after, end)) {
      move(state, jump->before - begin);
      state.t = jump->before;
      accelerate(state);
      if (energy) energy->add(state);
      const Real work = impacts_.strike(state, jump->after, jump->element);
      accelerate(state);
      if (energy) energy->strike(state, work);
      move(state, begin - jump->before);
      state.t = begin;
      after = jump->after;
      met = true;
    }
    return met;
  }

  void summarise(Json& summary) const { impacts_.summarise(summary); }

 private:
  struct Jump {
    Real before, after;
    std::string_view element;
  };

  /// Along the parabola of a state's accelerations, by a time h.
  void move(State<Real>& state, Real h) {
    for (std::size_t i = 0; i < way_.size(); ++i) {
      way_[i] = h * state.v[i] + h * h / 2 * state.vdot[i];
      state.v[i] += h * state.vdot[i];
    }
    const std::vector<Chart>& charts = subject_.description().charts;
    if (charts.empty()) {
      for (std::size_t i = 0; i < way_.size(); ++i) state.q[i] += way_[i];
      return;
    }
    pose_ = state.q;
    retract<Real>(charts, pose_.data(), way_.data(), state.q.data());
  }

  std::optional<Jump> find(const State<Real>& state, Real from, Real to) {
    if constexpr (Struck<Subject>::is_system)
      if (subject_.description().charts.empty()) return find_by_rates(state, from, to);
    return find_by_switches(state, from, to);
  }

  /// The first jump at which a switch changes its sign though the state does not change.
  std::optional<Jump> find_by_switches(const State<Real>& state, Real from, Real to) {
    if (from_.empty()) return std::nullopt;
    while (from < to) {
      switches(state, from, from_);
      if (changed(state, to) == now_.size()) return std::nullopt;
      Real low = from, high = to;
      while (high - low > impacts_.width()) {
        const Real middle = low + (high - low) / 2;
        (changed(state, middle) < now_.size() ? high : low) = middle;
      }
      const std::size_t which = changed(state, high);
      low -= impacts_.width();  // where a condition holds at its end too, a guide has changed there already
      if (impacts_.jumps(state.q, low, high)) return Jump{low, high, subject_.description().switches[which].element};
      from = high;
    }
    return std::nullopt;
  }

  /// Generic mechanisms and systems have no switches.
  void switches(const State<Real>& state, Real t, std::vector<Real>& values) {
    if constexpr (requires { subject_.events(state.q.data(), state.v.data(), values.data()); }) {
      subject_.begin_step(t, Real(1));
      subject_.events(state.q.data(), state.v.data(), values.data());
    }
  }

  /// The first switch whose sign is another than at the last `from`; as many as there are if there is none.
  std::size_t changed(const State<Real>& state, Real t) {
    switches(state, t, now_);
    std::size_t i = 0;
    while (i < now_.size() && (now_[i] > Real(0)) == (from_[i] > Real(0))) ++i;
    return i;
  }

  /// Rates and accelerations that guides give to the equations in a pose at a time.
  struct Course {
    std::vector<Real> rate, acceleration;
  };

  void follow(const State<Real>& state, Real t, Course& course) {
    subject_.begin_step(t, Real(1));
    subject_.constraint_residual(state.q.data(), still_.data(), still_.data(), phi_.data(), course.rate.data(), course.acceleration.data());
  }

  std::optional<Jump> find_by_rates(const State<Real>& state, Real from, Real to)
    requires Struck<Subject>::is_system
  {
    Real low = from, high = to;
    auto& [first, early, middle, late, last] = courses_;
    follow(state, low, first), follow(state, low + (high - low) / 2, middle), follow(state, high, last);
    std::size_t which = surplus(first, middle, last, high - low).first;
    if (!surplus(first, middle, last, high - low).second) return std::nullopt;
    while (high - low > impacts_.width()) {
      const Real half = low + (high - low) / 2, quarter = low + (half - low) / 2, third = half + (high - half) / 2;
      follow(state, quarter, early), follow(state, third, late);
      const auto left = surplus(first, early, middle, half - low), right = surplus(middle, late, last, high - half);
      if (!left.second && !right.second) return std::nullopt;
      which = left.second ? left.first : right.first;
      if (left.second) high = half, last = middle, middle = early;
      else low = half, first = middle, middle = late;
    }
    if (!impacts_.jumps(state.q, low, high)) return high < to ? find_by_rates(state, high, to) : std::nullopt;
    const std::string_view equation = subject_.description().equations[which];
    return Jump{low, high, equation.substr(0, equation.find('.'))};
  }

  /// The equation whose rate changes most by what its acceleration does not explain, and whether that is more than rounding.
  std::pair<std::size_t, bool> surplus(const Course& first, const Course& middle, const Course& last, Real h) const {
    using std::abs;
    std::size_t worst = 0;
    Real most(0), size(1);
    for (std::size_t i = 0; i < first.rate.size(); ++i) {
      const Real grown = h / 6 * (first.acceleration[i] + 4 * middle.acceleration[i] + last.acceleration[i]);
      const Real more = abs(last.rate[i] - first.rate[i] - grown);
      size = std::max(size, abs(last.rate[i]));
      if (more > most) most = more, worst = i;
    }
    return {worst, most > impacts_.share() * size};
  }

  Subject& subject_;
  Impacts<Subject> impacts_;
  std::vector<Real> still_, way_, pose_, from_, now_, phi_;
  Real searched_{-std::numeric_limits<Real>::infinity()};  ///< up to when
  std::array<Course, 5> courses_;  ///< at quarters of what a jump is sought in
};

}  // namespace cutjoint
