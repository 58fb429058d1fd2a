// The simulator of systems whose programs are data: `simulator RUN.json`, where the run file has the system and the mechanism that
// starts it.
#include "cutjoint/interpreter/system.hpp"
#include "cutjoint/program.hpp"

int main(int argc, char** argv) {
  return cutjoint::run_program(argc, argv, "simulator", [](const cutjoint::Json& file) {
    const cutjoint::Json& model = file.at("model");
    cutjoint::interpreter::InterpretedMechanism start(model.at("start"));
    cutjoint::interpreter::InterpretedSystem system(model, start.description());
    return cutjoint::perform(file, start, system);
  });
}
