// A host drives the generated mechanism of tests/mechanisms/driven.py; a line for each source with the time and the guided columns.
#include <cstdio>

#include "cutjoint/core/inputs/inputs.hpp"
#include "driven.hpp"

using Mechanism = cutjoint::generated::Driven<double>;

namespace {

using cutjoint::InputSource, cutjoint::interpolate, cutjoint::numbers_per_input;

/// A zero-order hold of all `count` inputs, which the host may change between steps.  Rates and accelerations are zero: a guide
/// stands still within a step and jumps between steps, so inputs of guides should be interpolated.
template <class Real>
struct ZeroOrderHold {
  const Real* values;
  int count;

  InputSource<Real> source() { return {&fill, this}; }

  static void fill(void* host, Real, Real* input) {
    const ZeroOrderHold& hold = *static_cast<const ZeroOrderHold*>(host);
    for (int i = 0; i < hold.count; ++i) {
      Real* const numbers = input + numbers_per_input * i;
      numbers[0] = hold.values[i];
      numbers[1] = numbers[2] = Real(0);
    }
  }
};

/// A source with values, and optionally rates, of all `count` inputs at the beginning and end of a step or sampling
/// interval.  Inputs are cubic in between; linear without rates.
template <class Real>
struct Interpolated {
  Real begin_time, end_time;
  const Real* begin;
  const Real* end;
  const Real* begin_rates = nullptr;
  const Real* end_rates = nullptr;
  int count = 0;

  InputSource<Real> source() { return {&fill, this}; }

  static void fill(void* host, Real t, Real* input) {
    const Interpolated& x = *static_cast<const Interpolated*>(host);
    const Real length = x.end_time - x.begin_time;
    for (int i = 0; i < x.count; ++i) {
      const Real derivative = (x.end[i] - x.begin[i]) / length;
      const bool cubic = x.begin_rates && x.end_rates;
      interpolate(t - x.begin_time, length, x.begin[i], cubic ? x.begin_rates[i] : derivative, x.end[i], cubic ? x.end_rates[i] : derivative,
                  input + numbers_per_input * i);
    }
  }
};

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
  ZeroOrderHold<double> held{values, 2};
  mechanism.drive_by(held.source());
  print(mechanism, 0.5);
  values[0] = -0.3;
  print(mechanism, 0.6);
  const double begin[] = {0.1, 1.0}, end[] = {0.4, 1.0}, begin_rates[] = {0.5, 0.0}, end_rates[] = {-1.0, 0.0};
  Interpolated<double> interpolated{.begin_time = 0.5, .end_time = 0.75, .begin = begin, .end = end, .count = 2};
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
