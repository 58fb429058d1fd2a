// Accurate solutions that go from one row of the table to the next by steps of their own, as the driver sees them.
#pragma once

#include <array>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

#include "cutjoint/domains.hpp"
#include "cutjoint/guards.hpp"
#include "cutjoint/json.hpp"
#include "cutjoint/settings.hpp"
#include "cutjoint/state.hpp"

namespace cutjoint::reference {

/// The method of a run (run.hpp) by a stepper, whose `advance` takes a state of the dynamics from one time to another with as many steps as it likes;
/// guards are checked at the rows.  A row stands each `dt` of the settings.
template <class Dynamics, class Stepper, class Subject>
class RowByRow {
 public:
  using Real = typename Dynamics::Real;

  RowByRow(Subject& subject, Dynamics& dynamics, const RunSettings& settings)
      : subject_(subject), dynamics_(dynamics), settings_(settings), guards_(subject), dt_(settings.dt) {}

  const List<Named>& columns() const { return subject_.description().columns; }
  const List<const char*>& coordinates() const { return subject_.description().coordinates; }

  /// Take over a start in the coordinates of the dynamics.
  void begin(const State<Real>& start) {
    y_ = dynamics_.begin(start);
    origin_ = t_ = start.t;
    check(0);
  }

  /// Get ready for steps; `how` is what the stepper is made with.
  template <class... How>
  void prepare(How&&... how) {
    stepper_.emplace(dynamics_, std::forward<How>(how)...);
  }

  /// Throws Failure.
  void step(long number) {
    const Real until = origin_ + Real(number) * dt_;
    stepper_->advance(t_, until, y_, number);
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

  /// The coordinates of the row that was reported last.
  const std::vector<Real>& position() const { return position_; }

  void report(Real* column) {
    const State<Real>& x = dynamics_.complete(t_, y_);
    position_ = x.q;
    subject_.report(x.q.data(), x.v.data(), x.vdot.data(), x.lambda.data(), column);
  }

  static constexpr std::array<std::string_view, 1> step_columns{"steps"};

  std::vector<double> measure_step() const { return {static_cast<double>(stepper_->steps())}; }

  void summarise(Json& summary) const {
    summary["evaluations"] = dynamics_.evaluations();
    summary["iterations"] = stepper_ ? stepper_->steps() : 0;
  }

 protected:
  const RunSettings& settings() const { return settings_; }

 private:
  void check(long number) {
    if (!guards_.empty()) guards_.check(dynamics_.complete(t_, y_), number);
  }

  Subject& subject_;
  Dynamics& dynamics_;
  const RunSettings& settings_;
  Guards<Subject> guards_;
  std::optional<Stepper> stepper_;
  std::vector<Real> y_, position_;
  Real origin_{0}, t_{0}, dt_;
};

}  // namespace cutjoint::reference
