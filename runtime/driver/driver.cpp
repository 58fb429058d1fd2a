#include "cutjoint/driver.hpp"

#include <exception>
#include <iostream>

#include "cutjoint/run.hpp"

int cutjoint::run_main(int argc, char** argv, AnyMechanism<double>& mechanism) {
  try {
    if (argc != 2) throw std::runtime_error("usage: simulator RUN.json");
    return conclude(Run<AnyMechanism<double>>(mechanism, read_json(argv[1])).perform());
  } catch (const std::exception& error) {
    std::cerr << "error: " << error.what() << std::endl;
    return 2;
  }
}
