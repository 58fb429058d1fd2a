// The accurate solution in natural coordinates, added to the driver of the Lagrangian methods.
#pragma once

#include "newton.hpp"

#include "cutjoint/extension.hpp"
#include "cutjoint/lagrangian/choose_solver.hpp"
#include "cutjoint/reference/method.hpp"
#include "cutjoint/run.hpp"

namespace cutjoint::reference {

const inline Added natural(added_integrators<CompiledSystem>(), {{"reference", run_by<NaturalReference<CompiledSystem>, CompiledSystem>}});

}  // namespace cutjoint::reference
