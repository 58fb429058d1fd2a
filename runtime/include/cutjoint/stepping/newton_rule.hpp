// The rules of `recursive-newton` for steps that are split at events.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "cutjoint/json.hpp"
#include "cutjoint/core/newton/recursive_newton.hpp"
#include "cutjoint/lagrangian/any_newton.hpp"
#include "cutjoint/lagrangian/choose_solver.hpp"
#include "cutjoint/run_file.hpp"
#include "cutjoint/settings.hpp"
#include "cutjoint/state.hpp"

namespace cutjoint::stepping {

/// The rule of equal_steps.hpp over `RecursiveNewton`.
template <class S>
class NewtonRule {
 public:
  using Real = typename S::real_type;
  using Subject = S;

  static constexpr double least = 1e-4;

  NewtonRule(S& system, const RunSettings& settings)
      : system_(system), d_(system.description()), solver_name_(*settings.solver), solver_(choose_solver(system, solver_name_)),
        newton_(system, *solver_, newton_settings(settings)), dt_(settings.dt), h_(dt_) {}

  void load(ModelData<Real>& data, const StabilisationSettings&) { data.load_system(system_); }

  const SystemDescription& description() const { return d_; }
  State<Real> blank() const { return State<Real>(d_.coordinates.size(), d_.unknowns().size(), d_.equations.size()); }

  void begin(const State<Real>& start, State<Real>& state) {
    state.t = start.t;
    system_.begin_step(start.t, Real(1));
    system_.initial_coordinates(start.q.data(), start.v.data(), state.q.data(), state.v.data());
    restart(state);
  }

  void restart(State<Real>& state) {
    restarted_ = state;  // a state whose accelerations are not found keeps those it has
    require(newton_.begin(restarted_, Real(1)));
    state = restarted_;
    newton_.stay(state);
  }

  void step(State<Real>& state, Real h, long number) {
    using std::abs;
    const Real rounding = 16 * std::numeric_limits<Real>::epsilon() * (abs(state.t) + h);  // of times, whose difference h is
    if (abs(h - h_) > h_ * Real(1e-9) + rounding) {
      newton_.stay(state);
      newton_.set_step(h_ = h);
    }
    require(newton_.step(state, number));
    if (h < dt_ / 100) restart(state);  // the square of a short step, by which penalties are divided, leaves accelerations few digits
  }

  void keep() {
    means_ = newton_.means();
    const Residuals& last = newton_.residuals();
    worst_ = {std::max(worst_.position, last.position), std::max(worst_.velocity, last.velocity),
              std::max(worst_.acceleration, last.acceleration)};
  }

  void go_back(const State<Real>& state) {
    newton_.stay(state);
    newton_.take_means(means_);
  }

  void project(State<Real>& state) { require(newton_.close_loops(state)); }

  void enter(Real t) { system_.begin_step(t, Real(1)); }

  void events(const State<Real>& state, Real* values) {
    system_.begin_step(state.t, Real(1));
    system_.events(state.q.data(), state.v.data(), values);
  }

  /// Of the last step.
  const Residuals& measure(const State<Real>&) const { return newton_.residuals(); }

  long evaluations() const { return newton_.evaluations(); }

  void summarise(Json& summary) const {
    summary["solver"] = solver_name_;
    summary["penalty"] = number_or_null(static_cast<double>(newton_.step_weights().constraint / newton_.step_weights().stiffness));
    summary["iterations"] = newton_.iterations();
    summary["factorisations"] = newton_.factorisations();
    summary["substeps"] = newton_.substeps();
    summary["pivoting_fallbacks"] = solver_->fallbacks();
    summary["residuals"] = Json{{"position", number_or_null(worst_.position)},
                                {"velocity", number_or_null(worst_.velocity)},
                                {"acceleration", number_or_null(worst_.acceleration)}};
  }

 private:
  void require(const Fault& fault) const { require_none(fault, d_, name_of(d_.method)); }

  S& system_;
  const SystemDescription& d_;
  std::string solver_name_;
  std::unique_ptr<LinearSolver<Real>> solver_;
  RecursiveNewton<S, LinearSolver<Real>> newton_;
  Real dt_, h_;
  State<Real> restarted_ = blank();
  std::vector<Real> means_;
  Residuals worst_;
};

}  // namespace cutjoint::stepping
