// The driver's door: generated mechanisms come in through their base class, so that the driver is compiled once for all models.
#pragma once

#include "cutjoint/mechanism.hpp"

namespace cutjoint {

/// The program of a simulator: `simulator RUN.json` reads the run file, does its task and prints a summary.
/// Exit status 0 when done, 1 when the run failed numerically, 2 when it could not begin.
int run_main(int argc, char** argv, AnyMechanism<double>& mechanism);

}  // namespace cutjoint
