// The mechanism of a batch, some of whose states are accelerated side by side.
#pragma once

#include "cutjoint/batch/real.hpp"
#include "cutjoint/core/side_by_side.hpp"
#include "cutjoint/mechanism.hpp"
#include "cutjoint/state.hpp"

namespace cutjoint::batch {

/// A mechanism with several instances.
using Instances = AnyMechanism<Real>;

/// A mechanism that somebody else holds.
class Referred {
 public:
  using real_type = double;

  explicit Referred(AnyMechanism<double>& alone) : alone_(alone) {}

  const Description& description() const { return alone_.description(); }
  void load(const double* parameters, const Stabilisation<double>& s, const Road<double>* roads) { alone_.load(parameters, s, roads); }
  void drive_by(const InputSource<double>& source) { alone_.drive_by(source); }
  void begin_step(double t, double motion) { alone_.begin_step(t, motion); }
  void evaluate(const double* q, const double* v, const double* lambda, double* vdot, double* correction) const {
    alone_.evaluate(q, v, lambda, vdot, correction);
  }
  void constraint_residual(const double* q, const double* v, double* residual, double* rate) const { alone_.constraint_residual(q, v, residual, rate); }
  void report(const double* q, const double* v, const double* vdot, const double* lambda, double* column) const {
    alone_.report(q, v, vdot, lambda, column);
  }
  void energy(const double* q, const double* v, const double* vdot, const double* lambda, double* energy) const {
    alone_.energy(q, v, vdot, lambda, energy);
  }
  void project(const double* q, const double* gap, double* dz) const { alone_.project(q, gap, dz); }

 private:
  AnyMechanism<double>& alone_;
};

using SideBySide = cutjoint::SideBySide<Referred, Instances>;

}  // namespace cutjoint::batch
