// The driver of the Lagrangian methods.
#include "cutjoint/driver.hpp"
#include "cutjoint/lagrangian/method.hpp"
#include "cutjoint/program.hpp"
#include "cutjoint/run.hpp"

int cutjoint::run_main(int argc, char** argv, AnyMechanism<double>& start, AnySystem<double>& system) {
  return run_program(argc, argv, "simulator", [&](const Json& file) {
    LagrangianMethod<AnySystem<double>> method(system, file);
    return Run(start, method, file).perform();
  });
}
