// Eigen's sparse solvers: L D L^T of symmetric matrices, L U with partial pivoting of any.
#pragma once

#include <Eigen/SparseCholesky>

#include "cutjoint/lagrangian/eigen_sparse.hpp"

namespace cutjoint {

/// SimplicialLDLT with its default ordering, AMD.
template <class Real>
class EigenLdlt final : public LinearSolver<Real> {
 public:
  void analyse(const Pattern& pattern) override {
    sparse_.lay_out(pattern);
    sparse_.solver.analyzePattern(sparse_.matrix());
  }

  Breakdown factor(const Real* values) override {
    sparse_.solver.factorize(sparse_.with(values));
    return first_not_positive();
  }

  Breakdown solve(Real* x) override { return sparse_.solve(x); }

 private:
  template <class Matrix>
  using SparseLdlt = Eigen::SimplicialLDLT<Matrix, Eigen::Lower>;

  /// The factorisation ends at a pivot of zero and leaves the rest as it was; a negative one is no error to it.
  Breakdown first_not_positive() {
    const auto& pivots = sparse_.solver.vectorD();
    for (Eigen::Index i = 0; i < pivots.size(); ++i)
      if (!(pivots[i] > Real(0))) return {Breakdown::Kind::not_positive, row_of(i)};
    return sparse_.solver.info() == Eigen::Success ? Breakdown{} : Breakdown{Breakdown::Kind::not_positive, -1};
  }

  int row_of(Eigen::Index pivot) const {
    const auto& ordering = sparse_.solver.permutationPinv().indices();
    return ordering.size() > 0 ? ordering[pivot] : static_cast<int>(pivot);
  }

  EigenSparse<Real, SparseLdlt> sparse_;
};

/// SparseLU, which pivots in each factorisation; a symmetric matrix is completed first.
template <class Real>
class EigenLu final : public LinearSolver<Real> {
 public:
  void analyse(const Pattern& pattern) override {
    sparse_.lay_out(pattern);
    symmetric_ = pattern.symmetric;
    sparse_.solver.analyzePattern(completed(sparse_.matrix()));
  }

  Breakdown factor(const Real* values) override {
    sparse_.solver.factorize(completed(sparse_.with(values)));
    return sparse_.solver.info() == Eigen::Success ? Breakdown{} : Breakdown{Breakdown::Kind::singular, -1};
  }

  Breakdown solve(Real* x) override { return sparse_.solve(x); }

 private:
  using Matrix = Eigen::SparseMatrix<Real>;

  Matrix completed(const Matrix& lower) const { return symmetric_ ? Matrix(lower.template selfadjointView<Eigen::Lower>()) : lower; }

  bool symmetric_ = false;
  EigenSparse<Real, SparseLu> sparse_;
};

}  // namespace cutjoint
