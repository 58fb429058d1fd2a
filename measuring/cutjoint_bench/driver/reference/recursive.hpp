// The accurate solution in relative coordinates, and the map of the fixed point, added to the driver of the recursive method.
#pragma once

#include "integrators.hpp"

#include "cutjoint/extension.hpp"
#include "cutjoint/reference/fixed_point_map.hpp"
#include "cutjoint/reference/method.hpp"
#include "cutjoint/run.hpp"

namespace cutjoint::reference {

const inline Added relative(added_integrators<CompiledMechanism>(),
                            {{"reference", run_by<RelativeReference<CompiledMechanism>, CompiledMechanism>},
                             {"fixed-point-map", run_by<FixedPointMap<CompiledMechanism>, CompiledMechanism>}});

}  // namespace cutjoint::reference
