// Eigen's sparse solvers: L D L^T of symmetric matrices, L U with partial pivoting of any.
#pragma once

#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>
#include <Eigen/SparseLU>

#include "cutjoint/lagrangian/solver.hpp"

namespace cutjoint {

/// A sparse matrix of Eigen's with the places of a pattern; its values are still open.
template <class Real>
Eigen::SparseMatrix<Real> make_matrix(const Pattern& pattern) {
  std::vector<Real> values(pattern.row.size(), Real(1));
  return Eigen::Map<const Eigen::SparseMatrix<Real>>(pattern.size, pattern.size, static_cast<Eigen::Index>(pattern.row.size()),
                                                     pattern.first.data(), pattern.row.data(), values.data());
}

/// SimplicialLDLT with its default ordering, AMD.
template <class Real>
class EigenLdlt final : public LinearSolver<Real> {
 public:
  void analyse(const Pattern& pattern) override {
    matrix_ = make_matrix<Real>(pattern);
    solver_.analyzePattern(matrix_);
    solution_.resize(pattern.size);
  }

  Breakdown factor(const Real* values) override {
    std::copy_n(values, matrix_.nonZeros(), matrix_.valuePtr());
    solver_.factorize(matrix_);
    return first_not_positive();
  }

  Breakdown solve(Real* x) override {
    Eigen::Map<Vector> unknown(x, solution_.size());
    solution_ = solver_.solve(unknown);
    unknown = solution_;
    return {};
  }

 private:
  using Vector = Eigen::Matrix<Real, Eigen::Dynamic, 1>;

  /// The factorisation ends at a pivot of zero and leaves the rest as it was; a negative one is no error to it.
  Breakdown first_not_positive() {
    const auto& pivots = solver_.vectorD();
    for (Eigen::Index i = 0; i < pivots.size(); ++i)
      if (!(pivots[i] > Real(0))) return {Breakdown::Kind::not_positive, row_of(i)};
    return solver_.info() == Eigen::Success ? Breakdown{} : Breakdown{Breakdown::Kind::not_positive, -1};
  }

  int row_of(Eigen::Index pivot) const {
    const auto& ordering = solver_.permutationPinv().indices();
    return ordering.size() > 0 ? ordering[pivot] : static_cast<int>(pivot);
  }

  Eigen::SparseMatrix<Real> matrix_;
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<Real>, Eigen::Lower> solver_;
  Vector solution_;
};

/// SparseLU, which pivots in each factorisation, with its default ordering, COLAMD; a symmetric matrix is completed first.
template <class Real>
class EigenLu final : public LinearSolver<Real> {
 public:
  void analyse(const Pattern& pattern) override {
    matrix_ = make_matrix<Real>(pattern);
    symmetric_ = pattern.symmetric;
    solver_.analyzePattern(symmetric_ ? mirrored() : matrix_);
    solution_.resize(pattern.size);
  }

  Breakdown factor(const Real* values) override {
    std::copy_n(values, matrix_.nonZeros(), matrix_.valuePtr());
    solver_.factorize(symmetric_ ? mirrored() : matrix_);
    return solver_.info() == Eigen::Success ? Breakdown{} : Breakdown{Breakdown::Kind::singular, -1};
  }

  Breakdown solve(Real* x) override {
    Eigen::Map<Vector> unknown(x, solution_.size());
    solution_ = solver_.solve(unknown);
    unknown = solution_;
    return {};
  }

 private:
  using Vector = Eigen::Matrix<Real, Eigen::Dynamic, 1>;
  using Matrix = Eigen::SparseMatrix<Real>;

  Matrix mirrored() const { return matrix_.template selfadjointView<Eigen::Lower>(); }

  Matrix matrix_;
  bool symmetric_ = false;
  Eigen::SparseLU<Matrix> solver_;
  Vector solution_;
};

}  // namespace cutjoint
