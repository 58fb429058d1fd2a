// The recursive method as the driver sees it: the fixed point of the trapezoidal rule in relative coordinates.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <string_view>
#include <utility>
#include <vector>

#include "cutjoint/core/crossed_impacts.hpp"
#include "cutjoint/core/relative.hpp"
#include "cutjoint/domains.hpp"
#include "cutjoint/energy_balance.hpp"
#include "cutjoint/guards.hpp"
#include "cutjoint/impact_list.hpp"
#include "cutjoint/json.hpp"
#include "cutjoint/core/largest.hpp"
#include "cutjoint/mechanism.hpp"
#include "cutjoint/near_jumps.hpp"
#include "cutjoint/core/retraction.hpp"
#include "cutjoint/run_file.hpp"
#include "cutjoint/settings.hpp"
#include "cutjoint/state.hpp"
#include "cutjoint/core/trapezoidal.hpp"

namespace cutjoint {

/// Goes on from a start with the mechanism that found it.
template <Mechanism M>
class Recursive {
 public:
  using Real = typename M::real_type;

  Recursive(M& mechanism, const RunSettings& settings, const Json& file)
      : mechanism_(mechanism), d_(mechanism.description()), settings_(settings), file_(file), data_(d_, file), state_(d_), guards_(mechanism),
        relative_(mechanism, Real(1e-12)), dt_(settings.dt), list_(mechanism, energy_), residual_(d_.equations.size()), rate_(d_.equations.size()) {
    load_penalties(std::vector<double>(d_.cuts.size(), settings.stabilisation.penalty.value_or(1.0)));
  }

  /// Load the mechanism with the penalties of its cut joints, which its start has found.
  void load_penalties(const std::vector<double>& penalties) {
    data_.load_mechanism(mechanism_, settings_.stabilisation, converted<Real>(penalties));
  }

  const std::vector<Named>& columns() const { return d_.columns; }
  const std::vector<std::string_view>& coordinates() const { return d_.coordinates; }

  /// Take over a start; `motion` is 0 of a mechanism at rest.  Throws Failure where a guard is violated.
  void begin(const State<double>& start, double motion) {
    state_ = State<Real>(start);
    origin_ = state_.t;
    mechanism_.begin_step(origin_, Real(motion));
    guards_.check(state_, 0);
  }

  /// Get ready for steps.
  void prepare() {
    integrator_.emplace(mechanism_, dt_, fixed_point_of(settings_));
    if (settings_.energy) energy_.emplace(mechanism_, state_);
    if (may_jump(mechanism_)) impacts_.emplace(mechanism_, length_of<Real>(settings_));
  }

  void step(long number) {
    if (impacts_)
      impacts_->meet(state_, dt_, [this](State<Real>& state) { relative_.find_accelerations(state); },
                     list_.watch([](auto& energy, const State<Real>& state) { energy.add(state); }));
    require_none(integrator_->step(state_, number), d_);
    if (energy_) {
      const auto time = energy_->time();
      energy_->add(state_);
      find_residuals();
    }
    state_.t = origin_ + Real(number) * dt_;
    guards_.check(state_, number);
  }

  Failure explain(const Failure& failure) { return explain_by_domains(mechanism_, state_, dt_, failure); }

  Real time() const { return state_.t; }

  const std::optional<EnergyBalance<M>>& energy() const { return energy_; }

  /// The coordinates of the row that was reported last.
  const std::vector<Real>& position() const { return state_.q; }

  void report(Real* column) { mechanism_.report(state_.q.data(), state_.v.data(), state_.vdot.data(), state_.lambda.data(), column); }

  /// What would be reported a time after the row, or before it.
  void report_moved(Real time, Real* column) { cutjoint::report_moved(mechanism_, state_, time, column); }

  static constexpr std::array<std::string_view, 3> step_columns{"iterations", "position", "velocity"};

  /// The last step's iterations and largest residuals; an evaluation of its own, which the method itself does without.
  const std::vector<double>& measure_step() {
    const auto [position, velocity] = find_residuals();
    measured_ = {static_cast<double>(integrator_->evaluations() - evaluations_), position, velocity};
    evaluations_ = integrator_->evaluations();
    return measured_;
  }

  /// The effort of the run; an iteration is an evaluation, and residuals are known where steps were measured, or energy was balanced.
  void summarise(Json& summary) const {
    const long evaluations = integrator_ ? integrator_->evaluations() + relative_.evaluations() : 0;
    summary["evaluations"] = evaluations;
    summary["iterations"] = evaluations;
    if (energy_) energy_->summarise(summary);
    list_.summarise(summary);
    if (!measured_.empty() || energy_) summary["residuals"] = Json{{"position", number_or_null(position_)}, {"velocity", number_or_null(velocity_)}};
  }

  /// The Jacobians of the accelerations by the coordinates (as increments that are retracted) and by the speeds at the state, column by
  /// column, by central differences of `evaluate`; multipliers stay.
  Json differentiate() {
    const std::size_t n = d_.speeds.size();
    const Real h(1e-5);
    std::vector<Real> stiffness, damping, delta(n), forward(n), backward(n);
    State<Real> probe = state_;
    const auto evaluate_at = [&](std::vector<Real>& vdot) {
      mechanism_.evaluate(probe.q.data(), probe.v.data(), state_.lambda.data(), vdot.data(), residual_.data());
    };
    const auto append = [&](std::vector<Real>& columns) {
      for (std::size_t i = 0; i < n; ++i) columns.push_back((forward[i] - backward[i]) / (2 * h));
    };
    for (std::size_t j = 0; j < n; ++j) {
      for (const Real move : {h, -h}) {
        delta[j] = move;
        retract<Real>(d_.charts, state_.q.data(), delta.data(), probe.q.data());
        evaluate_at(move > Real(0) ? forward : backward);
      }
      delta[j] = Real(0);
      append(stiffness);
    }
    probe.q = state_.q;
    for (std::size_t j = 0; j < n; ++j) {
      for (const Real move : {h, -h}) {
        probe.v[j] = state_.v[j] + move;
        evaluate_at(move > Real(0) ? forward : backward);
      }
      probe.v[j] = state_.v[j];
      append(damping);
    }
    return Json{{"t", state_.t}, {"stiffness", stiffness}, {"damping", damping}};
  }

  /// The last state.
  Json state() const { return write_state(state_); }

  /// One evaluation at given q, v, lambda: the mechanism as a function, for comparison with other implementations.
  Json evaluate() {
    Json results = Json::array();
    for (const Json& at : file_.at("states")) {
      state_.q = at.at("q").get<std::vector<Real>>();
      state_.v = at.at("v").get<std::vector<Real>>();
      state_.lambda = at.at("lambda").get<std::vector<Real>>();
      std::vector<Real> correction(d_.equations.size()), values(d_.columns.size()), dz(d_.speeds.size());
      mechanism_.begin_step(read_number<Real>(at, "t"), Real(1));
      mechanism_.evaluate(state_.q.data(), state_.v.data(), state_.lambda.data(), state_.vdot.data(), correction.data());
      mechanism_.constraint_residual(state_.q.data(), state_.v.data(), residual_.data(), rate_.data());
      mechanism_.project(state_.q.data(), residual_.data(), dz.data());
      report(values.data());
      results.push_back(Json{{"vdot", state_.vdot},
                             {"correction", correction},
                             {"residual", residual_},
                             {"rate", rate_},
                             {"dz", dz},
                             {"columns", values}});
    }
    return results;
  }

 private:
  std::pair<double, double> find_residuals() {
    mechanism_.constraint_residual(state_.q.data(), state_.v.data(), residual_.data(), rate_.data());
    const auto position = static_cast<double>(largest(residual_)), velocity = static_cast<double>(largest(rate_));
    position_ = std::max(position_, position);
    velocity_ = std::max(velocity_, velocity);
    return {position, velocity};
  }

  M& mechanism_;
  const Description& d_;
  const RunSettings& settings_;
  const Json& file_;
  ModelData<Real> data_;
  State<Real> state_;
  Guards<M> guards_;
  Relative<M> relative_;
  Real origin_{0}, dt_;
  std::optional<Trapezoidal<M>> integrator_;
  std::optional<EnergyBalance<M>> energy_;
  std::optional<CrossedImpacts<M>> impacts_;
  ImpactList<M> list_;
  std::vector<Real> residual_, rate_;
  std::vector<double> measured_;
  long evaluations_ = 0;
  double position_ = 0.0, velocity_ = 0.0;
};

}  // namespace cutjoint
