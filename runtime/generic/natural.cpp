#include "natural.hpp"

#include "cutjoint/generic/mechanism.hpp"
#include "cutjoint/generic/natural/system.hpp"
#include "cutjoint/lagrangian/method.hpp"
#include "cutjoint/run.hpp"

cutjoint::Json run_natural(const cutjoint::Json& model, const cutjoint::Json& file) {
  using System = cutjoint::generic::natural::GenericSystem<double>;
  cutjoint::generic::GenericMechanism<double> start(model.at("start"));
  System system(model);
  cutjoint::LagrangianMethod<System> method(system, file);
  return cutjoint::Run(start, method, file).perform();
}
