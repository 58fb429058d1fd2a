// Counts the allocations of integrator steps: malloc itself is interposed, since not all code goes through operator new.
#include <cstdio>
#include <cstdlib>
#include <vector>

#include "cutjoint/start.hpp"
#include "cutjoint/trapezoidal.hpp"
#include "four_bar.hpp"

extern "C" void* __libc_malloc(std::size_t size);

namespace {
long allocations = 0;
}

extern "C" void* malloc(std::size_t size) {
  ++allocations;
  return __libc_malloc(size);
}

int main() {
  cutjoint::generated::FourBar<double> mechanism;
  mechanism.load(nullptr, {1e4, 1.0, 200.0}, nullptr);
  cutjoint::State<double> state(mechanism.description());
  for (std::size_t i = 0; i < state.v.size(); ++i)
    if (mechanism.description().speeds[i].substr(0, 5) == "crank") state.v[i] = -1.0;
  cutjoint::Starter<cutjoint::AnyMechanism<double>> starter(mechanism);
  starter.make_consistent(state, std::vector<bool>(state.v.size(), false), 1.0);
  starter.accelerate(state, 1.0);
  cutjoint::Trapezoidal<cutjoint::AnyMechanism<double>> integrator(mechanism, 0.001, {1e-6, 100, 4});
  cutjoint::Trapezoidal<cutjoint::AnyMechanism<double>> projected(mechanism, 0.001, {1e-6, 100, 4, true});
  const long before = allocations;
  for (long n = 0; n < 250; ++n) integrator.step(state, n);
  for (long n = 250; n < 500; ++n) projected.step(state, n);
  std::printf("%ld %ld\n", before, allocations - before);
}
