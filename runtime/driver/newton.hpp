// The integrators of the methods with Newton's iteration, compiled once: newton.cpp has them with the flags of generated code.
#pragma once

#include "cutjoint/core/newton/recursive_newton.hpp"
#include "cutjoint/core/newton/classical.hpp"
#include "cutjoint/lagrangian/solver.hpp"

#ifndef CUTJOINT_INSTANTIATE
#define CUTJOINT_INSTANTIATE extern template
#endif

namespace cutjoint {

using CompiledSystem = AnySystem<Precision>;
using CompiledSolver = ChosenSolver<CompiledSystem>;
using CompiledAugmented = AugmentedNewton<CompiledSystem, CompiledSolver>;
using CompiledClassical = ClassicalNewton<CompiledSystem, CompiledSolver>;
using CompiledRecursive = RecursiveNewton<CompiledSystem, CompiledSolver>;

CUTJOINT_INSTANTIATE class DenseSolver<CompiledSystem>;
CUTJOINT_INSTANTIATE class GuardedSolver<CompiledSystem, DenseSolver<CompiledSystem>>;
CUTJOINT_INSTANTIATE class Newton<CompiledAugmented, CompiledSystem, CompiledSolver>;
CUTJOINT_INSTANTIATE class AugmentedBase<CompiledAugmented, CompiledSystem, CompiledSolver>;
CUTJOINT_INSTANTIATE class AugmentedNewton<CompiledSystem, CompiledSolver>;
CUTJOINT_INSTANTIATE class Newton<CompiledRecursive, CompiledSystem, CompiledSolver>;
CUTJOINT_INSTANTIATE class AugmentedBase<CompiledRecursive, CompiledSystem, CompiledSolver>;
CUTJOINT_INSTANTIATE class RecursiveNewton<CompiledSystem, CompiledSolver>;
CUTJOINT_INSTANTIATE class Newton<CompiledClassical, CompiledSystem, CompiledSolver>;
CUTJOINT_INSTANTIATE class ClassicalNewton<CompiledSystem, CompiledSolver>;

}  // namespace cutjoint
