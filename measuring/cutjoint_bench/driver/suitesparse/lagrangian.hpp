// The solvers of SuiteSparse, added to a driver in double.
#pragma once

#include "cutjoint/extension.hpp"
#include "cutjoint/lagrangian/suitesparse_solvers.hpp"

namespace cutjoint {

const inline Added suitesparse(library_solvers<double>(), {
                                                              {"cholmod", true, make_solver<Cholmod, double>},
                                                              {"klu", false, make_solver<Klu, double>},
                                                              {"umfpack", false, make_solver<Umfpack, double>},
                                                          });

}  // namespace cutjoint
