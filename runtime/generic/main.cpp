// The simulator of a model that is interpreted at run time: `generic RUN.json`, where the run file has the model's description, or names a file
// with it.
#include "cutjoint/generic/mechanism.hpp"
#include "cutjoint/program.hpp"
#include "cutjoint/recursive.hpp"
#include "cutjoint/run.hpp"
#include "natural.hpp"

namespace {

using cutjoint::Json;
using Mechanism = cutjoint::generic::GenericMechanism<double>;

static_assert(cutjoint::Mechanism<Mechanism>);

}  // namespace

int main(int argc, char** argv) {
  return cutjoint::run_program(argc, argv, "generic", [](const Json& file) {
    const Json& place = file.at("model");
    const Json model = place.is_string() ? cutjoint::read_json(place) : place;
    if (model.contains("method")) return run_natural(model, file);
    Mechanism start(model), mechanism(model);
    cutjoint::Recursive<Mechanism> method(mechanism, file);
    return cutjoint::Run(start, method, file).perform();
  });
}
