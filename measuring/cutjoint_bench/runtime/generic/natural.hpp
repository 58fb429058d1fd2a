// The Lagrangian methods of the generic simulator.
#pragma once

#include "cutjoint/json.hpp"
#include "cutjoint/any_mechanism.hpp"

/// Do the run's task with the system that `model` describes, from where `start` begins, and return the summary.
cutjoint::Json run_natural(const cutjoint::Json& model, cutjoint::AnyMechanism<double>& start, const cutjoint::Json& file);
