// A fixed pivot order with a check, and the dense solver with pivoting that takes over if it is unsafe.
#pragma once

#include <array>

#include "cutjoint/core/numbers/dense.hpp"
#include "cutjoint/core/newton/static_solver.hpp"

namespace cutjoint {

/// Factors the tangents of a system as dense matrices.
template <class S>
class DenseSolver {
 public:
  using Real = typename S::real_type;

  static constexpr std::size_t rows = static_tangent<S>().rows;

  explicit DenseSolver(const S& system) : system_(system), order_(tangent_of(system).rows) {}

  /// Allocate memory unless it is inside the object: few runs need any.
  void prepare() {
    if constexpr (!Sized<S>) a_.resize(order_.size() * order_.size());
    x_ = Rows<S>(order_.size());
  }

  Breakdown factor(const Real* values) {
    fill(values);
    if (!triangles().decompose()) return {Breakdown::Kind::singular, -1};
    return {};
  }

  Breakdown solve(Real* x) {
    triangles().solve(x, x_.data());
    return {};
  }

  /// The smallest pivot, relative to the largest entry of its column.
  double smallest_pivot(const auto* values) const requires Sized<S> {
    std::array<int, rows> columns;
    for (std::size_t k = 0; k < rows; ++k) columns[k] = static_cast<int>(k);
    return share_of_columns<S>(values, [this](std::size_t k) { return static_cast<double>(a_[k * rows + k]); }, columns);
  }

 private:
  dense::Triangles<Real> triangles() { return {{a_.data(), order_.size(), order_.size()}, order_.data()}; }

  void fill(const Real* values) {
    const auto& pattern = pattern_of(system_);
    std::fill(a_.begin(), a_.end(), Real(0));
    for (std::size_t j = 0; j < order_.size(); ++j)
      for (auto i = static_cast<std::size_t>(pattern.first[j]); i < static_cast<std::size_t>(pattern.first[j + 1]); ++i)
        a_[j * order_.size() + static_cast<std::size_t>(pattern.row[i])] = values[i];
  }

  const S& system_;
  Array<S, rows * rows> a_;
  Array<S, rows, std::size_t> order_;
  Rows<S> x_;
};

/// Row and column scales of a system's full tangent, and backward errors of solutions.
///
/// With d_j the largest entry of column j, the unknowns d_j x_j have one scale whatever the units of x; the largest entry of row i in
/// these unknowns, R_i = max_j |K_ij| / d_j, is the scale of equation i.
template <class S>
class Scaled {
 public:
  using Real = typename S::real_type;

  explicit Scaled(const S& system) : pattern_(pattern_of(system)), scales_(tangent_of(system).rows), left_(scales_.column.size()) {}

  void measure(const Real* values) {
    using std::abs, std::max;
    std::fill(scales_.row.begin(), scales_.row.end(), Real(0));
    for (std::size_t j = 0; j < scales_.column.size(); ++j) {
      Real largest(0);
      for (std::size_t i = begin(j); i < begin(j + 1); ++i) largest = max(largest, abs(values[i]));
      scales_.column[j] = largest;
      const Real inverse = largest > Real(0) ? Real(1) / largest : Real(0);
      for (std::size_t i = begin(j); i < begin(j + 1); ++i) scales_.row[row(i)] = max(scales_.row[row(i)], abs(values[i]) * inverse);
    }
  }

  /// The backward error of a solution, max_i |K x - b|_i / (R_i max_j |d_j x_j| + |b_i|): how much the equations would have to change,
  /// relative to their scale, for x to solve them (after Oettli and Prager 1964).  NaN if x is not finite.
  Real backward_error(const Real* values, const Real* x, const Real* b) {
    using std::abs, std::max;
    Real size(0), error(0);
    for (std::size_t i = 0; i < left_.size(); ++i) left_[i] = -b[i];
    for (std::size_t j = 0; j < left_.size(); ++j) {
      size = max(size, abs(scales_.column[j] * x[j]));
      for (std::size_t i = begin(j); i < begin(j + 1); ++i) left_[row(i)] += values[i] * x[j];
    }
    for (std::size_t i = 0; i < left_.size(); ++i) {
      const Real whole = scales_.row[i] * size + abs(b[i]);
      if (!(abs(left_[i]) <= error * whole)) error = abs(left_[i]) / whole;
      if (!std::isfinite(static_cast<double>(error))) return error;
    }
    return error;
  }

  /// A pseudo-random right-hand side of the equations' scale, which a singular matrix amplifies.
  void probe(Real* b) const {
    unsigned state = 12345;
    for (std::size_t i = 0; i < scales_.row.size(); ++i) {
      state = state * 1664525u + 1013904223u;
      b[i] = scales_.row[i] * (Real(0.5) + Real(state >> 16) / Real(131072)) * ((state >> 15) & 1u ? Real(1) : Real(-1));
    }
  }

  /// The largest of the scaled unknowns.
  Real size(const Real* x) const {
    using std::abs;
    Real largest(0);
    for (std::size_t j = 0; j < scales_.column.size(); ++j)
      if (const Real scaled = abs(scales_.column[j] * x[j]); scaled > largest || scaled != scaled) largest = scaled;
    return largest;
  }

  /// d and R.
  struct Scales {
    Rows<S> column, row;

    explicit Scales(std::size_t n) : column(n), row(n) {}
  };

  const Scales& scales() const { return scales_; }
  void restore(const Scales& scales) { scales_ = scales; }

 private:
  std::size_t begin(std::size_t j) const { return static_cast<std::size_t>(pattern_.first[j]); }
  std::size_t row(std::size_t i) const { return static_cast<std::size_t>(pattern_.row[i]); }

  const PatternOf<S>& pattern_;
  Scales scales_;
  Rows<S> left_;
};

/// Checks the emitted factorisation with its fixed pivot order for a matrix that is not symmetric.
///
/// The backward error of the first solution of each factorisation is checked: the relative change of the equations by
/// which it would solve them.  Above 1e-8, or if a pivot vanished, the fixed order is unsuitable
/// and a solver with `Pivoting` takes over for this matrix: `prepare` is called before its first one.
template <class S, class Pivoting>
class GuardedSolver {
 public:
  using Real = typename S::real_type;

  explicit GuardedSolver(const S& system) : fixed_(system), pivoting_(system), scaled_(system), right_(tangent_of(system).rows) {}

  /// Pivot each matrix, whose solutions are then not checked, at constant cost.
  void pivot_always(bool always) { always_ = always; }

  /// Factor the matrix with these values in the order of the pattern; they must stay until the last solve.
  Breakdown factor(const Real* values) {
    values_ = values;
    now_.pivots = false;
    now_.trusted = always_;
    if (always_) return fall_back();
    if (!fixed_.factor(values)) return {};
    return fall_back();
  }

  /// Replace the right-hand side x by the solution.
  Breakdown solve(Real* x) {
    if (now_.trusted) return solve_anew(x);
    std::copy_n(x, right_.size(), right_.begin());
    if (const Breakdown broken = solve_anew(x)) return broken;
    now_.trusted = solves(x);
    if (now_.trusted) return {};
    if (now_.pivots) return {Breakdown::Kind::singular, -1};
    if (const Breakdown broken = fall_back()) return broken;
    std::copy(right_.begin(), right_.end(), x);
    if (const Breakdown broken = solve_anew(x)) return broken;
    now_.trusted = solves(x);
    return now_.trusted ? Breakdown{} : Breakdown{Breakdown::Kind::singular, -1};
  }

  /// The smallest pivot of the last factors, relative to the largest entry of its column; infinity before there are any.
  double smallest_pivot(const auto* values) const requires requires { S::pivot_columns; } {
    return now_.pivots ? pivoting_.smallest_pivot(values) : fixed_.smallest_pivot(values);
  }

  /// The number of factorisations with pivoting instead of the fixed order.
  long fallbacks() const { return fallbacks_; }

  /// Whether pivoting is in use, the last factors are known to be good, and scales have been measured.  The type is long, so that equal values have equal bytes.
  struct Progress {
    long pivots = 0, trusted = 0, measured = 0;
  };

  /// Memory of the next solutions, besides the matrix.
  struct Memory {
    typename Scaled<S>::Scales scales;
    Progress progress;
  };

  Memory memory() const { return {scaled_.scales(), now_}; }

  /// Restore the memory of another solver, whose last matrix had these values.
  void restore(const Memory& memory, const Real* values) {
    factor(values);
    if (memory.progress.pivots && !now_.pivots) fall_back();
    scaled_.restore(memory.scales);
    now_ = memory.progress;
  }

 private:
  Breakdown solve_anew(Real* x) { return now_.pivots ? pivoting_.solve(x) : fixed_.solve(x); }

  /// Scales of an earlier matrix are used until they show an error.
  bool solves(const Real* x) {
    const Real limit = std::max(Real(1e-8), 128 * std::numeric_limits<Real>::epsilon());
    if (now_.measured && scaled_.backward_error(values_, x, right_.data()) <= limit) return true;
    now_.measured = true;
    scaled_.measure(values_);
    return scaled_.backward_error(values_, x, right_.data()) <= limit;
  }

  Breakdown fall_back() {
    if (fallbacks_++ == 0) pivoting_.prepare();
    now_.pivots = true;
    return pivoting_.factor(values_);
  }

  StaticSolver<S> fixed_;
  Pivoting pivoting_;
  Scaled<S> scaled_;
  Rows<S> right_;
  const Real* values_ = nullptr;
  Progress now_;
  long fallbacks_ = 0;
  bool always_ = false;
};

}  // namespace cutjoint
