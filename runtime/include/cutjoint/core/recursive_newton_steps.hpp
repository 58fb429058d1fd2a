// Steps of a simulation by the method recursive-newton.
#pragma once

#include "cutjoint/core/newton/dense_solver.hpp"
#include "cutjoint/core/newton/guarded_solver.hpp"
#include "cutjoint/core/newton/recursive_newton.hpp"
#include "cutjoint/core/newton_steps.hpp"

namespace cutjoint {

/// Over a system in the coordinates of the mechanism M that starts; where the fixed pivot order is unsafe, rows are exchanged.
template <class M, class S>
using RecursiveNewtonSteps = NewtonSteps<M, S, RecursiveNewton<S, GuardedSolver<S, DenseSolver<S>>>, GuardedSolver<S, DenseSolver<S>>>;

}  // namespace cutjoint
