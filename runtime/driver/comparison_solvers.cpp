// The solvers of the driver for comparisons: those of the plain one, and SuiteSparse's.
#include "cutjoint/lagrangian/eigen_solvers.hpp"
#include "cutjoint/lagrangian/suitesparse_solvers.hpp"

namespace {

using cutjoint::make_solver;

constexpr cutjoint::SolverKind<double> kinds[] = {
    {"eigen-ldlt", true, make_solver<cutjoint::EigenLdlt<double>, double>},
    {"eigen-lu", false, make_solver<cutjoint::EigenLu<double>, double>},
    {"cholmod", true, make_solver<cutjoint::Cholmod, double>},
    {"klu", false, make_solver<cutjoint::Klu, double>},
    {"umfpack", false, make_solver<cutjoint::Umfpack, double>},
};

}  // namespace

template <>
std::span<const cutjoint::SolverKind<double>> cutjoint::library_solvers<double>() {
  return kinds;
}
