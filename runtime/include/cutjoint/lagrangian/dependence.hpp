// Causes of a singular tangent of a Lagrangian method: an unconstrained motion without mass and stiffness, else dependent equations.  Dense, only for
// the message of a failure.
#pragma once

#include <Eigen/Dense>

#include "cutjoint/lagrangian/any_system.hpp"
#include "cutjoint/state.hpp"

namespace cutjoint {

/// The coordinate that moves most in a null motion of the tangent allowed by the equations; -1 if there is none.
template <class Real>
int unresisted_coordinate(const SystemDescription& d, const Real* tangent) {
  const auto n = static_cast<Eigen::Index>(d.coordinates.size());
  Eigen::Matrix<Real, Eigen::Dynamic, Eigen::Dynamic> K = decltype(K)::Zero(d.pattern.size, d.pattern.size);
  for (int column = 0; column < d.pattern.size; ++column)
    for (int i = d.pattern.first[static_cast<std::size_t>(column)]; i < d.pattern.first[static_cast<std::size_t>(column) + 1]; ++i) {
      const int row = d.pattern.row[static_cast<std::size_t>(i)];
      K(row, column) = tangent[i];
      if (d.pattern.symmetric) K(column, row) = tangent[i];
    }
  for (Eigen::Index i = 0; i < K.rows(); ++i)
    if (const Real largest = K.row(i).cwiseAbs().maxCoeff(); largest > Real(0)) K.row(i) /= largest;
  Eigen::FullPivLU<decltype(K)> lu(K);
  lu.setThreshold(Real(1e-12));
  if (lu.isInvertible()) return -1;
  Eigen::Index coordinate = 0;
  const Real moved = lu.kernel().topRows(n).rowwise().norm().maxCoeff(&coordinate);
  return moved > Real(1e-6) ? static_cast<int>(coordinate) : -1;  // less is rounding beside the multipliers of dependent equations
}

/// A failure of Newton's iteration, explained by the last tangent if that has no factors: with the unresisted coordinate if there is one.
/// This distinguishes an unresisted motion, whose pivot is rounding and so not positive, from negative stiffness.
Failure explain_tangent(const SystemDescription& d, const Fault& fault, const auto* tangent, Failure failure) {
  const bool is_classical = d.method == Lagrangian::classical;
  if (fault.cause == (is_classical ? Cause::tangent_singular : Cause::tangent_not_positive)) {
    if (const int coordinate = unresisted_coordinate(d, tangent); coordinate >= 0) {
      failure.element = d.coordinates[static_cast<std::size_t>(coordinate)];
      failure.advice = is_classical
                           ? "this coordinate can move without moving mass or meeting an equation: give it mass or hold it"
                           : "in this pose the coordinate can move without moving mass or meeting an equation, as of a massless body in line with what "
                             "it moves: give that body mass and inertia, or start from another pose";
    } else if (is_classical) {
      failure.advice = "equations may depend on each other here; try: another dt, or method augmented, which tolerates redundant and momentarily dependent equations";
    }
  }
  if (!is_classical || fault.cause != Cause::pose_singular) return failure;
  return Failure("classical: the pose is singular, or nearly: rates that satisfy the equations are a leap away", failure.time, failure.step,
                 failure.element, failure.residual,
                 "look for loops whose equations depend on each other there, or a massless body in line with what it moves; try: another dt, or method "
                 "augmented, which leaves such directions alone");
}

}  // namespace cutjoint
