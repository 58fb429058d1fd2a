// The interface of the driver for batches: each thread has generated mechanisms of its own.
#pragma once

#include <functional>
#include <memory>

#include "cutjoint/batch/real.hpp"
#include "cutjoint/mechanism.hpp"

namespace cutjoint::batch {

using MakeAlone = std::function<std::unique_ptr<AnyMechanism<double>>()>;
using MakeInstances = std::function<std::unique_ptr<AnyMechanism<Real>>()>;

/// The program of a batch: `simulator RUN.json` runs the cases of the run file, as many as `width` side by side and as many threads as it
/// says, and prints a line of JSON with how they ended when as many are done.  Exit status 0 when all were tried, 1 when it was interrupted, 2
/// when it could not begin.
int run_main(int argc, char** argv, const MakeAlone& make_alone, const MakeInstances& make_instances);

}  // namespace cutjoint::batch
