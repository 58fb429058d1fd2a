// A host drives the generated mechanism of tests/mechanisms/driven.py; a line for each source with the time and the guided columns.
#include <cstdio>

#include "cutjoint/core/inputs/inputs.hpp"
#include "driven.hpp"

using Mechanism = cutjoint::generated::Driven<double>;

namespace {

void print(Mechanism& mechanism, double t) {
  const double q[2] = {}, v[2] = {}, vdot[2] = {}, lambda[1] = {};
  double column[7];
  mechanism.begin_step(t, 1.0);
  mechanism.report(q, v, vdot, lambda, column);
  std::printf("%.17g %.17g %.17g %.17g\n", t, column[0], column[1], column[2]);
}

/// A source of one input of two.
void rise(void* host, double t, double* input) {
  const double speed = *static_cast<const double*>(host);
  input[0] = speed * t;
  input[1] = speed;
  input[2] = 0.0;
}

}  // namespace

int main() {
  Mechanism mechanism;
  const double parameters[] = {3.0};
  mechanism.load(parameters, {}, nullptr);
  print(mechanism, 0.5);
  double values[] = {0.7, 1.0};
  cutjoint::ZeroOrderHold<double> held{values, 2};
  mechanism.drive_by(held.source());
  print(mechanism, 0.5);
  values[0] = -0.3;
  print(mechanism, 0.6);
  const double begin[] = {0.1, 1.0}, end[] = {0.4, 1.0}, begin_rates[] = {0.5, 0.0}, end_rates[] = {-1.0, 0.0};
  cutjoint::Interpolated<double> interpolated{.begin_time = 0.5, .end_time = 0.75, .begin = begin, .end = end, .count = 2};
  mechanism.drive_by(interpolated.source());
  print(mechanism, 0.6);
  interpolated.begin_rates = begin_rates;
  interpolated.end_rates = end_rates;
  print(mechanism, 0.6);
  double speed = 2.0;
  mechanism.drive_by({&rise, &speed});
  print(mechanism, 0.6);
  mechanism.drive_by({});
  print(mechanism, 0.5);
}
