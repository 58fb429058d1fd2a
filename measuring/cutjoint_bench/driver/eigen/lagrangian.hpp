// Eigen's sparse solvers, added to the driver of the Lagrangian methods; of another number type also with factors in double.
#pragma once

#include "cutjoint/extension.hpp"
#include "cutjoint/lagrangian/eigen_solvers.hpp"
#include "cutjoint/lagrangian/rounded_solver.hpp"
#include "cutjoint/precision.hpp"

namespace cutjoint {

const inline Added eigen(library_solvers<Precision>(), {
                                                           {"eigen-ldlt", true, make_solver<EigenLdlt<Precision>, Precision>},
                                                           {"eigen-lu", false, make_solver<EigenLu<Precision>, Precision>},
                                                       });

template <template <class> class Solver>
constexpr auto make_rounded = make_solver<RoundedSolver<Solver<double>, Precision>, Precision>;

const inline bool has_rounded = [] {
  if (std::is_same_v<Precision, double>) return false;
  Added(library_solvers<Precision>(), {{"double-ldlt", true, make_rounded<EigenLdlt>}, {"double-lu", false, make_rounded<EigenLu>}});
  return true;
}();

}  // namespace cutjoint
