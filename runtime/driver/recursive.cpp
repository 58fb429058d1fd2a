// The driver of the recursive method.
#include "cutjoint/driver.hpp"
#include "integrators.hpp"

#include "cutjoint/perform.hpp"
#include "cutjoint/program.hpp"
#include "cutjoint/read_settings.hpp"
#include "cutjoint/recursive.hpp"
#include "cutjoint/reference/method.hpp"
#include "cutjoint/run.hpp"
#include "cutjoint/runge_kutta/method.hpp"
#include "cutjoint/stepping/split_steps.hpp"
#include "cutjoint/stepping/trapezoidal_rule.hpp"

namespace {

using namespace cutjoint;
using M = AnyMechanism<Precision>;

const Abilities abilities{
    .tasks = {Task::simulate, Task::realtime, Task::equilibrium, Task::evaluate},
    .integrators = {Integrator::trapezoidal, Integrator::rk4, Integrator::dormand_prince, Integrator::reference},
};

template <class Method>
Json run(AnyMechanism<double>& start, M& mechanism, const RunSettings& settings, const Json& file) {
  Method method(mechanism, settings, file);
  return Run(start, method, settings, file).perform();
}

}  // namespace

Json cutjoint::perform(const Json& file, AnyMechanism<double>& start, AnyMechanism<Precision>& mechanism) {
  const RunSettings settings = read_settings<Precision>(file, abilities);
  switch (settings.integrator) {
    case Integrator::reference:
      return run<reference::RelativeReference<M>>(start, mechanism, settings, file);
    case Integrator::rk4:
      return run<runge_kutta::ExplicitMethod<M, runge_kutta::ClassicalTable>>(start, mechanism, settings, file);
    case Integrator::dormand_prince:
      return run<runge_kutta::ExplicitMethod<M, runge_kutta::DormandPrinceTable>>(start, mechanism, settings, file);
    default:
      if (settings.events) return run<stepping::SplitSteps<M, stepping::TrapezoidalRule<M>>>(start, mechanism, settings, file);
      return run<Recursive<M>>(start, mechanism, settings, file);
  }
}

int cutjoint::run_main(int argc, char** argv, AnyMechanism<double>& start, AnyMechanism<Precision>& mechanism) {
  return run_program(argc, argv, "simulator", [&](const Json& file) { return perform(file, start, mechanism); });
}
