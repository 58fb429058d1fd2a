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

/// The failure of a singular tangent, with the unresisted coordinate if there is one.
Failure explain_singular(const SystemDescription& d, const auto* tangent, Failure failure) {
  if (const int coordinate = unresisted_coordinate(d, tangent); coordinate >= 0) {
    failure.element = d.coordinates[static_cast<std::size_t>(coordinate)];
    failure.advice = "this coordinate can move without moving mass or meeting an equation: give it mass or hold it";
  } else {
    failure.advice = "equations may depend on each other here; try: another dt, or method augmented, which tolerates redundant and momentarily dependent equations";
  }
  return failure;
}

/// The failure of a pivot that is not positive distinguishes an unresisted motion, whose pivot is rounding, from negative stiffness.
Failure explain_not_positive(const SystemDescription& d, const auto* tangent, Failure failure) {
  const int coordinate = unresisted_coordinate(d, tangent);
  if (coordinate < 0) return failure;
  failure.element = d.coordinates[static_cast<std::size_t>(coordinate)];
  failure.advice =
      "in this pose the coordinate can move without moving mass or meeting an equation, as of a massless body in line with what it moves: give that body "
      "mass and inertia, or start from another pose";
  return failure;
}

/// A failure of Newton's iteration, explained by the last tangent if that has no factors.
Failure explain_tangent(const SystemDescription& d, const Fault& fault, const auto* tangent, const Failure& failure) {
  if (fault.cause == Cause::tangent_not_positive && d.method != Lagrangian::classical) return explain_not_positive(d, tangent, failure);
  if (d.method != Lagrangian::classical) return failure;
  if (fault.cause == Cause::tangent_singular) return explain_singular(d, tangent, failure);
  if (fault.cause != Cause::pose_singular) return failure;
  return Failure("classical: the pose is singular, or nearly: rates that satisfy the equations are a leap away", failure.time, failure.step,
                 failure.element, failure.residual,
                 "look for loops whose equations depend on each other there, or a massless body in line with what it moves; try: another dt, or method "
                 "augmented, which leaves such directions alone");
}

}  // namespace cutjoint
