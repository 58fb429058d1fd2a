// A sparse solver of Eigen's for matrices of one pattern.
#pragma once

#include <Eigen/SparseCore>
#include <Eigen/SparseLU>

#include "cutjoint/lagrangian/solver.hpp"

namespace cutjoint {

/// `Solver` with its matrix, whose values come in the order of a pattern.
template <class Real, template <class> class Solver>
class EigenSparse {
 public:
  using Matrix = Eigen::SparseMatrix<Real>;

  void lay_out(const Pattern& pattern) {
    const std::vector<Real> values(pattern.row.size(), Real(1));
    matrix_ = Eigen::Map<const Matrix>(pattern.size, pattern.size, static_cast<Eigen::Index>(values.size()), pattern.first.data(), pattern.row.data(), values.data());
    solution_.resize(pattern.size);
  }

  const Matrix& with(const Real* values) {
    std::copy_n(values, matrix_.nonZeros(), matrix_.valuePtr());
    return matrix_;
  }

  Breakdown solve(Real* x) {
    Eigen::Map<Vector> unknown(x, solution_.size());
    solution_ = solver.solve(unknown);
    unknown = solution_;
    return {};
  }

  const Matrix& matrix() const { return matrix_; }

  Solver<Matrix> solver;

 private:
  using Vector = Eigen::Matrix<Real, Eigen::Dynamic, 1>;

  Matrix matrix_;
  Vector solution_;
};

/// Eigen's L U with pivoting, by its default ordering, COLAMD.
template <class Matrix>
using SparseLu = Eigen::SparseLU<Matrix>;

}  // namespace cutjoint
