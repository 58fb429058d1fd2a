// Small dense kernels: L U, least squares of least norm, and the eigenvalues of symmetric matrices.  Column-major; all memory is the caller's.
#pragma once

#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>

namespace cutjoint::dense {

/// A matrix in the caller's memory.
template <class Real>
struct Matrix {
  Real* x;
  std::size_t rows, columns;

  Real& operator()(std::size_t i, std::size_t j) const { return x[j * rows + i]; }
  Real* column(std::size_t j) const { return x + j * rows; }
};

/// L U of a square matrix A, rows exchanged for the largest entry of each column (Golub, Van Loan, Matrix Computations, section 3.4).  `order` has an
/// element for each row.
template <class Real>
class Triangles {
 public:
  Triangles(Matrix<Real> A, std::size_t* order) : A_(A), order_(order) {}

  /// Decompose A in place; false if a pivot is zero or not finite.
  bool decompose() {
    for (std::size_t i = 0; i < A_.rows; ++i) order_[i] = i;
    for (std::size_t k = 0; k < A_.rows; ++k) {
      bring_largest(k);
      const Real pivot = A_(k, k);
      if (!(pivot - pivot == Real(0)) || pivot == Real(0)) return false;
      for (std::size_t i = k + 1; i < A_.rows; ++i) A_(i, k) /= pivot;
      for (std::size_t j = k + 1; j < A_.rows; ++j) subtract(k, A_(k, j), A_.column(j));
    }
    return true;
  }

  /// Solve A x = b in place; `room` has as many elements.  A number is real, or a pack of several right-hand sides.
  template <class Number>
  void solve(Number* b, Number* room) const {
    for (std::size_t i = 0; i < A_.rows; ++i) room[i] = b[order_[i]];
    for (std::size_t k = 0; k < A_.rows; ++k) subtract(k, room[k], room);
    for (std::size_t k = A_.rows; k-- > 0;) {
      room[k] /= A_(k, k);
      for (std::size_t i = 0; i < k; ++i) room[i] -= A_(i, k) * room[k];
    }
    for (std::size_t i = 0; i < A_.rows; ++i) b[i] = room[i];
  }

 private:
  /// Exchange rows to bring the largest entry to the pivot; NaN counts as largest.
  void bring_largest(std::size_t k) {
    using std::abs;
    std::size_t largest = k;
    for (std::size_t i = k + 1; i < A_.rows; ++i)
      if (abs(A_(i, k)) > abs(A_(largest, k)) || A_(i, k) != A_(i, k)) largest = i;
    if (largest == k) return;
    std::swap(order_[k], order_[largest]);
    for (std::size_t j = 0; j < A_.rows; ++j) std::swap(A_(k, j), A_(largest, j));
  }

  /// Subtract the multiple of column k of L from the rest of a column.
  template <class Number>
  void subtract(std::size_t k, const Number& factor, Number* column) const {
    const Number share = factor;
    for (std::size_t i = k + 1; i < A_.rows; ++i) column[i] -= A_(i, k) * share;
  }

  Matrix<Real> A_;
  std::size_t* order_;
};

/// A reflection 1 - tau u u^T, u = (1, tail), that takes (head, tail) to (head', 0): head becomes head', the tail u's.  Returns tau.
template <class Real>
Real reflect(Real& head, Real* tail, std::size_t n, std::size_t stride) {
  using std::sqrt;
  Real square(0);
  for (std::size_t i = 0; i < n; ++i) square += tail[i * stride] * tail[i * stride];
  if (!(square > Real(0))) return Real(0);
  const Real length = sqrt(head * head + square), end = head > Real(0) ? -length : length;
  const Real tau = (end - head) / end;
  for (std::size_t i = 0; i < n; ++i) tail[i * stride] /= head - end;
  head = end;
  return tau;
}

/// The matrix A of least squares, decomposed into Q [T 0; 0 0] Z P^T by reflections, those of Q below the diagonal and those of Z beside T
/// (Golub, Van Loan, Matrix Computations, section 5.5).  `order` and both lists of factors have an element for each column.
template <class Real>
class LeastSquares {
 public:
  LeastSquares(Matrix<Real> A, std::size_t* order, Real* left, Real* right) : A_(A), order_(order), left_(left), right_(right) {}

  /// Decompose A in place; pivots below the fraction `threshold` of the largest one count as zero.
  void decompose(Real threshold) {
    for (std::size_t j = 0; j < A_.columns; ++j) order_[j] = j;
    const std::size_t most = A_.rows < A_.columns ? A_.rows : A_.columns;
    Real largest(0);
    for (rank_ = 0; rank_ < most; ++rank_) {
      bring_longest();
      Real* pivot = A_.column(rank_) + rank_;
      left_[rank_] = reflect(*pivot, pivot + 1, A_.rows - rank_ - 1, 1);
      const Real size = magnitude(*pivot);
      if (rank_ == 0) largest = size;
      if (!(size > threshold * largest)) break;
      for (std::size_t j = rank_ + 1; j < A_.columns; ++j) apply(rank_, A_.column(j));
    }
    if (rank_ < A_.columns) clear_beside();
  }

  std::size_t rank() const { return rank_; }

  /// The column at a position of the permutation; those before `rank` are independent.
  std::size_t column_at(std::size_t place) const { return order_[place]; }

  /// The x of least norm that minimises |A x - b|; b is overwritten, `room` has an element for each column.  A number is real, or a pack of several
  /// right-hand sides.
  template <class Number>
  void solve(Number* b, Number* x, Number* room) const {
    for (std::size_t k = 0; k < rank_; ++k) apply(k, b);
    for (std::size_t j = 0; j < A_.columns; ++j) room[j] = j < rank_ ? b[j] : Number{};
    for (std::size_t k = rank_; k-- > 0;) {
      for (std::size_t j = k + 1; j < rank_; ++j) room[k] -= A_(k, j) * room[j];
      room[k] /= A_(k, k);
    }
    for (std::size_t k = 0; k < rank_ && rank_ < A_.columns; ++k) {
      Number sum = room[k];
      for (std::size_t j = rank_; j < A_.columns; ++j) sum += A_(k, j) * room[j];
      sum *= right_[k];
      room[k] -= sum;
      for (std::size_t j = rank_; j < A_.columns; ++j) room[j] -= sum * A_(k, j);
    }
    for (std::size_t j = 0; j < A_.columns; ++j) x[order_[j]] = room[j];
  }

 private:
  static Real magnitude(Real x) { return x < Real(0) ? -x : x; }

  /// Exchange columns to bring the longest remaining one to the pivot.
  void bring_longest() {
    std::size_t longest = rank_;
    Real most(-1);
    for (std::size_t j = rank_; j < A_.columns; ++j) {
      Real square(0);
      for (std::size_t i = rank_; i < A_.rows; ++i) square += A_(i, j) * A_(i, j);
      if (square > most) most = square, longest = j;
    }
    if (longest == rank_) return;
    for (std::size_t i = 0; i < A_.rows; ++i) std::swap(A_(i, rank_), A_(i, longest));
    std::swap(order_[rank_], order_[longest]);
  }

  /// Apply the k-th reflection of Q to a column.
  template <class Number>
  void apply(std::size_t k, Number* column) const {
    const Real* u = A_.column(k);
    Number sum = column[k];
    for (std::size_t i = k + 1; i < A_.rows; ++i) sum += column[i] * u[i];
    sum *= left_[k];
    column[k] -= sum;
    for (std::size_t i = k + 1; i < A_.rows; ++i) column[i] -= sum * u[i];
  }

  /// Reflections from the right eliminate everything beside T.
  void clear_beside() {
    const std::size_t n = A_.columns - rank_;
    for (std::size_t k = rank_; k-- > 0;) {
      right_[k] = reflect(A_(k, k), &A_(k, rank_), n, A_.rows);
      for (std::size_t i = 0; i < k; ++i) {
        Real sum = A_(i, k);
        for (std::size_t j = rank_; j < A_.columns; ++j) sum += A_(i, j) * A_(k, j);
        sum *= right_[k];
        A_(i, k) -= sum;
        for (std::size_t j = rank_; j < A_.columns; ++j) A_(i, j) -= sum * A_(k, j);
      }
    }
  }

  Matrix<Real> A_;
  std::size_t* order_;
  Real *left_, *right_;
  std::size_t rank_ = 0;
};

/// The eigenvalues of a symmetric matrix, which become its diagonal, and the eigenvectors, which become the columns of V, by Jacobi's rotations
/// (Golub, Van Loan, Matrix Computations, section 8.5).
template <class Real>
void diagonalise(Matrix<Real> A, Matrix<Real> V) {
  using std::sqrt;
  const std::size_t n = A.rows;
  for (std::size_t j = 0; j < n; ++j)
    for (std::size_t i = 0; i < n; ++i) V(i, j) = Real(i == j ? 1 : 0);
  for (int sweep = 0; sweep < 60; ++sweep) {
    Real beside(0), on(0);
    for (std::size_t j = 0; j < n; ++j)
      for (std::size_t i = 0; i <= j; ++i) (i == j ? on : beside) += A(i, j) * A(i, j);
    const Real smallest = std::numeric_limits<Real>::epsilon();
    if (!(beside > smallest * smallest * on)) return;
    for (std::size_t q = 1; q < n; ++q)
      for (std::size_t p = 0; p < q; ++p) {
        if (A(p, q) == Real(0)) continue;
        const Real shift = (A(q, q) - A(p, p)) / (2 * A(p, q));
        const Real t = (shift < Real(0) ? Real(-1) : Real(1)) / ((shift < Real(0) ? -shift : shift) + sqrt(Real(1) + shift * shift));
        const Real c = Real(1) / sqrt(Real(1) + t * t), s = t * c;
        const auto rotate = [c, s](Real& x, Real& y) {
          const Real was = x;
          x = c * was - s * y;
          y = s * was + c * y;
        };
        for (std::size_t i = 0; i < n; ++i) rotate(A(i, p), A(i, q));
        for (std::size_t i = 0; i < n; ++i) rotate(A(p, i), A(q, i));
        for (std::size_t i = 0; i < n; ++i) rotate(V(i, p), V(i, q));
      }
  }
}

}  // namespace cutjoint::dense
