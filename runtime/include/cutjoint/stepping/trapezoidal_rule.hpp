// The recursive method's trapezoidal rule for steps that are split at events.
#pragma once

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "cutjoint/json.hpp"
#include "cutjoint/core/largest.hpp"
#include "cutjoint/mechanism.hpp"
#include "cutjoint/core/projection.hpp"
#include "cutjoint/core/relative.hpp"
#include "cutjoint/run_file.hpp"
#include "cutjoint/settings.hpp"
#include "cutjoint/state.hpp"
#include "cutjoint/core/trapezoidal.hpp"

namespace cutjoint::stepping {

/// The rule of equal_steps.hpp over `Trapezoidal`.
template <Mechanism M>
class TrapezoidalRule {
 public:
  using Real = typename M::real_type;
  using Subject = M;

  static constexpr double least = 0;

  TrapezoidalRule(M& mechanism, const RunSettings& settings)
      : mechanism_(mechanism), d_(mechanism.description()), proximal_(settings.stabilisation.closure == Closure::proximal),
        steps_(mechanism, Real(settings.dt), fixed_point_of(settings)), relative_(mechanism, Real(1e-12)),
        projection_(mechanism), residual_(d_.equations.size()), rate_(d_.equations.size()), y_(relative_.size()) {}

  void load(ModelData<Real>& data, const StabilisationSettings& stabilisation) {
    load_penalties(data, stabilisation, std::vector<double>(d_.cuts.size(), 1.0));
  }

  /// Load the mechanism with the penalties of its cut joints, which its start has found.
  void load_penalties(ModelData<Real>& data, const StabilisationSettings& stabilisation, const std::vector<double>& penalties) {
    data.load_mechanism(mechanism_, stabilisation, converted<Real>(penalties));
  }

  const Description& description() const { return d_; }
  State<Real> blank() const { return State<Real>(d_); }

  void begin(const State<Real>& start, State<Real>& state) {
    state = start;
    relative_.begin(start);
    mechanism_.begin_step(state.t, Real(1));
  }

  void restart(State<Real>& state) {
    std::copy(state.v.begin(), state.v.end(), std::copy(state.q.begin(), state.q.end(), y_.begin()));
    relative_.guess(state.lambda);
    const State<Real>& solved = relative_.solve(state.t, y_);
    if (!std::isfinite(static_cast<double>(largest(solved.vdot))))
      throw Failure("the accelerations have no finite value", static_cast<double>(state.t), 0, std::string(d_.speeds[0]),
                    static_cast<double>(largest(solved.vdot)), "it may move no mass in this pose; not tried: another dt");
    state.vdot = solved.vdot;
    state.lambda = solved.lambda;
  }

  void step(State<Real>& state, Real h, long number) {
    steps_.set_step(h);
    require_none(steps_.step(state, number), d_);
  }

  void keep() {}
  void go_back(const State<Real>&) {}

  void project(State<Real>& state) {
    if (!proximal_) return;
    mechanism_.begin_step(state.t, Real(1));
    require_none(projection_.positions(state), d_);
    require_none(projection_.velocities(state), d_);
  }

  void enter(Real t) { mechanism_.begin_step(t, Real(1)); }

  void events(const State<Real>& state, Real* values) {
    mechanism_.begin_step(state.t, Real(1));
    mechanism_.events(state.q.data(), state.v.data(), values);
  }

  Residuals measure(const State<Real>& state) {
    mechanism_.constraint_residual(state.q.data(), state.v.data(), residual_.data(), rate_.data());
    const Residuals now{static_cast<double>(largest(residual_)), static_cast<double>(largest(rate_))};
    worst_ = {std::max(worst_.position, now.position), std::max(worst_.velocity, now.velocity)};
    measured_ = true;
    return now;
  }

  long evaluations() const { return steps_.evaluations() + relative_.evaluations(); }

  void summarise(Json& summary) const {
    summary["evaluations"] = evaluations();
    summary["iterations"] = steps_.evaluations();
    if (measured_) summary["residuals"] = Json{{"position", number_or_null(worst_.position)}, {"velocity", number_or_null(worst_.velocity)}};
  }

 private:
  M& mechanism_;
  const Description& d_;
  bool proximal_, measured_ = false;
  Trapezoidal<M> steps_;
  Relative<M> relative_;
  Projection<M> projection_;
  std::vector<Real> residual_, rate_, y_;
  Residuals worst_;
};

}  // namespace cutjoint::stepping
