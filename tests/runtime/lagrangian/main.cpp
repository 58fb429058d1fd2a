// The simulator of a system of points, which is the model of the run file.
#include "cutjoint/driver.hpp"
#include "nothing.hpp"
#include "point_system.hpp"

int main(int argc, char** argv) {
  points::Nothing start;
  points::PointSystem system(cutjoint::read_json(argv[1]).at("model"));
  return cutjoint::run_main(argc, argv, start, system);
}
