// The driver of the recursive method.
#include "cutjoint/driver.hpp"
#include "cutjoint/extension.hpp"
#include "integrators.hpp"

#include "cutjoint/core/stepping/explicit_steps.hpp"
#include "cutjoint/core/stepping/fixed_point_steps.hpp"
#include "cutjoint/core/stepping/substeps.hpp"
#include "cutjoint/core/stepping/trapezoidal_rule.hpp"
#include "cutjoint/program.hpp"
#include "cutjoint/run.hpp"
#include "cutjoint/simulated.hpp"

namespace {

using namespace cutjoint;
using M = AnyMechanism<Precision>;

const Abilities abilities{.integrators = &IntegratorRow::recursive, .added = is_added<M>};

}  // namespace

Json cutjoint::perform(const Json& file, AnyMechanism<double>& start, AnyMechanism<Precision>& mechanism) {
  const RunSettings settings = read_settings(file, abilities);
  switch (settings.integrator) {
    case Integrator::added:
      return added_integrators<M>().at(file.at("integrator"))(start, mechanism, settings, file);
#define CUTJOINT_CASE(name, table) \
    case Integrator::name:         \
      return run_by<Simulated<ExplicitSteps<M, runge_kutta::table>>>(start, mechanism, settings, file);
    CUTJOINT_EXPLICIT_INTEGRATORS(CUTJOINT_CASE)
    default:
      if (settings.events) return run_by<Simulated<SplitSteps<stepping::TrapezoidalRule<M>>>>(start, mechanism, settings, file);
      return run_by<Simulated<FixedPointSteps<M>>>(start, mechanism, settings, file);
  }
}

int cutjoint::run_main(int argc, char** argv, AnyMechanism<double>& start, AnyMechanism<Precision>& mechanism) {
  return run_program(argc, argv, "simulator", [&](const Json& file) { return perform(file, start, mechanism); });
}
