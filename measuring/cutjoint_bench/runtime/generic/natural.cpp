#include "natural.hpp"

#include "cutjoint/generic/natural/system.hpp"
#include "cutjoint/lagrangian/method.hpp"
#include "cutjoint/read_settings.hpp"
#include "cutjoint/run.hpp"

namespace {

using cutjoint::Integrator, cutjoint::Task;

const cutjoint::Abilities abilities{
    .tasks = {Task::simulate, Task::realtime, Task::equilibrium, Task::evaluate, Task::factor},
    .integrators = {Integrator::trapezoidal},
    .solvers = true,
};

}  // namespace

cutjoint::Json run_natural(const cutjoint::Json& model, cutjoint::AnyMechanism<double>& start, const cutjoint::Json& file) {
  using System = cutjoint::generic::natural::GenericSystem<double>;
  System system(model);
  const cutjoint::RunSettings settings = cutjoint::read_settings<double>(file, abilities);
  cutjoint::LagrangianMethod<System> method(system, settings, file);
  return cutjoint::Run(start, method, settings, file).perform();
}
