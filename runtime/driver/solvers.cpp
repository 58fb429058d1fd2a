// The solvers of the plain driver.
#include <type_traits>

#include "cutjoint/lagrangian/eigen_solvers.hpp"
#include "cutjoint/lagrangian/rounded_solver.hpp"

namespace {

using cutjoint::make_solver;
using Real = cutjoint::Precision;

/// The solvers of the number type; then, where it is not double, the solvers in double.
constexpr cutjoint::SolverKind<Real> kinds[] = {
    {"eigen-ldlt", true, make_solver<cutjoint::EigenLdlt<Real>, Real>},
    {"eigen-lu", false, make_solver<cutjoint::EigenLu<Real>, Real>},
    {"double-ldlt", true, make_solver<cutjoint::RoundedSolver<cutjoint::EigenLdlt<double>, Real>, Real>},
    {"double-lu", false, make_solver<cutjoint::RoundedSolver<cutjoint::EigenLu<double>, Real>, Real>},
};

}  // namespace

template <>
std::span<const cutjoint::SolverKind<Real>> cutjoint::library_solvers<Real>() {
  return std::span(kinds).first(std::is_same_v<Real, double> ? 2 : 4);
}
