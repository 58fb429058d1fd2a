// A fixed pivot order with a check: if it is unsafe, the matrix is factored again with pivoting.
#pragma once

#include <algorithm>
#include <limits>

#include "cutjoint/core/newton/scaled.hpp"
#include "cutjoint/core/newton/static_solver.hpp"
#include "cutjoint/core/newton/system.hpp"

namespace cutjoint {

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

  /// Factor the matrix with these values in the order of the pattern; they must stay until the last solve.
  Breakdown factor(const Real* values) {
    values_ = values;
    now_.pivots = now_.trusted = false;
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
  double smallest_pivot(const Real* values) const
    requires requires { S::pivot_columns; }
  {
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
};

}  // namespace cutjoint
