// The solvers of the driver.
#include "cutjoint/lagrangian/eigen_solvers.hpp"

using Real = cutjoint::Precision;

template <>
std::vector<cutjoint::SolverKind<Real>>& cutjoint::library_solvers<Real>() {
  static std::vector<SolverKind<Real>> kinds{{"eigen-ldlt", true, make_solver<EigenLdlt<Real>, Real>}, {"eigen-lu", false, make_solver<EigenLu<Real>, Real>}};
  return kinds;
}
