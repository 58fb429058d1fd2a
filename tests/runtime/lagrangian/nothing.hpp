// A mechanism without coordinates: the start of systems that know theirs.
#pragma once

#include "cutjoint/any_mechanism.hpp"

namespace points {

class Nothing final : public cutjoint::AnyMechanism<double> {
 public:
  const cutjoint::Description& description() const override { return d_; }
  void load(const double*, const cutjoint::Stabilisation<double>&, const cutjoint::Road<double>*) override {}
  void begin_step(double, double) override {}
  void evaluate(const double*, const double*, const double*, double*, double*) const override {}
  void constraint_residual(const double*, const double*, double*, double*) const override {}
  void report(const double*, const double*, const double*, const double*, double*) const override {}

 private:
  cutjoint::Description d_{};
};

}  // namespace points
