// The driver of the Lagrangian methods.
#include "cutjoint/driver.hpp"
#include "newton.hpp"

#include "cutjoint/lagrangian/method.hpp"
#include "cutjoint/perform.hpp"
#include "cutjoint/program.hpp"
#include "cutjoint/read_settings.hpp"
#include "cutjoint/reference/method.hpp"
#include "cutjoint/run.hpp"
#include "cutjoint/sdirk/method.hpp"
#include "cutjoint/stepping/newton_rule.hpp"
#include "cutjoint/stepping/split_steps.hpp"

namespace {

using namespace cutjoint;
using S = AnySystem<Precision>;

const Abilities abilities{
    .tasks = {Task::simulate, Task::realtime, Task::equilibrium, Task::evaluate, Task::factor},
    .integrators = {Integrator::trapezoidal, Integrator::sdirk4, Integrator::sdirk4_fixed, Integrator::generalised_alpha,
                    Integrator::reference},
    .solvers = true,
};

template <class Method>
Json run(AnyMechanism<double>& start, S& system, const RunSettings& settings, const Json& file) {
  Method method(system, settings, file);
  return Run(start, method, settings, file).perform();
}

}  // namespace

Json cutjoint::perform(const Json& file, AnyMechanism<double>& start, AnySystem<Precision>& system) {
  const RunSettings settings = read_settings<Precision>(file, abilities);
  switch (settings.integrator) {
    case Integrator::reference:
      return run<reference::NaturalReference<S>>(start, system, settings, file);
    case Integrator::sdirk4:
    case Integrator::sdirk4_fixed:
      return run<sdirk::ImplicitMethod<S>>(start, system, settings, file);
    default:
      if (settings.events) return run<stepping::SplitSteps<S, stepping::NewtonRule<S>>>(start, system, settings, file);
      return run<LagrangianMethod<S>>(start, system, settings, file);
  }
}

int cutjoint::run_main(int argc, char** argv, AnyMechanism<double>& start, AnySystem<Precision>& system) {
  return run_program(argc, argv, "simulator", [&](const Json& file) { return perform(file, start, system); });
}
