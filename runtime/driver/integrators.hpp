// The integrators of the recursive method, compiled once: integrators.cpp has them with the flags of generated code.
#pragma once

#include "cutjoint/core/runge_kutta/scheme.hpp"
#include "cutjoint/core/runge_kutta/tables.hpp"
#include "cutjoint/core/runge_kutta/closed_loop_dynamics.hpp"
#include "cutjoint/core/stepping/trapezoidal.hpp"
#include "cutjoint/integrator_table.hpp"
#include "cutjoint/any_mechanism.hpp"

#ifndef CUTJOINT_INSTANTIATE
#define CUTJOINT_INSTANTIATE extern template
#endif

namespace cutjoint {

using CompiledMechanism = AnyMechanism<Precision>;
using CompiledDynamics = runge_kutta::ClosedLoopDynamics<CompiledMechanism>;

CUTJOINT_INSTANTIATE class Projection<CompiledMechanism>;
CUTJOINT_INSTANTIATE class Trapezoidal<CompiledMechanism>;
CUTJOINT_INSTANTIATE class stepping::IndicatorCells<CompiledMechanism>;
CUTJOINT_INSTANTIATE class Relative<CompiledMechanism>;
CUTJOINT_INSTANTIATE class Relative<CompiledMechanism, runge_kutta::Solved<CompiledMechanism>>;
CUTJOINT_INSTANTIATE class runge_kutta::Solved<CompiledMechanism>;
CUTJOINT_INSTANTIATE class runge_kutta::ClosedLoopDynamics<CompiledMechanism>;
// all of one kind, then of the next: what GCC inlines follows from the order, and with it how products are joined to sums
#define CUTJOINT_FORMULA(name, table) CUTJOINT_INSTANTIATE class runge_kutta::Formula<CompiledDynamics, runge_kutta::table>;
#define CUTJOINT_SCHEME(name, table) CUTJOINT_INSTANTIATE class runge_kutta::Scheme<CompiledDynamics, runge_kutta::table>;
#define CUTJOINT_STEPPER(name, table) CUTJOINT_INSTANTIATE class stepping::Stepper<runge_kutta::Scheme<CompiledDynamics, runge_kutta::table>>;
CUTJOINT_EXPLICIT_INTEGRATORS(CUTJOINT_FORMULA)
CUTJOINT_EXPLICIT_INTEGRATORS(CUTJOINT_SCHEME)
CUTJOINT_EXPLICIT_INTEGRATORS(CUTJOINT_STEPPER)

}  // namespace cutjoint
