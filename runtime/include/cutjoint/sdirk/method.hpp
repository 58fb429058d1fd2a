// The diagonally implicit method as the driver sees it.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cmath>
#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "cutjoint/json.hpp"
#include "cutjoint/lagrangian/choose_solver.hpp"
#include "cutjoint/row_by_row.hpp"
#include "cutjoint/run_file.hpp"
#include "cutjoint/core/sdirk/stages.hpp"
#include "cutjoint/core/stepping/implicit_scheme.hpp"
#include "cutjoint/core/stepping/stepper.hpp"
#include "cutjoint/stepping/summarise.hpp"

namespace cutjoint::sdirk {

/// The stages of a system as what goes from row to row, y being the system's coordinates and speeds.
template <class S>
class RowStages : public Stages<S, LinearSolver<typename S::real_type>> {
  using Base = Stages<S, LinearSolver<typename S::real_type>>;

 public:
  using typename Base::Real;

  RowStages(S& system, LinearSolver<Real>& solver, LinearSolver<Real>& other, std::span<const SwitchPlace> switches, const Road<Real>* roads)
      : Base(system, solver, other, switches, roads), row_(blank(system)) {}

  /// Take over a start in relative coordinates.
  std::vector<Real> begin(const State<Real>& start) {
    row_.t = start.t;
    system_.begin_step(start.t, Real(1));
    system_.initial_coordinates(start.q.data(), start.v.data(), row_.q.data(), row_.v.data());
    require(Base::begin(row_));
    std::vector<Real> y(row_.q);
    y.insert(y.end(), row_.v.begin(), row_.v.end());
    return y;
  }

  /// The state with its accelerations and multipliers.
  const State<Real>& complete(Real t, const std::vector<Real>& y) {
    row_.t = t;
    const auto middle = y.begin() + static_cast<std::ptrdiff_t>(row_.q.size());
    std::copy(y.begin(), middle, row_.q.begin());
    std::copy(middle, y.end(), row_.v.begin());
    require(Base::complete(row_));
    return row_;
  }

 private:
  using Base::system_;

  void require(const Fault& fault) const { require_none(fault, system_.description(), "recursive-newton"); }

  State<Real> row_;
};

/// Parts made before their base.
template <class S>
struct Parts {
  using Real = typename S::real_type;

  Parts(S& system, const RunSettings& settings, const Json& file)
      : data(system.description(), file), solver(choose_solver(system, *settings.solver)), other(choose_solver(system, *settings.solver)),
        switches(switches_of(system.description(), settings)), places(places_of(switches)), stages(system, *solver, *other, places, data.roads().data()) {
    data.load_system(system);
  }

  ModelData<Real> data;
  std::unique_ptr<LinearSolver<Real>> solver, other;
  const std::vector<Switch>& switches;
  std::vector<SwitchPlace> places;
  RowStages<S> stages;
};

/// The stepper over the stages of a system.
template <class S>
using Stepper = stepping::Stepper<stepping::ImplicitScheme<Stages<S, LinearSolver<typename S::real_type>>>>;

/// A system in relative coordinates with steps of its own length, or with equal ones of "sdirk4-fixed".
template <class S>
class ImplicitMethod : private Parts<S>, public RowByRow<RowStages<S>, Stepper<S>, S> {
  using Base = RowByRow<RowStages<S>, Stepper<S>, S>;

 public:
  using Real = typename S::real_type;

  ImplicitMethod(S& system, const RunSettings& settings, const Json& file)
      : Parts<S>(system, settings, file), Base(system, this->stages, settings) {}

  void begin(const State<double>& start, double) { Base::begin(State<Real>(start)); }

  void prepare() {
    const stepping::Tolerances<Real> tolerances{Real(this->settings().tolerance), Real(*this->settings().absolute_tolerance)};
    Base::prepare(tolerances, this->last_row(), this->settings().integrator == Integrator::sdirk4);
  }

  static constexpr std::array<std::string_view, 3> step_columns{"steps", "position", "velocity"};

  /// The steps that a row took, and its residuals.
  const std::vector<double>& measure_step() {
    const Residuals& row = this->stepper()->scheme().residuals();
    const long steps = this->stepper()->steps();
    measured_ = {static_cast<double>(steps - steps_), row.position, row.velocity};
    steps_ = steps;
    return measured_;
  }

  void step(long number) {
    Base::step(number);
    const Residuals& row = this->stepper()->scheme().residuals();
    worst_.position = std::max(worst_.position, row.position);
    worst_.velocity = std::max(worst_.velocity, row.velocity);
  }

  void summarise(Json& summary) const {
    Base::summarise(summary);
    summary["solver"] = *this->settings().solver;
    summary["iterations"] = this->stages.iterations();
    summary["factorisations"] = this->stages.factorisations();
    summary["residuals"] = Json{{"position", number_or_null(worst_.position)}, {"velocity", number_or_null(worst_.velocity)}};
    if (this->stepper()) stepping::summarise(this->stepper()->counts(), this->switches, summary);
  }

 private:
  std::vector<double> measured_;
  long steps_ = 0;
  Residuals worst_;
};

}  // namespace cutjoint::sdirk
