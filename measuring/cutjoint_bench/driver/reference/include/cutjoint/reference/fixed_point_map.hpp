// The map of the fixed point at rows of a run, as the driver sees it.
#pragma once

#include <string>
#include <vector>

#include "cutjoint/core/mechanism/retraction.hpp"
#include "cutjoint/core/stepping/fixed_point_steps.hpp"
#include "cutjoint/run.hpp"
#include "cutjoint/simulated.hpp"
#include "cutjoint/table.hpp"

namespace cutjoint::reference {

/// The trapezoidal rule, which writes for each row a line of JSON to the file "tangents_out": the Jacobians of the accelerations with respect to
/// coordinates (increments of `retract`) and velocities, by columns, by central differences of `evaluate` with constant multipliers.
template <Mechanism M>
class FixedPointMap : public Simulated<FixedPointSteps<M>> {
  using Base = Simulated<FixedPointSteps<M>>;

 public:
  using Real = typename M::real_type;

  FixedPointMap(M& mechanism, const RunSettings& settings, const Json& file)
      : Base(mechanism, settings, file), mechanism_(mechanism), tangents_(file.at("tangents_out")) {}

  void report(Real* column) {
    Base::report(column);
    tangents_.write(differentiate().dump() + '\n');
  }

 private:
  Json differentiate() const {
    const Json state = this->state();
    const auto q = numbers(state.at("q")), v = numbers(state.at("v")), lambda = numbers(state.at("lambda"));
    const std::size_t n = v.size();
    const Real h(1e-5);
    std::vector<Real> delta(n), forward(n), backward(n), correction(lambda.size()), moved = q, moved_v = v;
    const auto jacobian = [&](auto move) {
      std::vector<Real> columns;
      for (std::size_t j = 0; j < n; ++j) {
        for (const Real by : {h, -h}) {
          move(j, by);
          mechanism_.evaluate(moved.data(), moved_v.data(), lambda.data(), (by > Real(0) ? forward : backward).data(), correction.data());
        }
        move(j, Real(0));
        for (std::size_t i = 0; i < n; ++i) columns.push_back((forward[i] - backward[i]) / (2 * h));
      }
      return columns;
    };
    const auto stiffness = jacobian([&](std::size_t j, Real by) {
      delta[j] = by;
      if (by == Real(0)) moved = q;
      else retract<Real>(mechanism_.description().charts, q.data(), delta.data(), moved.data());
    });
    return Json{{"t", state.at("t")}, {"stiffness", stiffness}, {"damping", jacobian([&](std::size_t j, Real by) { moved_v[j] = v[j] + by; })}};
  }

  static std::vector<Real> numbers(const Json& of) {
    std::vector<Real> found;
    for (const Json& each : of) found.push_back(Real(each.get<double>()));
    return found;
  }

  M& mechanism_;
  OutputFile tangents_;
};

}  // namespace cutjoint::reference
