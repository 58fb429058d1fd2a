// The simulator of a system of points, which the run file defines.
#include "cutjoint/driver.hpp"
#include "nothing.hpp"
#include "point_system.hpp"

int main(int argc, char** argv) {
  points::Nothing start;
  points::PointSystem system(cutjoint::read_json(argv[1]).at("system"));
  return cutjoint::run_main(argc, argv, start, system);
}
