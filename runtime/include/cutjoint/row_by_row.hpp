// Methods that go from one row of the table to the next by steps of their own, as the driver sees them.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

#include "cutjoint/domains.hpp"
#include "cutjoint/energy_balance.hpp"
#include "cutjoint/guards.hpp"
#include "cutjoint/impact_list.hpp"
#include "cutjoint/json.hpp"
#include "cutjoint/near_jumps.hpp"
#include "cutjoint/read_settings.hpp"
#include "cutjoint/settings.hpp"
#include "cutjoint/state.hpp"
#include "cutjoint/stop.hpp"

namespace cutjoint {

/// Goes on from a start by a stepper, whose `advance` takes a state of the dynamics from one time to another with as many steps as it likes;
/// guards are checked at the rows.  A row stands each `dt` of the settings.
template <class Dynamics, class Stepper, class Subject>
class RowByRow {
 public:
  using Real = typename Dynamics::Real;

  RowByRow(Subject& subject, Dynamics& dynamics, const RunSettings& settings)
      : subject_(subject), dynamics_(dynamics), settings_(settings), guards_(subject), list_(subject, energy_), dt_(settings.dt) {}

  const std::vector<Named>& columns() const { return subject_.description().columns; }
  const std::vector<std::string_view>& coordinates() const { return subject_.description().coordinates; }

  /// Take over a start in the coordinates of the dynamics.
  void begin(const State<Real>& start) {
    y_ = dynamics_.begin(start);
    origin_ = t_ = start.t;
    if (settings_.energy) state_ = start;
    check(0);
  }

  /// Get ready for steps; `how` is what the stepper is made with.
  template <class... How>
  void prepare(How&&... how) {
    stepper_.emplace(dynamics_, std::forward<How>(how)...);
    if constexpr (requires { typename Stepper::Watch; }) {
      if (settings_.energy) energy_.emplace(subject_, *state_);
      stepper_->watch({.call = [](void* who, auto& scheme) { static_cast<RowByRow*>(who)->end_step(scheme); }, .who = this});
      if (may_jump(subject_)) meet_impacts();
    }
  }

  /// Throws Stopped where a stop is requested before the row: the last row is then that before.
  void step(long number) {
    const Real until = origin_ + Real(number) * dt_;
    require_none(stepper_->advance(t_, until, y_, number), subject_.description());
    t_ = until;
    check(number);
  }

  /// The row before is where the motion to the failure begins.
  Failure explain(const Failure& failure) {
    try {
      return explain_by_domains(subject_, dynamics_.complete(t_, y_), dt_, failure);
    } catch (const Failure&) {
      return failure;
    }
  }

  Real time() const { return t_; }

  const std::optional<EnergyBalance<Subject>>& energy() const { return energy_; }

  /// The coordinates of the row that was reported last.
  const std::vector<Real>& position() const { return position_; }

  void report(Real* column) {
    const State<Real>& x = dynamics_.complete(t_, y_);
    position_ = x.q;
    subject_.report(x.q.data(), x.v.data(), x.vdot.data(), x.lambda.data(), column);
  }

  /// What would be reported a time after the row, or before it.
  void report_moved(Real time, Real* column) { cutjoint::report_moved(subject_, dynamics_.complete(t_, y_), time, column); }

  static constexpr std::array<std::string_view, 1> step_columns{"steps"};

  std::vector<double> measure_step() const { return {static_cast<double>(stepper_->steps())}; }

  void summarise(Json& summary) const {
    summary["evaluations"] = dynamics_.evaluations();
    summary["iterations"] = stepper_ ? stepper_->steps() : 0;
    if (energy_) energy_->summarise(summary);
    list_.summarise(summary);
  }

 protected:
  /// The last state is that of another time than a row's.
  void stop_at(Real t) { t_ = t; }

  const RunSettings& settings() const { return settings_; }

  /// Call a function where energy is balanced, too; its time is none of the steps.
  template <class Check>
  void check_beside(Check check) {
    if (!energy_) return;
    const auto time = energy_->time();
    check();
  }

  /// The time of the last row.
  Real last_row() const { return origin_ + Real(count_steps<Real>(settings_).number) * dt_; }

  const std::optional<Stepper>& stepper() const { return stepper_; }
  Real origin() const { return origin_; }
  const std::vector<Real>& row() const { return y_; }

 private:
  void meet_impacts() {
    impacts_.emplace(subject_, length_of<Real>(settings_));
    const auto call = [](void* who, auto& scheme, std::size_t which, Real since) { static_cast<RowByRow*>(who)->strike(scheme, which, since); };
    stepper_->strike_by({.call = call, .who = this});
  }

  template <class Scheme>
  void end_step(Scheme& scheme) {
    if (stop_requested()) throw Stopped();
    if (!energy_) return;
    const auto time = energy_->time();
    scheme.read_end(*state_);
    energy_->add(*state_, [&](Real t, State<Real>& state) { scheme.read_between(t, state); });
  }

  /// Impulses at the end of a step at an event, if guides' rates jump there.
  template <class Scheme>
  void strike(Scheme& scheme, std::size_t which, Real since) {
    impacts_->meet(scheme, which, since, list_.watch([&](auto& energy, State<Real>& state) {
      scheme.complete_struck(state);
      energy.add(state, [&](Real t, State<Real>& between) { scheme.read_between(t, between); });
    }));
  }

  void check(long number) {
    if (!guards_.empty()) guards_.check(dynamics_.complete(t_, y_), number);
  }

  Subject& subject_;
  Dynamics& dynamics_;
  const RunSettings& settings_;
  Guards<Subject> guards_;
  std::optional<Stepper> stepper_;
  std::optional<EnergyBalance<Subject>> energy_;
  std::optional<Impacts<Subject>> impacts_;  ///< of guides that may jump
  ImpactList<Subject> list_;
  std::optional<State<Real>> state_;  ///< at the end of a step, of a run whose energy is balanced
  std::vector<Real> y_, position_;
  Real origin_{0}, t_{0}, dt_;
};

}  // namespace cutjoint
