// The simulator of a system of points, which is the model of the run file.
#include "cutjoint/driver.hpp"
#include "examine.hpp"
#include "nothing.hpp"
#include "point_system.hpp"

int main(int argc, char** argv) {
  points::Nothing start;
  const cutjoint::Json file = cutjoint::read_json(argv[1]);
  points::PointSystem system(file.at("model"));
  if (cutjoint::examine::is_asked(file)) return cutjoint::examine::run_main(argc, argv, start, system);
  return cutjoint::run_main(argc, argv, start, system);
}
