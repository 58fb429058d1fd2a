// Integrators, a row each: `make regenerate` writes this file from INTEGRATORS of compiler/cutjoint/methods.py.
#pragma once

#include <array>
#include <string_view>

/// X(name, table) of those that are `ExplicitSteps` of a table, and X(name, whether steps are as long as errors allow) of `RadauSteps`.
#define CUTJOINT_EXPLICIT_INTEGRATORS(X) X(rk4, ClassicalTable) X(dormand_prince, DormandPrinceTable) X(dop853, Dop853Table)
#define CUTJOINT_RADAU_INTEGRATORS(X) X(radau5, true) X(radau5_fixed, false)

namespace cutjoint {

enum class Integrator { trapezoidal, rk4, dormand_prince, dop853, radau5, radau5_fixed, generalised_alpha, added };

/// The name in run files, and which drivers have it.
struct IntegratorRow {
  std::string_view name;
  bool recursive, lagrangian, generic;
};

/// In the order of `Integrator`, without those that are added.
inline constexpr std::array integrator_rows{
    IntegratorRow{"trapezoidal", true, true, true},
    IntegratorRow{"rk4", true, false, false},
    IntegratorRow{"dormand-prince", true, false, false},
    IntegratorRow{"dop853", true, false, false},
    IntegratorRow{"radau5", false, true, false},
    IntegratorRow{"radau5-fixed", false, true, false},
    IntegratorRow{"generalised-alpha", false, true, false},
};

}  // namespace cutjoint
