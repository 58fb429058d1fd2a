// Compares the dense kernels of the core with Eigen's on random matrices; prints a line for each with the largest differences.
#include "cutjoint/core/dense.hpp"

#include <Eigen/Dense>
#include <cstdio>
#include <vector>

using Matrix = Eigen::MatrixXd;
using Vector = Eigen::VectorXd;

namespace {

/// A random matrix of a rank.
Matrix random(Eigen::Index rows, Eigen::Index columns, Eigen::Index rank) {
  return Matrix::Random(rows, rank) * Matrix::Random(rank, columns);
}

void compare_squares(Eigen::Index rows, Eigen::Index columns, Eigen::Index rank) {
  const Matrix A = random(rows, columns, rank);
  const Vector b = Vector::Random(rows);
  Eigen::CompleteOrthogonalDecomposition<Matrix> known;
  known.setThreshold(1e-7);
  known.compute(A);
  Matrix overwritten = A;
  Vector right = b, x(columns), room(columns), left(columns), beside(columns);
  std::vector<std::size_t> order(static_cast<std::size_t>(columns));
  cutjoint::dense::LeastSquares<double> squares({overwritten.data(), static_cast<std::size_t>(rows), static_cast<std::size_t>(columns)},
                                                order.data(), left.data(), beside.data());
  squares.decompose(1e-7);
  squares.solve(right.data(), x.data(), room.data());
  std::printf("squares %td %zu %.3e\n", known.rank(), squares.rank(), (x - known.solve(b)).norm() / (1 + x.norm()));
}

void compare_eigenvalues(Eigen::Index n, Eigen::Index rank) {
  const Matrix half = random(n, n, rank), A = half + half.transpose();
  Matrix values = A, vectors(n, n);
  cutjoint::dense::diagonalise<double>({values.data(), static_cast<std::size_t>(n), static_cast<std::size_t>(n)},
                                       {vectors.data(), static_cast<std::size_t>(n), static_cast<std::size_t>(n)});
  Vector own = values.diagonal();
  const double rebuilt = (vectors * own.asDiagonal() * vectors.transpose() - A).norm() / A.norm();
  std::sort(own.begin(), own.end());
  const Eigen::SelfAdjointEigenSolver<Matrix> known(A);
  std::printf("eigenvalues %.3e %.3e\n", (own - known.eigenvalues()).norm() / A.norm(), rebuilt);
}

}  // namespace

int main() {
  std::srand(1);
  for (const auto& [rows, columns] : {std::pair<Eigen::Index, Eigen::Index>{1, 1}, {3, 3}, {2, 7}, {7, 2}, {12, 20}, {40, 31}})
    for (Eigen::Index rank = 0; rank <= std::min(rows, columns); rank += 1 + rank / 3) compare_squares(rows, columns, rank);
  for (const Eigen::Index n : {1, 2, 5, 30}) compare_eigenvalues(n, n), compare_eigenvalues(n, (n + 1) / 2);
}
