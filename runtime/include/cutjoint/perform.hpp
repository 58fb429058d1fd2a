// The task of a run file that has been read, by drivers of mechanisms and systems.
#pragma once

#include "cutjoint/json.hpp"
#include "cutjoint/mechanism.hpp"

namespace cutjoint {

template <class Real>
class AnySystem;

/// Do the task of a run file and return its summary: `start` finds the initial state, `mechanism` continues.
Json perform(const Json& file, AnyMechanism<double>& start, AnyMechanism<Precision>& mechanism);

/// Do the task of a run file by a Lagrangian method.
Json perform(const Json& file, AnyMechanism<double>& start, AnySystem<Precision>& system);

}  // namespace cutjoint
