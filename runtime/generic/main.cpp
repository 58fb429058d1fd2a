// The simulator of a model that is interpreted at run time: `generic RUN.json`, where the run file has the model's description, or names a file
// with it.
#include "cutjoint/generic/mechanism.hpp"
#include "cutjoint/program.hpp"
#include "cutjoint/read_settings.hpp"
#include "cutjoint/recursive.hpp"
#include "cutjoint/run.hpp"
#include "natural.hpp"

namespace {

using cutjoint::Json;
using Mechanism = cutjoint::generic::GenericMechanism<double>;

static_assert(cutjoint::Mechanism<Mechanism>);

const cutjoint::Abilities abilities{
    .tasks = {cutjoint::Task::simulate, cutjoint::Task::realtime, cutjoint::Task::equilibrium, cutjoint::Task::evaluate},
    .integrators = {cutjoint::Integrator::trapezoidal},
};

}  // namespace

int main(int argc, char** argv) {
  return cutjoint::run_program(argc, argv, "generic", [](const Json& file) {
    const Json& place = cutjoint::value_of(file, "model");
    const Json model = place.is_string() ? cutjoint::read_json(place) : place;
    if (model.contains("method")) return run_natural(model, file);
    Mechanism start(model), mechanism(model);
    const cutjoint::RunSettings settings = cutjoint::read_settings<double>(file, abilities);
    cutjoint::Recursive<Mechanism> method(mechanism, settings, file);
    return cutjoint::Run(start, method, settings, file).perform();
  });
}
