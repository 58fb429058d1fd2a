// Causes of a singular tangent of a Lagrangian method: dependent equations, or an unconstrained motion without mass and stiffness.  Dense, only for the
// message of a failure.
#pragma once

#include <Eigen/Dense>

#include "cutjoint/lagrangian/any_system.hpp"
#include "cutjoint/state.hpp"

namespace cutjoint {

/// Equations whose Jacobian rows depend on others, and those others.
struct Dependence {
  std::vector<int> dependent;
  std::vector<int> on;
};

template <class Real>
using DenseMatrix = Eigen::Matrix<Real, Eigen::Dynamic, Eigen::Dynamic>;

/// The transposed Jacobian of the equations, (n, m), from the values of a classical tangent; each column has length 1 unless it is zero.
template <class Real>
DenseMatrix<Real> transposed_jacobian(const SystemDescription& d, const Real* tangent) {
  const auto n = static_cast<int>(d.coordinates.size()), m = static_cast<int>(d.equations.size());
  DenseMatrix<Real> J = DenseMatrix<Real>::Zero(n, m);
  for (int column = 0; column < n; ++column)
    for (int i = d.pattern.first[static_cast<std::size_t>(column)]; i < d.pattern.first[static_cast<std::size_t>(column) + 1]; ++i)
      if (const int row = d.pattern.row[static_cast<std::size_t>(i)]; row >= n) J(column, row - n) = tangent[i];
  for (int equation = 0; equation < m; ++equation)
    if (const Real length = J.col(equation).norm(); length > Real(0)) J.col(equation) /= length;
  return J;
}

/// A Householder factorisation with column pivoting sorts the equations: the first `rank` span all, with coefficients by the triangle.
template <class Real>
Dependence find_dependence(const DenseMatrix<Real>& transposed) {
  Dependence found;
  if (transposed.size() == 0) return found;
  Eigen::ColPivHouseholderQR<DenseMatrix<Real>> qr;
  qr.setThreshold(Real(1e-7));
  qr.compute(transposed);
  const Eigen::Index rank = qr.rank(), m = transposed.cols();
  const auto& order = qr.colsPermutation().indices();
  for (Eigen::Index i = rank; i < m; ++i) found.dependent.push_back(order[i]);
  const DenseMatrix<Real> share =
      qr.matrixQR().topLeftCorner(rank, rank).template triangularView<Eigen::Upper>().solve(qr.matrixQR().topRightCorner(rank, m - rank));
  for (Eigen::Index i = 0; i < rank; ++i)
    if (rank < m && share.row(i).cwiseAbs().maxCoeff() > Real(1e-6)) found.on.push_back(order[i]);
  std::sort(found.dependent.begin(), found.dependent.end());
  std::sort(found.on.begin(), found.on.end());
  return found;
}

/// The coordinate that moves most in a null motion of the tangent allowed by the equations; -1 if there is none.
template <class Real>
int unresisted_coordinate(const SystemDescription& d, const Real* tangent) {
  const auto n = static_cast<Eigen::Index>(d.coordinates.size());
  DenseMatrix<Real> K = DenseMatrix<Real>::Zero(d.pattern.size, d.pattern.size);
  for (int column = 0; column < d.pattern.size; ++column)
    for (int i = d.pattern.first[static_cast<std::size_t>(column)]; i < d.pattern.first[static_cast<std::size_t>(column) + 1]; ++i) {
      const int row = d.pattern.row[static_cast<std::size_t>(i)];
      K(row, column) = tangent[i];
      if (d.pattern.symmetric) K(column, row) = tangent[i];
    }
  for (Eigen::Index i = 0; i < K.rows(); ++i)
    if (const Real largest = K.row(i).cwiseAbs().maxCoeff(); largest > Real(0)) K.row(i) /= largest;
  Eigen::FullPivLU<DenseMatrix<Real>> lu(K);
  lu.setThreshold(Real(1e-12));
  if (lu.isInvertible()) return -1;
  Eigen::Index coordinate = 0;
  const Real moved = lu.kernel().topRows(n).rowwise().norm().maxCoeff(&coordinate);
  return moved > Real(0) ? static_cast<int>(coordinate) : -1;
}

/// A few names, and the number of the others.
inline std::string listed(const std::vector<int>& indices, const List<const char*>& names) {
  constexpr std::size_t most = 6;
  std::string text;
  for (std::size_t i = 0; i < std::min(indices.size(), most); ++i)
    text.append(i > 0 ? ", " : "").append("'").append(names[static_cast<std::size_t>(indices[i])]).append("'");
  return indices.size() > most ? text + " and " + std::to_string(indices.size() - most) + " more" : text;
}

/// The failure of a singular tangent, with the dependent equations or the unresisted coordinate.
Failure explain_singular(const SystemDescription& d, const auto* tangent, Failure failure) {
  const Dependence found = find_dependence(transposed_jacobian(d, tangent));
  if (!found.dependent.empty()) {
    const bool one = found.dependent.size() == 1;
    const std::string names = listed(found.dependent, d.equations), others = listed(found.on, d.equations);
    failure.element = d.equations[static_cast<std::size_t>(found.dependent.front())];
    failure.advice = (one ? "equation " : "the equations ") + names + (one ? " depends" : " depend") +
                     (others.empty() ? " on no coordinate" : " on ") + others +
                     " here; try: method augmented, which tolerates redundant and momentarily dependent equations";
  } else if (const int coordinate = unresisted_coordinate(d, tangent); coordinate >= 0) {
    failure.element = d.coordinates[static_cast<std::size_t>(coordinate)];
    failure.advice = "this coordinate can move without moving mass or meeting an equation: give it mass or hold it";
  } else {
    failure.advice = "try: another dt, or method augmented, whose tangent stays regular";
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
