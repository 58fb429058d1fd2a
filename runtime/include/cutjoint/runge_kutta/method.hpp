// Explicit methods as the driver sees them.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "cutjoint/core/runge_kutta/scheme.hpp"
#include "cutjoint/core/runge_kutta/tables.hpp"
#include "cutjoint/core/runge_kutta/watched.hpp"
#include "cutjoint/json.hpp"
#include "cutjoint/row_by_row.hpp"
#include "cutjoint/run_file.hpp"
#include "cutjoint/core/stepping/stepper.hpp"
#include "cutjoint/stepping/summarise.hpp"

namespace cutjoint::runge_kutta {

/// A mechanism in relative coordinates with an explicit Runge-Kutta method.
template <Mechanism M, class Table>
class ExplicitMethod : public RowByRow<Watched<M>, stepping::Stepper<Scheme<Watched<M>, Table>>, M> {
  using Base = RowByRow<Watched<M>, stepping::Stepper<Scheme<Watched<M>, Table>>, M>;

 public:
  using Real = typename M::real_type;

  ExplicitMethod(M& mechanism, const RunSettings& settings, const Json& file)
      : Base(mechanism, dynamics_, settings), mechanism_(mechanism), data_(mechanism.description(), file),
        switches_(switches_of(mechanism.description(), settings)), places_(places_of(switches_)),
        dynamics_(mechanism, {places_, data_.roads().data()}, tolerance_of_multipliers<Table>(Real(settings.tolerance))) {
    load_penalties(std::vector<double>(mechanism.description().cuts.size(), 1.0));
  }

  /// Load the mechanism with the penalties of its cut joints, which its start has found; one that the run is given comes before them.
  void load_penalties(std::vector<double> penalties) {
    StabilisationSettings stabilisation = this->settings().stabilisation;
    if (stabilisation.closure == Closure::penalty && this->settings().penalty)
      penalties.assign(penalties.size(), *this->settings().penalty);
    stabilisation.frequency = 0.0;  // loops are projected, not drawn together
    data_.load_mechanism(mechanism_, stabilisation, converted<Real>(penalties));
  }

  void begin(const State<double>& start, double) { Base::begin(State<Real>(start)); }

  void prepare() {
    const stepping::Tolerances<Real> tolerances{Real(this->settings().tolerance), Real(*this->settings().absolute_tolerance)};
    Base::prepare(tolerances, this->last_row());
  }

  void step(long number) {
    Base::step(number);
    this->check_beside([this] { find_residuals(); });
  }

  static constexpr std::array<std::string_view, 3> step_columns{"steps", "position", "velocity"};

  /// The steps that a row took, and its largest residuals.
  const std::vector<double>& measure_step() {
    const auto [position, velocity] = find_residuals();
    const long steps = this->stepper()->steps();
    measured_ = {static_cast<double>(steps - steps_), position, velocity};
    steps_ = steps;
    return measured_;
  }

  void summarise(Json& summary) const {
    Base::summarise(summary);
    if (!measured_.empty() || this->energy()) summary["residuals"] = Json{{"position", number_or_null(position_)}, {"velocity", number_or_null(velocity_)}};
    if (!this->stepper()) return;
    stepping::summarise(this->stepper()->counts(), switches_, summary);
    summary["stiff_steps"] = this->stepper()->scheme().stiff();
  }

 private:
  std::pair<double, double> find_residuals() {
    const auto [position, velocity, acceleration] = dynamics_.residuals(this->time(), this->row());
    position_ = std::max(position_, position);
    velocity_ = std::max(velocity_, velocity);
    return {position, velocity};
  }

  M& mechanism_;
  ModelData<Real> data_;
  const std::vector<Switch>& switches_;
  std::vector<SwitchPlace> places_;
  Watched<M> dynamics_;
  std::vector<double> measured_;
  long steps_ = 0;
  double position_ = 0.0, velocity_ = 0.0;
};

}  // namespace cutjoint::runge_kutta
