// The driver of the Lagrangian methods.
#include "cutjoint/driver.hpp"
#include "cutjoint/lagrangian/method.hpp"
#include "cutjoint/program.hpp"
#include "cutjoint/read_settings.hpp"
#include "cutjoint/reference/method.hpp"
#include "cutjoint/run.hpp"
#include "cutjoint/sdirk/method.hpp"
#include "cutjoint/stepping/newton_rule.hpp"
#include "cutjoint/stepping/parted.hpp"

extern template class cutjoint::Newton<cutjoint::AnySystem<cutjoint::Precision>>;  // newton.cpp
extern template class cutjoint::AugmentedNewton<cutjoint::AnySystem<cutjoint::Precision>>;
extern template class cutjoint::RecursiveNewton<cutjoint::AnySystem<cutjoint::Precision>>;

int cutjoint::run_main(int argc, char** argv, AnyMechanism<double>& start, AnySystem<Precision>& system) {
  return run_program(argc, argv, "simulator", [&](const Json& file) {
    const std::string integrator = read_word(
        file, "integrator",
        std::to_array<std::string_view>({"trapezoidal", "sdirk4", "sdirk4-fixed", "generalised-alpha", "reference"}), "trapezoidal");
    if (integrator == "reference") {
      reference::NaturalReference<AnySystem<Precision>> method(system, file);
      return Run(start, method, file).perform();
    }
    if (integrator.starts_with("sdirk4")) {
      sdirk::ImplicitMethod<AnySystem<Precision>> method(system, file);
      return Run(start, method, file).perform();
    }
    if (stepping::locates_events(file)) {
      stepping::PartedSteps<AnySystem<Precision>, stepping::NewtonRule<AnySystem<Precision>>> method(system, file);
      return Run(start, method, file).perform();
    }
    LagrangianMethod<AnySystem<Precision>> method(system, file);
    return Run(start, method, file).perform();
  });
}
