// The simulator of mechanisms whose programs are data: `simulator RUN.json`, where the run file has the mechanism.
#include "cutjoint/interpreter/mechanism.hpp"
#include "cutjoint/program.hpp"
#include "cutjoint/read_json.hpp"

int main(int argc, char** argv) {
  return cutjoint::run_program(argc, argv, "simulator", [](const cutjoint::Json& file) {
    const cutjoint::Json& model = file.at("model");
    cutjoint::interpreter::InterpretedMechanism start(model), mechanism(model);
    return cutjoint::perform(file, start, mechanism);
  });
}
