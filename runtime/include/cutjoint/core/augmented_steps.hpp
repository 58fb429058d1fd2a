// Steps of a simulation by the method augmented.
#pragma once

#include "cutjoint/core/newton/augmented.hpp"
#include "cutjoint/core/newton/static_solver.hpp"
#include "cutjoint/core/newton_steps.hpp"

namespace cutjoint {

/// Over a system in natural coordinates, whose tangent is positive definite: any pivot order is safe.
template <class M, class S>
using AugmentedSteps = NewtonSteps<M, S, AugmentedNewton<S, StaticSolver<S>>, StaticSolver<S>>;

}  // namespace cutjoint
