// A run inside a program that has read its run file: what drivers do with mechanisms and systems.
#pragma once

#include "cutjoint/json.hpp"
#include "cutjoint/mechanism.hpp"

namespace cutjoint {

template <class Real>
class AnySystem;

/// Do the task of a run file and return its summary: `start` finds where the run begins, and `mechanism` goes on.
Json perform(const Json& file, AnyMechanism<double>& start, AnyMechanism<Precision>& mechanism);

/// Do the task of a run file by a Lagrangian method.
Json perform(const Json& file, AnyMechanism<double>& start, AnySystem<Precision>& system);

}  // namespace cutjoint
