// The solvers of the plain driver.
#include "cutjoint/lagrangian/eigen_solvers.hpp"

namespace {

using cutjoint::make_solver;

constexpr cutjoint::SolverKind kinds[] = {
    {"eigen-ldlt", true, make_solver<cutjoint::EigenLdlt<double>>},
    {"eigen-lu", false, make_solver<cutjoint::EigenLu<double>>},
};

}  // namespace

std::span<const cutjoint::SolverKind> cutjoint::library_solvers() { return kinds; }
