// A Lagrangian method as the driver sees it: it goes on from a start in relative coordinates and integrates in natural ones.
#pragma once

#include <algorithm>
#include <array>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "cutjoint/core/crossed_impacts.hpp"
#include "cutjoint/domains.hpp"
#include "cutjoint/energy_balance.hpp"
#include "cutjoint/guards.hpp"
#include "cutjoint/impact_list.hpp"
#include "cutjoint/lagrangian/any_newton.hpp"
#include "cutjoint/lagrangian/choose_solver.hpp"
#include "cutjoint/lagrangian/examine.hpp"
#include "cutjoint/read_settings.hpp"
#include "cutjoint/near_jumps.hpp"
#include "cutjoint/run_file.hpp"
#include "cutjoint/settings.hpp"

namespace cutjoint {

/// Integrates a system with the solver and the settings of a run.
template <class S>
class LagrangianMethod {
 public:
  using Real = typename S::real_type;

  LagrangianMethod(S& system, const RunSettings& settings, const Json& file)
      : system_(system), d_(system.description()), settings_(settings), file_(file), state_(d_.coordinates.size(), d_.unknowns().size(), d_.equations.size()),
        guards_(system), data_(d_, file), solver_name_(*settings.solver), solver_(choose_solver(system, solver_name_)),
        newton_(make_newton(system, *solver_, newton_settings(settings))), dt_(settings.dt), list_(system, energy_) {
    data_.load_system(system_);
  }

  const std::vector<Named>& columns() const { return d_.columns; }
  const std::vector<std::string_view>& coordinates() const { return d_.coordinates; }

  /// Take over a start in relative coordinates; `motion` is 0 of a mechanism at rest.  Throws Failure.
  void begin(const State<double>& start, double motion) {
    const State<Real> relative(start);
    state_.t = origin_ = relative.t;
    system_.begin_step(origin_, Real(motion));
    system_.initial_coordinates(relative.q.data(), relative.v.data(), state_.q.data(), state_.v.data());
    newton_->begin(state_, Real(motion));
    note_residuals();
    guards_.check(state_, 0);
  }

  void prepare() {
    if (settings_.energy) energy_.emplace(system_, state_);
    if (d_.guides_jump) impacts_.emplace(system_, length_of<Real>(settings_));
    if (!d_.driven) return;
    single_solver_ = choose_solver(system_, solver_name_);
    single_ = make_newton(system_, *single_solver_, {.dt = 1.0, .penalty = std::nullopt, .tolerance = 1e-9, .iterations = 100, .multiplier_updates = 4});
    completed_ = state_;
  }

  void step(long number) {
    const long before = newton_->iterations();
    if (impacts_ && impacts_->meet(state_, dt_, [this](State<Real>& state) { accelerate(state); },
                                   list_.watch([](auto& energy, const State<Real>& state) { energy.add(state); })))
      newton_->take_over(state_);
    newton_->step(state_, number);
    if (energy_) {
      const auto time = energy_->time();
      energy_->add(with_reactions());
    }
    state_.t = origin_ + Real(number) * dt_;
    iterations_ = newton_->iterations() - before;
    note_residuals();
    guards_.check(state_, number);
  }

  Failure explain(const Failure& failure) { return explain_by_domains(system_, state_, dt_, failure); }

  Real time() const { return state_.t; }

  const std::optional<EnergyBalance<S>>& energy() const { return energy_; }

  /// The coordinates of the row that was reported last.
  const std::vector<Real>& position() const { return state_.q; }

  void report(Real* column) const { system_.report(state_.q.data(), state_.v.data(), state_.vdot.data(), state_.lambda.data(), column); }

  /// What would be reported a time after the row, or before it.
  void report_moved(Real time, Real* column) const { cutjoint::report_moved(system_, state_, time, column); }

  static constexpr std::array<std::string_view, 4> step_columns{"iterations", "position", "velocity", "acceleration"};

  /// The last step's iterations and largest residuals.
  std::vector<double> measure_step() const {
    const Residuals& last = newton_->residuals();
    return {static_cast<double>(iterations_), last.position, last.velocity, last.acceleration};
  }

  /// The effort of the run, and the largest residuals that any of its states has.
  void summarise(Json& summary) const {
    summary["solver"] = solver_name_;
    if (d_.method != Lagrangian::classical)
      summary["penalty"] = number_or_null(static_cast<double>(newton_->step_weights().constraint / newton_->step_weights().stiffness));
    summary["evaluations"] = newton_->evaluations();
    summary["iterations"] = newton_->iterations();
    summary["factorisations"] = newton_->factorisations();
    summary["substeps"] = newton_->substeps();
    summary["pivoting_fallbacks"] = solver_->fallbacks();
    if (energy_) energy_->summarise(summary);
    list_.summarise(summary);
    summary["residuals"] = Json{{"position", number_or_null(worst_.position)},
                                {"velocity", number_or_null(worst_.velocity)},
                                {"acceleration", number_or_null(worst_.acceleration)}};
  }

  /// The last state, as `evaluate` reads it.
  Json state() const { return write_state(state_); }

  /// The system's functions at the run file's states.
  Json evaluate() {
    Json results = Json::array();
    for (const Json& at : file_.at("states")) results.push_back(evaluate_system(system_, *solver_, at));
    return results;
  }

  /// Seconds that the parts of an iteration take, at the start or at the run file's `state`, with the weights of a step.
  Json time_solver() {
    const Weights<Real> weights = newton_->step_weights();
    const State<Real> at = file_.contains("state") ? read_state<Real>(file_.at("state")) : state_;
    return time_parts(system_, solver_name_, at, weights, weights.constraint / weights.stiffness, file_);
  }

 private:
  /// Accelerations and multipliers of a state; in a singular pose it keeps those that it has.
  void accelerate(State<Real>& state) {
    *completed_ = state;
    try {
      single_->go_on(*completed_);
      state = *completed_;
    } catch (const Failure&) {
    }
  }

  /// The state, where guides need them with accelerations and multipliers that those of a step only come near to.
  const State<Real>& with_reactions() {
    if (!single_) return state_;
    *completed_ = state_;
    try {
      single_->begin(*completed_, Real(1));
    } catch (const Failure&) {  // a singular pose has none
      *completed_ = state_;
    }
    return *completed_;
  }

  void note_residuals() {
    const Residuals& last = newton_->residuals();
    worst_ = {.position = std::max(worst_.position, last.position),
              .velocity = std::max(worst_.velocity, last.velocity),
              .acceleration = std::max(worst_.acceleration, last.acceleration)};
  }

  S& system_;
  const SystemDescription& d_;
  const RunSettings& settings_;
  const Json& file_;
  State<Real> state_;
  Guards<S> guards_;
  ModelData<Real> data_;
  std::string solver_name_;
  std::unique_ptr<LinearSolver<Real>> solver_;
  std::unique_ptr<AnyNewton<S>> newton_;
  Real dt_, origin_{0};
  std::optional<EnergyBalance<S>> energy_;
  std::optional<CrossedImpacts<S>> impacts_;
  ImpactList<S> list_;
  std::unique_ptr<LinearSolver<Real>> single_solver_;  ///< of single states of a driven system
  std::unique_ptr<AnyNewton<S>> single_;
  std::optional<State<Real>> completed_;
  long iterations_ = 0;
  Residuals worst_;
};

}  // namespace cutjoint
