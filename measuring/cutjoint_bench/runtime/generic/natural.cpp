#include "natural.hpp"

#include "cutjoint/core/newton/augmented.hpp"
#include "cutjoint/core/stepping/newton_steps.hpp"
#include "cutjoint/examine.hpp"
#include "cutjoint/generic/natural/system.hpp"
#include "cutjoint/lagrangian/choose_solver.hpp"
#include "cutjoint/core/newton/classical.hpp"
#include "cutjoint/lagrangian/dependence.hpp"
#include "cutjoint/read_settings.hpp"
#include "cutjoint/run.hpp"
#include "cutjoint/simulated.hpp"
#include "eigen/lagrangian.hpp"
#include "suitesparse/lagrangian.hpp"

namespace {

using System = cutjoint::generic::natural::GenericSystem<double>;
using Solver = cutjoint::ChosenSolver<System>;

const cutjoint::Abilities abilities{.integrators = &cutjoint::IntegratorRow::generic};

template <class Newton>
cutjoint::Json run(System& system, cutjoint::AnyMechanism<double>& start, const cutjoint::RunSettings& settings, const cutjoint::Json& file) {
  cutjoint::Simulated<cutjoint::NewtonSteps<System, System, Newton, Solver>> method(system, settings, file);
  return cutjoint::Run(start, method, settings, file).perform();
}

}  // namespace

cutjoint::Json run_natural(const cutjoint::Json& model, cutjoint::AnyMechanism<double>& start, const cutjoint::Json& file) {
  System system(model);
  if (cutjoint::examine::is_asked(file)) return cutjoint::examine::perform(file, start, system, abilities.integrators);
  const cutjoint::RunSettings settings = cutjoint::read_settings(file, abilities);
  if (system.description().method == cutjoint::Lagrangian::classical) return run<cutjoint::ClassicalNewton<System, Solver>>(system, start, settings, file);
  return run<cutjoint::AugmentedNewton<System, Solver>>(system, start, settings, file);
}
