// The driver of the recursive method.
#include "cutjoint/driver.hpp"

#include "cutjoint/runge_kutta/method.hpp"
#include "cutjoint/program.hpp"
#include "cutjoint/recursive.hpp"
#include "cutjoint/reference/method.hpp"
#include "cutjoint/read_settings.hpp"
#include "cutjoint/run.hpp"
#include "cutjoint/stepping/parted.hpp"
#include "cutjoint/stepping/trapezoidal_rule.hpp"

extern template class cutjoint::Trapezoidal<cutjoint::AnyMechanism<cutjoint::Precision>>;  // trapezoidal.cpp

int cutjoint::run_main(int argc, char** argv, AnyMechanism<double>& start, AnyMechanism<Precision>& mechanism) {
  return run_program(argc, argv, "simulator", [&](const Json& file) {
    const std::string integrator = read_word(
        file, "integrator", std::to_array<std::string_view>({"trapezoidal", "rk4", "dormand-prince", "reference"}), "trapezoidal");
    if (integrator == "reference") {
      reference::RelativeReference<AnyMechanism<Precision>> method(mechanism, file);
      return Run(start, method, file).perform();
    }
    if (integrator == "rk4") {
      runge_kutta::ExplicitMethod<AnyMechanism<Precision>, runge_kutta::ClassicalTable> method(mechanism, file);
      return Run(start, method, file).perform();
    }
    if (integrator == "dormand-prince") {
      runge_kutta::ExplicitMethod<AnyMechanism<Precision>, runge_kutta::DormandPrinceTable> method(mechanism, file);
      return Run(start, method, file).perform();
    }
    if (stepping::locates_events(file)) {
      stepping::PartedSteps<AnyMechanism<Precision>, stepping::TrapezoidalRule<AnyMechanism<Precision>>> method(mechanism, file);
      return Run(start, method, file).perform();
    }
    Recursive<AnyMechanism<Precision>> method(mechanism, file);
    return Run(start, method, file).perform();
  });
}
