// The solvers of the driver for comparisons: those of the plain one, and SuiteSparse's.
#include "cutjoint/lagrangian/eigen_solvers.hpp"
#include "cutjoint/lagrangian/suitesparse_solvers.hpp"

namespace {

using cutjoint::make_solver;

constexpr cutjoint::SolverKind kinds[] = {
    {"eigen-ldlt", true, make_solver<cutjoint::EigenLdlt<double>>},
    {"eigen-lu", false, make_solver<cutjoint::EigenLu<double>>},
    {"cholmod", true, make_solver<cutjoint::Cholmod>},
    {"klu", false, make_solver<cutjoint::Klu>},
    {"umfpack", false, make_solver<cutjoint::Umfpack>},
};

}  // namespace

std::span<const cutjoint::SolverKind> cutjoint::library_solvers() { return kinds; }
