// The diagonally implicit method as the driver sees it.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <string_view>
#include <vector>

#include "cutjoint/json.hpp"
#include "cutjoint/lagrangian/choose_solver.hpp"
#include "cutjoint/row_by_row.hpp"
#include "cutjoint/run_file.hpp"
#include "cutjoint/sdirk/stages.hpp"
#include "cutjoint/stepping/implicit_scheme.hpp"
#include "cutjoint/core/stepping/stepper.hpp"
#include "cutjoint/stepping/summarise.hpp"

namespace cutjoint::sdirk {

/// What the base needs made before it.
template <class S>
struct Parts {
  using Real = typename S::real_type;

  Parts(S& system, const RunSettings& settings, const Json& file)
      : data(system.description(), file), solver(choose_solver(system, *settings.solver)), other(choose_solver(system, *settings.solver)),
        switches(switches_of(system.description(), settings)), stages(system, *solver, *other, switches, data.roads()) {
    data.load_system(system);
  }

  ModelData<Real> data;
  std::unique_ptr<LinearSolver<Real>> solver, other;
  const std::vector<Switch>& switches;
  Stages<S> stages;
};

/// A system in relative coordinates with steps of its own length, or with equal ones of "sdirk4-fixed".
template <class S>
class ImplicitMethod : private Parts<S>, public RowByRow<Stages<S>, stepping::Stepper<stepping::ImplicitScheme<Stages<S>>>, S> {
  using Base = RowByRow<Stages<S>, stepping::Stepper<stepping::ImplicitScheme<Stages<S>>>, S>;

 public:
  using Real = typename S::real_type;

  ImplicitMethod(S& system, const RunSettings& settings, const Json& file)
      : Parts<S>(system, settings, file), Base(system, this->stages, settings) {}

  void begin(const State<double>& start, double) { Base::begin(State<Real>(start)); }

  void prepare() {
    const Tolerances<Real> tolerances{Real(this->settings().tolerance), Real(*this->settings().absolute_tolerance)};
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
