// Steps of a simulation by the method classical.
#pragma once

#include "cutjoint/core/newton/classical.hpp"
#include "cutjoint/core/newton/dense_solver.hpp"
#include "cutjoint/core/newton/guarded_solver.hpp"
#include "cutjoint/core/newton_steps.hpp"

namespace cutjoint {

/// Over a system in natural coordinates with its multipliers; where the fixed pivot order is unsafe, rows are exchanged.
template <class M, class S>
using ClassicalSteps = NewtonSteps<M, S, ClassicalNewton<S, GuardedSolver<S, DenseSolver<S>>>, GuardedSolver<S, DenseSolver<S>>>;

}  // namespace cutjoint
