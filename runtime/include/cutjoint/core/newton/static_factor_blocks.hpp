// Sparse L U with static pivots, by tiles of up to four pivots: the blocks that generated factorisations are made of.  L D L^T is L U with
// U = D L^T.
//
// One array holds the factors: the reciprocals of all pivots, then for each tile its diagonal block, its blocks of U and its blocks of L.
// A block of a tile with w pivots is w columns of four reals, the last of them zero where the other tile is smaller than four:
//
// - the diagonal block has the unit lower triangle L, the upper triangle U and the reciprocals of the pivots, by columns,
// - a block of L has the rows of the tile below it in a column,
// - a block of U is transposed: it has the columns of the tile right of it in a column.
//
// Source: Davis, Direct Methods for Sparse Linear Systems (2006), chapters 4 and 6.  Next to nothing is included, since each part of a
// generated factorisation is compiled by itself.
#pragma once

namespace cutjoint::static_factor {

/// Four reals side by side: what takes the place of a register where a type has none.
template <class Real>
struct FourPlain {
  Real value[4];

  Real& operator[](int i) { return value[i]; }
  const Real& operator[](int i) const { return value[i]; }
  friend FourPlain operator+(const FourPlain& a, const FourPlain& b) { return {{a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3]}}; }
  friend FourPlain operator-(const FourPlain& a, const FourPlain& b) { return {{a[0] - b[0], a[1] - b[1], a[2] - b[2], a[3] - b[3]}}; }
  friend FourPlain operator*(const FourPlain& a, const FourPlain& b) { return {{a[0] * b[0], a[1] * b[1], a[2] * b[2], a[3] * b[3]}}; }
  friend FourPlain operator*(const FourPlain& a, const Real& b) { return {{a[0] * b, a[1] * b, a[2] * b, a[3] * b}}; }
  FourPlain& operator+=(const FourPlain& b) { return *this = *this + b; }
  FourPlain& operator-=(const FourPlain& b) { return *this = *this - b; }
  FourPlain& operator*=(const Real& b) { return *this = *this * b; }
};

/// Four reals in one register, and the same anywhere in an array.  One specialisation a type, since GCC takes no dependent element type.
template <class Real>
struct FourReals {
  using type = FourPlain<Real>;
  using loose = FourPlain<Real>;
};

template <>
struct FourReals<double> {
  typedef double type __attribute__((vector_size(32)));
  typedef double loose __attribute__((vector_size(32), aligned(8), may_alias));
};

template <>
struct FourReals<float> {
  typedef float type __attribute__((vector_size(16)));
  typedef float loose __attribute__((vector_size(16), aligned(4), may_alias));
};

template <class Real>
using Four = typename FourReals<Real>::type;

template <class Real>
using Loose = typename FourReals<Real>::loose;

/// A block in registers: `columns` columns of four rows.
template <class Real, int columns>
struct Tile {
  Four<Real> column[columns];
};

/// Keeps the compiler from carrying values of earlier blocks along on the stack: they are in the array.
[[gnu::always_inline]] inline void next_block() { asm volatile("" ::: "memory"); }

template <class Real, int columns>
[[gnu::always_inline]] inline void load(Tile<Real, columns>& t, const Real* place) {
  for (int j = 0; j < columns; ++j) t.column[j] = *reinterpret_cast<const Loose<Real>*>(place + 4 * j);
}

template <class Real, int columns>
[[gnu::always_inline]] inline void keep(const Tile<Real, columns>& t, Real* place) {
  for (int j = 0; j < columns; ++j) *reinterpret_cast<Loose<Real>*>(place + 4 * j) = t.column[j];
}

/// t -= left right^T: what a tile with `pivots` pivots changes in a block.  All are blocks with a pivot a column.
template <int pivots, class Real, int columns>
[[gnu::always_inline]] inline void subtract(Tile<Real, columns>& t, const Real* left, const Real* right) {
  for (int k = 0; k < pivots; ++k) {
    const Four<Real> from = *reinterpret_cast<const Loose<Real>*>(left + 4 * k);
    for (int j = 0; j < columns; ++j) t.column[j] -= from * right[4 * k + j];
  }
}

/// Factor a diagonal block and keep it, its reciprocals in two places.
template <class Real, int pivots>
[[gnu::always_inline]] inline void find_pivots(const Tile<Real, pivots>& t, Real* diagonal, Real* reciprocals) {
  Real a[pivots][pivots];
  for (int j = 0; j < pivots; ++j)
    for (int i = 0; i < pivots; ++i) a[j][i] = t.column[j][i];
  for (int k = 0; k < pivots; ++k) {
    const Real reciprocal = Real(1) / a[k][k];
    for (int i = k + 1; i < pivots; ++i) {
      const Real l = a[k][i] * reciprocal;
      for (int j = k + 1; j < pivots; ++j) a[j][i] -= l * a[j][k];
      a[k][i] = l;
    }
    a[k][k] = reciprocals[k] = reciprocal;
  }
  for (int j = 0; j < pivots; ++j)
    for (int i = 0; i < pivots; ++i) diagonal[4 * j + i] = a[j][i];
}

/// A block of U from what is left of the matrix: L^-1 t, which is transposed.
template <class Real, int pivots>
[[gnu::always_inline]] inline void solve_lower(Tile<Real, pivots>& t, const Real* diagonal) {
  for (int k = 0; k < pivots; ++k)
    for (int j = k + 1; j < pivots; ++j) t.column[j] -= t.column[k] * diagonal[4 * k + j];
}

/// A block of L from what is left of the matrix: t U^-1.
template <class Real, int pivots>
[[gnu::always_inline]] inline void solve_upper(Tile<Real, pivots>& t, const Real* diagonal) {
  for (int j = 0; j < pivots; ++j) {
    for (int k = 0; k < j; ++k) t.column[j] -= t.column[k] * diagonal[4 * j + k];
    t.column[j] *= diagonal[4 * j + j];
  }
}

/// Keep a block of L, which is D^-1 times the block t of U where the matrix is symmetric.
template <class Real, int pivots>
[[gnu::always_inline]] inline void keep_scaled(const Tile<Real, pivots>& t, const Real* diagonal, Real* place) {
  Tile<Real, pivots> scaled;
  for (int j = 0; j < pivots; ++j) scaled.column[j] = t.column[j] * diagonal[4 * j + j];
  keep(scaled, place);
}

/// The row and column of a pivot, and its place in a vector that has four reals a tile.
struct Pivot {
  int row;
  int column;
  int place;
};

/// The row of the first of n pivots that is unusable, or -1: they have to be positive where the matrix is symmetric, else finite and not
/// zero.
template <bool symmetric, class Real>
int find_unusable(const Real* reciprocals, const Pivot* pivots, int n) {
  for (int k = 0; k < n; ++k) {
    const Real r = reciprocals[k];
    const bool usable = r - r == Real(0) && (symmetric ? r > Real(0) : r != Real(0));
    if (!usable) return pivots[k].row;
  }
  return -1;
}

/// t -= L y: what a tile with `pivots` pivots takes from the right-hand side of one after it, in four sums.
template <int pivots, class Real>
[[gnu::always_inline]] inline void subtract_forward(Tile<Real, 4>& t, const Real* lower, const Real* y) {
  for (int k = 0; k < pivots; ++k) t.column[k] -= *reinterpret_cast<const Loose<Real>*>(lower + 4 * k) * y[k];
}

/// t += U y, in four parts of each sum.
template <class Real, int pivots>
[[gnu::always_inline]] inline void add_backward(Tile<Real, pivots>& t, const Real* upper, const Real* y) {
  const Four<Real> known = *reinterpret_cast<const Loose<Real>*>(y);
  for (int k = 0; k < pivots; ++k) t.column[k] += *reinterpret_cast<const Loose<Real>*>(upper + 4 * k) * known;
}

/// a = L^-1 a with the L of a diagonal block.
template <int pivots, class Real>
[[gnu::always_inline]] inline void solve_unit_lower(Real* a, const Real* diagonal) {
  for (int k = 0; k < pivots; ++k)
    for (int i = k + 1; i < pivots; ++i) a[i] -= diagonal[4 * k + i] * a[k];
}

/// y = L^-1 times the sum of t's columns.
template <int pivots, class Real>
[[gnu::always_inline]] inline void finish_forward(const Tile<Real, 4>& t, const Real* diagonal, Real* y) {
  const Four<Real> sum = (t.column[0] + t.column[1]) + (t.column[2] + t.column[3]);
  Real a[4] = {};
  for (int i = 0; i < pivots; ++i) a[i] = sum[i];
  solve_unit_lower<pivots>(a, diagonal);
  for (int i = 0; i < 4; ++i) y[i] = a[i];
}

/// y = U^-1 (y - t), with the sums over t's rows.
template <class Real, int pivots>
[[gnu::always_inline]] inline void finish_backward(const Tile<Real, pivots>& t, const Real* diagonal, Real* y) {
  Real a[pivots];
  for (int k = 0; k < pivots; ++k) {
    const Four<Real>& c = t.column[k];
    a[k] = y[k] - ((c[0] + c[2]) + (c[1] + c[3]));
  }
  for (int k = pivots - 1; k >= 0; --k) {
    a[k] *= diagonal[4 * k + k];
    for (int i = 0; i < k; ++i) a[i] -= diagonal[4 * k + i] * a[k];
  }
  for (int k = 0; k < pivots; ++k) y[k] = a[k];
}

}  // namespace cutjoint::static_factor
