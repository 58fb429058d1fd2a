// The driver of the Lagrangian methods.
#include "cutjoint/driver.hpp"
#include "cutjoint/extension.hpp"
#include "newton.hpp"

#include "cutjoint/core/stepping/implicit_steps.hpp"
#include "cutjoint/core/stepping/substeps.hpp"
#include "cutjoint/core/stepping/newton_rule.hpp"
#include "cutjoint/core/newton/classical.hpp"
#include "cutjoint/lagrangian/choose_solver.hpp"
#include "cutjoint/lagrangian/dependence.hpp"
#include "cutjoint/program.hpp"
#include "cutjoint/run.hpp"
#include "cutjoint/simulated.hpp"

namespace {

using namespace cutjoint;
using S = AnySystem<Precision>;

const Abilities abilities{.integrators = &IntegratorRow::lagrangian, .added = is_added<S>};

}  // namespace

Json cutjoint::perform(const Json& file, AnyMechanism<double>& start, AnySystem<Precision>& system) {
  const RunSettings settings = read_settings(file, abilities);
  switch (settings.integrator) {
    case Integrator::added:
      return added_integrators<S>().at(file.at("integrator"))(start, system, settings, file);
#define CUTJOINT_CASE(name, of_own_length) \
    case Integrator::name:                 \
      return run_by<Simulated<RadauSteps<S, S, of_own_length, CompiledSolver>>>(start, system, settings, file);
    CUTJOINT_RADAU_INTEGRATORS(CUTJOINT_CASE)
    default:
      if (settings.events) return run_by<Simulated<SplitSteps<stepping::NewtonRule<S, CompiledSolver>>>>(start, system, settings, file);
      switch (system.description().method) {
        case Lagrangian::augmented:
          return run_by<Simulated<NewtonSteps<S, S, CompiledAugmented, CompiledSolver>>>(start, system, settings, file);
        case Lagrangian::classical:
          return run_by<Simulated<NewtonSteps<S, S, CompiledClassical, CompiledSolver>>>(start, system, settings, file);
        default:
          return run_by<Simulated<NewtonSteps<S, S, CompiledRecursive, CompiledSolver>>>(start, system, settings, file);
      }
  }
}

int cutjoint::run_main(int argc, char** argv, AnyMechanism<double>& start, AnySystem<Precision>& system) {
  return run_program(argc, argv, "simulator", [&](const Json& file) { return perform(file, start, system); });
}
