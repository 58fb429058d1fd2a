// The driver of the recursive method.
#include "cutjoint/driver.hpp"

#include "cutjoint/program.hpp"
#include "cutjoint/recursive.hpp"
#include "cutjoint/run.hpp"

int cutjoint::run_main(int argc, char** argv, AnyMechanism<double>& mechanism) {
  return run_program(argc, argv, "simulator", [&](const Json& file) {
    Recursive<AnyMechanism<double>> method(mechanism, file);
    return Run(mechanism, method, file).perform();
  });
}
