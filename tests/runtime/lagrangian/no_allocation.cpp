// Counts the allocations of steps: malloc itself is interposed, since not all code goes through operator new.
#include <cstdio>
#include <cstdlib>

#include "cutjoint/lagrangian/method.hpp"
#include "point_system.hpp"

extern "C" void* __libc_malloc(std::size_t size);

namespace {

long allocations = 0;

// Two points that swing in space, the second on the first, by a spring to a pivot that swings too.
const char* const system_of_points = R"({
  "points": [{"mass": 1.5, "at": [1, 0, 0], "rate": [0, 0.5, 0.3]}, {"mass": 0.5, "at": [1, 1, 0], "rate": [0.4, 0.5, -0.6]}],
  "equations": [{"a": 0, "b": {"at": [0, 0, 0]}, "length": 1}, {"a": 1, "b": 0, "length": 1}],
  "springs": [{"a": 1, "b": {"at": [0, 0, 0], "swing": [0, 0.1, 0], "rate": 3}, "stiffness": 10, "damping": 0.1}]
})";

const char* const figures = R"({"numerics": {"dt": 1e-3, "penalty": 1e9}, "parameters": {}, "roads": {}})";

}  // namespace

template <>
std::span<const cutjoint::SolverKind<double>> cutjoint::library_solvers<double>() {
  return {};
}

extern "C" void* malloc(std::size_t size) {
  ++allocations;
  return __libc_malloc(size);
}

/// Allocations before the steps and in them, for the method that the argument names.
int main(int, char** argv) {
  cutjoint::Json definition = cutjoint::Json::parse(system_of_points);
  definition["method"] = argv[1];
  const cutjoint::Json file = cutjoint::Json::parse(figures);
  points::PointSystem system(definition);
  cutjoint::LagrangianMethod<points::PointSystem> method(system, file);
  method.begin(cutjoint::State<double>(0, 0, 0), 1.0);
  const long before = allocations;
  for (long n = 1; n <= 500; ++n) method.step(n);
  std::printf("%ld %ld\n", before, allocations - before);
}
