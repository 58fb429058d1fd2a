// The driver of the recursive method.
#include "cutjoint/driver.hpp"

#include "cutjoint/program.hpp"
#include "cutjoint/recursive.hpp"
#include "cutjoint/reference/method.hpp"
#include "cutjoint/run.hpp"

int cutjoint::run_main(int argc, char** argv, AnyMechanism<double>& start, AnyMechanism<Precision>& mechanism) {
  return run_program(argc, argv, "simulator", [&](const Json& file) {
    if (reference::is_reference(file)) {
      reference::RelativeReference<AnyMechanism<Precision>> method(mechanism, file);
      return Run(start, method, file).perform();
    }
    Recursive<AnyMechanism<Precision>> method(mechanism, file);
    return Run(start, method, file).perform();
  });
}
