// A factorisation as index data, for systems whose straight-line code would be too long; static_factor_blocks.hpp describes the storage of
// factors.
#pragma once

#include "cutjoint/core/newton/static_factor_blocks.hpp"

namespace cutjoint::static_factor {

/// One tile: its positions in the array of factors, and its numbers of blocks of U and L and of sweeps.
struct Step {
  int pivots;
  int diagonal;
  int reciprocals;
  int uppers;
  int lowers;
  int sweeps;
};

/// Subtracts from each of `blocks` blocks of `columns` columns the product of a block and that at `multipliers`; the former are neighbours,
/// from `source` on.
struct Sweep {
  int columns;
  int source;
  int multipliers;
  int blocks;
};

/// The position of a value of the matrix.
struct Entry {
  int value;
  int place;
};

/// A constant array.
template <class Item>
struct Table {
  const Item* first;
  int count;

  template <int n>
  constexpr Table(const Item (&items)[n]) : first(items), count(n) {}
  const Item* begin() const { return first; }
  const Item* end() const { return first + count; }
};

/// A factorisation as data.  `targets` has the positions of all sweeps' blocks, `others` for each tile those of the tiles right of it, then
/// below it, in a vector with four reals per tile.
struct Tables {
  Table<Step> steps;
  Table<Sweep> sweeps;
  Table<int> targets;
  Table<int> others;
  Table<Entry> entries;
  Table<Pivot> pivots;
  int factors;
};

template <int n>
struct Width {
  static constexpr int value = n;
};

/// Calls a function with the width 1, 2, 3 or 4 as a constant.
[[gnu::always_inline]] inline void with_width(int n, auto function) {
  if (n == 1) return function(Width<1>{});
  if (n == 2) return function(Width<2>{});
  if (n == 3) return function(Width<3>{});
  return function(Width<4>{});
}

/// Finish a tile after the updates by all earlier ones.
template <bool symmetric, int pivots, class Real>
[[gnu::always_inline]] inline void finish_tile(const Step& step, Real* factors) {
  Real* const diagonal = factors + step.diagonal;
  Tile<Real, pivots> t;
  load(t, diagonal);
  find_pivots(t, diagonal, factors + step.reciprocals);
  Real* upper = diagonal + 4 * pivots;
  Real* lower = upper + 4 * pivots * step.uppers;
  for (int i = 0; i < step.uppers; ++i, upper += 4 * pivots) {
    load(t, upper);
    solve_lower(t, diagonal);
    keep(t, upper);
    if constexpr (symmetric) keep_scaled(t, diagonal, lower + 4 * pivots * i);
  }
  for (int i = 0; !symmetric && i < step.lowers; ++i, lower += 4 * pivots) {
    load(t, lower);
    solve_upper(t, diagonal);
    keep(t, lower);
  }
}

/// The update of a row of blocks in one later tile.
template <int pivots, int columns, class Real>
[[gnu::always_inline]] inline void sweep(const Sweep& own, const int* target, Real* factors) {
  Four<Real> multiplier[pivots][columns];
  for (int k = 0; k < pivots; ++k)
    for (int j = 0; j < columns; ++j) {
      const Real m = factors[own.multipliers + 4 * k + j];
      multiplier[k][j] = Four<Real>{m, m, m, m};
    }
  const Real* source = factors + own.source;
  for (int i = 0; i < own.blocks; ++i, source += 4 * pivots) {
    Tile<Real, pivots> from;
    Tile<Real, columns> t;
    load(from, source);
    load(t, factors + target[i]);
    for (int j = 0; j < columns; ++j)
      for (int k = 0; k < pivots; ++k) t.column[j] -= from.column[k] * multiplier[k][j];
    keep(t, factors + target[i]);
  }
}

/// All sweeps of a tile; the end of their targets.
template <int pivots, class Real>
[[gnu::always_inline]] inline const int* sweep_all(const Sweep* next, const Sweep* end, const int* target, Real* factors) {
  for (; next != end; ++next) {
    with_width(next->columns, [&](auto columns) { sweep<pivots, columns.value>(*next, target, factors); });
    target += next->blocks;
  }
  return target;
}

/// Finish a tile and apply its updates; returns the end of its sweeps' targets.
template <bool symmetric, int pivots, class Real>
[[gnu::always_inline]] inline const int* eliminate_tile(const Step& step, const Sweep* sweeps, const int* target, Real* factors) {
  finish_tile<symmetric, pivots>(step, factors);
  return sweep_all<pivots>(sweeps, sweeps + step.sweeps, target, factors);
}

/// Factor a matrix with these values.
template <bool symmetric, class Real>
void eliminate(const Tables& tables, const Real* values, Real* factors) {
  for (int i = 0; i < tables.factors; ++i) factors[i] = Real(0);
  for (const Entry& entry : tables.entries) factors[entry.place] = values[entry.value];
  const Sweep* next = tables.sweeps.first;
  const int* target = tables.targets.first;
  for (const Step& step : tables.steps) {
    with_width(step.pivots, [&](auto pivots) { target = eliminate_tile<symmetric, pivots.value>(step, next, target, factors); });
    next += step.sweeps;
  }
}

/// A tile's unknowns after elimination of the earlier ones, and their updates of later ones.
template <int pivots, class Real>
void forward(const Step& step, const int* lowers, const Real* factors, Real* own, Real* y) {
  const Real* block = factors + step.diagonal;
  Real a[pivots];
  for (int i = 0; i < pivots; ++i) a[i] = own[i];
  solve_unit_lower<pivots>(a, block);
  for (int i = 0; i < pivots; ++i) own[i] = a[i];
  block += 4 * pivots * (1 + step.uppers);
  for (int i = 0; i < step.lowers; ++i, block += 4 * pivots) {
    Loose<Real>& later = *reinterpret_cast<Loose<Real>*>(y + lowers[i]);
    Four<Real> t = later;
    for (int k = 0; k < pivots; ++k) t -= *reinterpret_cast<const Loose<Real>*>(block + 4 * k) * a[k];
    later = t;
  }
}

/// A tile's unknowns from the later ones.
template <int pivots, class Real>
void backward(const Step& step, const int* uppers, const Real* factors, Real* own, const Real* y) {
  const Real* block = factors + step.diagonal;
  Tile<Real, pivots> t{};
  for (int i = 0; i < step.uppers; ++i) add_backward(t, block + 4 * pivots * (1 + i), y + uppers[i]);
  finish_backward(t, block, own);
}

/// Solve L U x = b in place of b; y has four reals per tile.
template <class Real>
void substitute(const Tables& tables, const Real* factors, Real* y, Real* x) {
  for (int i = 0; i < 4 * tables.steps.count; ++i) y[i] = Real(0);
  for (const Pivot& pivot : tables.pivots) y[pivot.place] = x[pivot.row];
  const int* other = tables.others.first;
  Real* own = y;
  for (const Step& step : tables.steps) {
    with_width(step.pivots, [&](auto pivots) { forward<pivots.value>(step, other + step.uppers, factors, own, y); });
    other += step.uppers + step.lowers;
    own += 4;
  }
  for (int i = tables.steps.count - 1; i >= 0; --i) {
    const Step& step = tables.steps.first[i];
    other -= step.uppers + step.lowers;
    own -= 4;
    with_width(step.pivots, [&](auto pivots) { backward<pivots.value>(step, other, factors, own, y); });
  }
  for (const Pivot& pivot : tables.pivots) x[pivot.column] = y[pivot.place];
}

}  // namespace cutjoint::static_factor
