// Factors in double below a balance in another number type, added to the driver of the Lagrangian methods.
#pragma once

#include "cutjoint/extension.hpp"
#include "cutjoint/lagrangian/eigen_solvers.hpp"
#include "cutjoint/lagrangian/rounded_solver.hpp"
#include "cutjoint/precision.hpp"

namespace cutjoint {

template <template <class> class Solver>
constexpr auto make_rounded = make_solver<RoundedSolver<Solver<double>, Precision>, Precision>;

const inline Added rounded(library_solvers<Precision>(), {
                                                             {"double-ldlt", true, make_rounded<EigenLdlt>},
                                                             {"double-lu", false, make_rounded<EigenLu>},
                                                         });

}  // namespace cutjoint
