// The interface of the driver: it takes generated mechanisms and systems as their base classes, so that one driver serves all models.
#pragma once

#include "cutjoint/any_mechanism.hpp"

namespace cutjoint {

template <class Real>
class AnySystem;

/// The program of a simulator: `simulator RUN.json` reads the run file, does its task and prints a summary.
/// The exit status is that of `run_program`.
///
/// `start` finds the initial state in relative coordinates (its report is not used), `mechanism` continues from there.
int run_main(int argc, char** argv, AnyMechanism<double>& start, AnyMechanism<Precision>& mechanism);

/// The program of a simulator by a Lagrangian method, which continues with a system in natural coordinates.
int run_main(int argc, char** argv, AnyMechanism<double>& start, AnySystem<Precision>& system);

}  // namespace cutjoint
