// Explicit methods as the driver sees them.
#pragma once

#include <string>

#include "cutjoint/runge_kutta/stepper.hpp"
#include "cutjoint/runge_kutta/tables.hpp"
#include "cutjoint/runge_kutta/watched.hpp"
#include "cutjoint/json.hpp"
#include "cutjoint/row_by_row.hpp"
#include "cutjoint/run_file.hpp"

namespace cutjoint::runge_kutta {

/// A mechanism in relative coordinates with an explicit Runge-Kutta method.
template <Mechanism M, class Table>
class ExplicitMethod : public RowByRow<Watched<M>, Stepper<Watched<M>, Table>, M> {
  using Base = RowByRow<Watched<M>, Stepper<Watched<M>, Table>, M>;

 public:
  using Real = typename M::real_type;

  ExplicitMethod(M& mechanism, const Json& file)
      : Base(mechanism, dynamics_, file), inputs_(mechanism.description(), file),
        dynamics_(mechanism, inputs_.roads(), Table::adaptive ? this->figure("tolerance") / 1000 : Real(1e-12)) {
    inputs_.load_mechanism(mechanism, file.at("stabilisation"));
    end_ = read_number<Real>(file, "end");
  }

  void begin(const State<double>& start, double) { Base::begin(State<Real>(start)); }

  void prepare() {
    const Tolerances<Real> tolerances{this->figure("tolerance"), this->figure("absolute_tolerance")};
    Base::prepare(tolerances, this->origin() + end_);
  }

  void summarise(Json& summary) const {
    Base::summarise(summary);
    if (!this->stepper()) return;
    const Counts& counts = this->stepper()->counts();
    summary["steps"] = counts.steps;
    summary["rejected"] = counts.rejected;
    summary["stiff_steps"] = counts.stiff;
    summary["events"] = counts.events;
    Json by_element = Json::object();
    for (std::size_t i = 0; i < counts.by_switch.size(); ++i)
      if (const long n = counts.by_switch[i]; n > 0) {
        Json& known = by_element[std::string(dynamics_.switches()[i].element)];
        known = known.is_null() ? n : known.get<long>() + n;
      }
    summary["events_by_element"] = by_element;
  }

 private:
  Inputs<Real> inputs_;
  Watched<M> dynamics_;
  Real end_{0};
};

}  // namespace cutjoint::runge_kutta
