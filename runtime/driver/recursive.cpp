// The driver of the recursive method.
#include "cutjoint/driver.hpp"
#include "cutjoint/extension.hpp"
#include "integrators.hpp"

#include "cutjoint/core/explicit_steps.hpp"
#include "cutjoint/core/fixed_point_steps.hpp"
#include "cutjoint/core/substeps.hpp"
#include "cutjoint/core/stepping/trapezoidal_rule.hpp"
#include "cutjoint/perform.hpp"
#include "cutjoint/program.hpp"
#include "cutjoint/read_settings.hpp"
#include "cutjoint/run.hpp"
#include "cutjoint/simulated.hpp"

namespace {

using namespace cutjoint;
using M = AnyMechanism<Precision>;

const Abilities abilities{
    .tasks = {Task::simulate, Task::realtime, Task::equilibrium, Task::evaluate},
    .integrators = {Integrator::trapezoidal, Integrator::rk4, Integrator::dormand_prince, Integrator::dop853},
    .added = is_added<M>,
};

}  // namespace

Json cutjoint::perform(const Json& file, AnyMechanism<double>& start, AnyMechanism<Precision>& mechanism) {
  const RunSettings settings = read_settings<Precision>(file, abilities);
  switch (settings.integrator) {
    case Integrator::added:
      return added_integrators<M>().at(file.at("integrator"))(start, mechanism, settings, file);
    case Integrator::rk4:
      return run_by<Simulated<ExplicitSteps<M, runge_kutta::ClassicalTable>>>(start, mechanism, settings, file);
    case Integrator::dormand_prince:
      return run_by<Simulated<ExplicitSteps<M, runge_kutta::DormandPrinceTable>>>(start, mechanism, settings, file);
    case Integrator::dop853:
      return run_by<Simulated<ExplicitSteps<M, runge_kutta::Dop853Table>>>(start, mechanism, settings, file);
    default:
      if (settings.events) return run_by<Simulated<SplitSteps<stepping::TrapezoidalRule<M>>>>(start, mechanism, settings, file);
      return run_by<Simulated<FixedPointSteps<M>>>(start, mechanism, settings, file);
  }
}

int cutjoint::run_main(int argc, char** argv, AnyMechanism<double>& start, AnyMechanism<Precision>& mechanism) {
  return run_program(argc, argv, "simulator", [&](const Json& file) { return perform(file, start, mechanism); });
}
