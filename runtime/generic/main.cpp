// The simulator of a model that is interpreted at run time: `generic RUN.json`, where the run file names the model's description.
#include "cutjoint/generic/mechanism.hpp"
#include "cutjoint/run.hpp"

namespace {

using cutjoint::Json;
using Mechanism = cutjoint::generic::GenericMechanism<double>;

static_assert(cutjoint::Mechanism<Mechanism>);

Json read_json(const std::string& path) {
  std::ifstream in(path);
  if (!in) throw std::runtime_error("cannot read " + path);
  return Json::parse(in);
}

}  // namespace

/// Exit status 0 when done, 1 when the run failed, 2 when it could not begin.
int main(int argc, char** argv) {
  try {
    if (argc != 2) throw std::runtime_error("usage: generic RUN.json");
    const Json file = read_json(argv[1]);
    Mechanism mechanism(read_json(file.at("model")));
    const Json summary = cutjoint::Run<Mechanism>(mechanism, file).perform();
    std::cout << summary << std::endl;
    return summary.at("status") == "done" ? 0 : 1;
  } catch (const std::exception& error) {
    std::cerr << "error: " << error.what() << std::endl;
    return 2;
  }
}
