// The Lagrangian methods of the generic simulator.
#pragma once

#include "cutjoint/json.hpp"

/// Do the run's task with the system that `model` describes, and return the summary.
cutjoint::Json run_natural(const cutjoint::Json& model, const cutjoint::Json& file);
