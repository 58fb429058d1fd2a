// Compares the dense kernels of the core with Eigen's on random matrices; prints a line for each with the largest differences.
#include "cutjoint/core/numbers/dense.hpp"

#include <Eigen/Dense>
#include <complex>
#include <cstdio>
#include <vector>

#include "cutjoint/core/newton/complex_solver.hpp"
#include "cutjoint/core/newton/guarded_solver.hpp"

using Matrix = Eigen::MatrixXd;
using Vector = Eigen::VectorXd;

namespace {

#ifdef WHOLE  // takes the compiler two thirds of its time
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

#endif

/// What a solver needs to know of a system: the places of a matrix of which some entries are left out.
struct System {
  using real_type = double;

  struct Pattern {
    int size;
    std::vector<int> first{0}, row{};
  };
  struct Description {
    Pattern pattern;
    int factors = 0;
  };

  const Description& description() const { return description_; }

  Description description_;
};

/// A complex matrix with the places of a real one and its values as real parts.
void compare_complex(const System& system, const Matrix& A, const std::vector<double>& re) {
  Eigen::MatrixXcd both = A.cast<std::complex<double>>();
  std::vector<double> im;
  const auto& [size, first, row] = system.description().pattern;
  for (int j = 0; j < size; ++j)
    for (int k = first[static_cast<std::size_t>(j)]; k < first[static_cast<std::size_t>(j) + 1]; ++k) {
      im.push_back(Vector::Random(1)(0));
      both(row[static_cast<std::size_t>(k)], j) += std::complex<double>(0.0, im.back());
    }
  cutjoint::ComplexSolver<System> solver(system);
  const Eigen::VectorXcd b = Eigen::VectorXcd::Random(size);
  Vector x = b.real(), y = b.imag();
  const bool broken = static_cast<bool>(solver.factor(re.data(), im.data()));
  if (!broken) solver.solve(x.data(), y.data());
  const Eigen::VectorXcd z = x.cast<std::complex<double>>() + std::complex<double>(0.0, 1.0) * y.cast<std::complex<double>>();
  const Eigen::FullPivLU<Eigen::MatrixXcd> known(both);
  std::printf("complex %d %d %.3e\n", broken, !known.isInvertible(), broken ? 0.0 : (both * z - b).norm() / (both.norm() * z.norm()));
}

/// `zeros` is the share of the entries that are left out, those of the diagonal first.
void compare_solutions(Eigen::Index n, double zeros) {
  Matrix A = Matrix::Random(n, n);
  const Vector b = Vector::Random(n);
  System system{{{static_cast<int>(n)}}};
  std::vector<double> values;
  auto& pattern = system.description_.pattern;
  for (Eigen::Index j = 0; j < n; ++j) {
    for (Eigen::Index i = 0; i < n; ++i) {
      if (zeros > 0.0 && (i == j || std::rand() < zeros * RAND_MAX)) A(i, j) = 0.0;
      if (A(i, j) == 0.0) continue;
      pattern.row.push_back(static_cast<int>(i));
      values.push_back(A(i, j));
    }
    pattern.first.push_back(static_cast<int>(values.size()));
  }
  cutjoint::DenseSolver<System> solver(system);
  solver.prepare();
  Vector x = b;
  const bool broken = static_cast<bool>(solver.factor(values.data()));
  if (!broken) solver.solve(x.data());
  const Eigen::FullPivLU<Matrix> known(A);
  std::printf("solution %d %d %.3e\n", broken, !known.isInvertible(), broken ? 0.0 : (A * x - b).norm() / (A.norm() * x.norm()));
  compare_complex(system, A, values);
}

}  // namespace

int main() {
  std::srand(1);
#ifdef WHOLE
  for (const auto& [rows, columns] : {std::pair<Eigen::Index, Eigen::Index>{1, 1}, {3, 3}, {2, 7}, {7, 2}, {12, 20}, {40, 31}})
    for (Eigen::Index rank = 0; rank <= std::min(rows, columns); rank += 1 + rank / 3) compare_squares(rows, columns, rank);
  for (const Eigen::Index n : {1, 2, 5, 30}) compare_eigenvalues(n, n), compare_eigenvalues(n, (n + 1) / 2);
#endif
  for (const Eigen::Index n : {1, 2, 3, 8, 40})
    for (const double zeros : {0.0, 0.3}) compare_solutions(n, zeros);
}
