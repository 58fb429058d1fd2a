// One mechanism whose instances find the accelerations of several of its states side by side.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "cutjoint/batch/real.hpp"
#include "cutjoint/core/lane_inputs.hpp"
#include "cutjoint/core/lane_steps.hpp"
#include "cutjoint/core/start.hpp"
#include "cutjoint/mechanism.hpp"
#include "cutjoint/state.hpp"

namespace cutjoint::batch {

/// A mechanism with several instances.
using Instances = AnyMechanism<Real>;

/// A mechanism as a search for equilibrium takes it: most of that is accelerations of neighbouring states.
class SideBySide {
 public:
  using real_type = double;

  SideBySide(AnyMechanism<double>& alone, Instances& instances)
      : alone_(alone), instances_(instances), lanes_(instances), next_(alone.description().speeds.size()),
        correction_(alone.description().equations.size()) {}

  const Description& description() const { return alone_.description(); }

  void load(const double* parameters, const Stabilisation<double>& s, const Road<double>* roads) {
    alone_.load(parameters, s, roads);
    parameters_.assign(parameters, parameters + description().parameters.size());
    roads_.clear();
    for (std::size_t i = 0; i < description().roads.size(); ++i) {
      Road<Real>& all = roads_.emplace_back();
      for (int k = 0; k < width; ++k) all.put(k, roads[i]);
    }
    if (s.penalties) penalties_.assign(s.penalties, s.penalties + description().cuts.size());
    instances_.load(parameters_.data(),
                    {.penalty = s.penalty, .damping_ratio = s.damping_ratio, .frequency = s.frequency, .penalties = s.penalties ? penalties_.data() : nullptr},
                    roads_.data());
  }

  void drive_by(const InputSource<double>& source) {
    alone_.drive_by(source);
    lanes_.drive(instances_, [&](int) { return source; });
  }

  void begin_step(double t, double motion) { alone_.begin_step(t, motion); }

  void evaluate(const double* q, const double* v, const double* lambda, double* vdot, double* correction) const {
    alone_.evaluate(q, v, lambda, vdot, correction);
  }

  void constraint_residual(const double* q, const double* v, double* residual, double* rate) const { alone_.constraint_residual(q, v, residual, rate); }

  void report(const double* q, const double* v, const double* vdot, const double* lambda, double* column) const {
    alone_.report(q, v, vdot, lambda, column);
  }

  void project(const double* q, const double* gap, double* dz) const { alone_.project(q, gap, dz); }

  void guard(const double* q, const double* v, double* margin) const { alone_.guard(q, v, margin); }

  /// What `Starter::accelerate` does with one state, several at a time.
  void accelerate(std::vector<State<double>>& states, double motion) {
    for (std::size_t first = 0; first < states.size(); first += width) {
      State<Real> together(description());
      const std::size_t n = std::min<std::size_t>(width, states.size() - first);
      for (std::size_t k = 0; k < width; ++k) put_lane(static_cast<int>(k), states[first + std::min(k, n - 1)], together);
      cutjoint::accelerate(instances_, together, Real(motion), next_, correction_);
      for (std::size_t k = 0; k < n; ++k) take_lane(static_cast<int>(k), together, states[first + k]);
    }
  }

 private:
  AnyMechanism<double>& alone_;
  Instances& instances_;
  LaneInputs<Instances> lanes_;
  std::vector<Real> parameters_, penalties_, next_, correction_;
  std::vector<Road<Real>> roads_;
};

}  // namespace cutjoint::batch
