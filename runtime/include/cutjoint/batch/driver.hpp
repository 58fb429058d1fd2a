// The interface of the driver for batches: each thread has generated mechanisms of its own.
#pragma once

#include "cutjoint/any_mechanism.hpp"
#include "cutjoint/batch/real.hpp"

namespace cutjoint::batch {

/// Make mechanisms by `new`; who calls has to delete them.
using MakeAlone = AnyMechanism<double>* (*)();
using MakeInstances = AnyMechanism<Real>* (*)();

/// The program of a batch: `simulator RUN.json` runs the cases of the run file, as many as `width` side by side and as many threads as it
/// says, and prints a line of JSON with how they ended when as many are done.  Exit status 0 when all were tried, 1 when it was interrupted, 2
/// when it could not begin.
int run_main(int argc, char** argv, MakeAlone make_alone, MakeInstances make_instances);

}  // namespace cutjoint::batch
