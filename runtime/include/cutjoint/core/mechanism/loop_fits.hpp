// Loop embeddings with tunable geometry: functions that close the loops, fitted when parameters are loaded.
#pragma once

#include <cstddef>
#include <cstring>
#include <initializer_list>
#include <iterator>

#include "cutjoint/core/numbers/selection.hpp"

namespace cutjoint {

/// The loops of a block: `rows` residuals, closed by `functions` of the independent coordinate q.  They are closed at `nodes` values of q, on a range
/// of length 2 `half` about its `middle`, or on a full turn.  Violations below `allowed` (m, rad) are accepted.
struct LoopFit {
  int rows, functions, nodes;
  bool is_periodic;
  double middle, half, allowed;
};

/// The margin of loops that stay open; that of a range is not so small.
inline constexpr double margin_of_open_loops = -1e300;

/// A function of q: the number of its coefficients, and the slope of its linear part.
struct FittedFunction {
  int terms;
  double growth;
};

/// The number of coefficients of a block, one function after the other.
constexpr int coefficients_of(const LoopFit& loops, const FittedFunction* functions) {
  int count = 0;
  for (int j = 0; j < loops.functions; ++j) count += functions[j].terms;
  return count;
}

/// The largest number of terms of a function, and one more for integration.
constexpr int most_terms(const LoopFit& loops, const FittedFunction* functions) {
  int most = 0;
  for (int j = 0; j < loops.functions; ++j) most = functions[j].terms > most ? functions[j].terms : most;
  return most + 1;
}

/// The size of a fit's workspace.
constexpr int work_of_fit(const LoopFit& loops, const FittedFunction* functions) {
  const int n = loops.functions, m = loops.rows;
  return (n + 1) + m * (n + 2) + n * n + 8 * n + (n + 2) * most_terms(loops, functions);
}

/// A node by its index; half-integers lie between nodes, -1/2 and `nodes` - 1/2 are the ends of a range.
inline double node_of(const LoopFit& loops, double i) {
  constexpr double pi = 3.141592653589793;
  if (loops.is_periodic) return loops.middle + (2 * i / loops.nodes - 1) * pi;
  return loops.middle - loops.half * std::cos(pi * (i + 0.5) / loops.nodes);
}

/// The terms of series at q, and their derivatives: Chebyshev polynomials on the range, or 1, cos q, sin q, cos 2q, ...
template <class Real>
void terms_at(const LoopFit& loops, double q, int count, Real* value, Real* derivative) {
  value[0] = Real(1);
  derivative[0] = Real(0);
  if (loops.is_periodic) {
    for (int k = 1; k < count; ++k) {
      const int order = (k + 1) / 2;
      const double cosine = std::cos(order * q), sine = std::sin(order * q);
      value[k] = Real(k % 2 ? cosine : sine);
      derivative[k] = Real(k % 2 ? -order * sine : order * cosine);
    }
    return;
  }
  const double x = (q - loops.middle) / loops.half;
  double before = 1, now = x, rate_before = 0, rate = 1 / loops.half;
  for (int k = 1; k < count; ++k) {
    value[k] = Real(now);
    derivative[k] = Real(rate);
    const double next = 2 * x * now - before, rate_next = 2 * (x * rate + now / loops.half) - rate_before;
    before = now, now = next, rate_before = rate, rate = rate_next;
  }
}

/// The fit of the functions of a block.  `Close` is called with q and the values of the functions, and gives the residual and its
/// derivatives with respect to each of these.
template <class Real, class Close>
class LoopFitting {
 public:
  LoopFitting(const LoopFit& loops, const FittedFunction* functions, const double* start, Real* work, const Close& close)
      : loops_(loops), functions_(functions), start_(start), close_(close), n_(loops.functions), m_(loops.rows), length_(most_terms(loops, functions)),
        place_(work), by_place_(place_ + n_ + 1), residual_(by_place_ + m_ * (n_ + 1)), upper_(residual_ + m_), derivative_(upper_ + n_ * n_),
        found_derivative_(derivative_ + n_), step_(found_derivative_ + n_), offset_(step_ + n_), before_(offset_ + 2 * n_), mean_(before_ + 2 * n_), sums_(mean_ + n_),
        terms_(sums_ + n_ * length_), derivatives_(terms_ + length_) {}

  /// Find all coefficients, and then a margin, which is negative where loops stay open; the coefficients are then those of `start`.
  void find(Real* found) {
    const int middle = node_by_design();
    for (int i = 0; i < n_; ++i) mean_[i] = Real(0);
    for (int i = 0; i < n_ * length_; ++i) sums_[i] = Real(0);
    for (const int direction : {1, -1}) {
      for (int i = 0; i < 4 * n_; ++i) offset_[i] = Real(0);
      known_ = 0;
      for (int node = direction > 0 ? middle : middle - 1; node >= 0 && node < loops_.nodes; node += direction) add_node(node);
    }
    integrate(found);
    check(found);
  }

 private:
  using Chosen = Selection<Real>;

  /// The node nearest to the design position, where all geometries are closed and continuation starts.
  int node_by_design() const {
    int nearest = 0;
    for (int i = 1; i < loops_.nodes; ++i)
      if (std::abs(node_of(loops_, i)) < std::abs(node_of(loops_, nearest))) nearest = i;
    return nearest;
  }

  Real product(const Real* a, const Real* b) const {
    Real sum = a[0] * b[0];
    for (int i = 1; i < m_; ++i) sum = sum + a[i] * b[i];
    return sum;
  }

  /// Derivatives -Phi_s^-1 Phi_q and the step -Phi_s^-1 Phi by Gram-Schmidt; least squares for redundant rows.
  void solve() {
    using std::sqrt;
    for (int j = 0; j < n_; ++j) {
      Real* const column = by_place_ + m_ * (j + 1);
      const Real size = sqrt(product(column, column));
      upper_[j * n_ + j] = size;
      for (int i = 0; i < m_; ++i) column[i] = column[i] / size;
      for (int k = j + 1; k < n_; ++k) upper_[j * n_ + k] = without(column, by_place_ + m_ * (k + 1));
      found_derivative_[j] = without(column, by_place_);
      step_[j] = without(column, residual_);
    }
    for (Real* const x : {found_derivative_, step_})
      for (int j = n_ - 1; j >= 0; --j) {
        Real sum = -x[j];
        for (int k = j + 1; k < n_; ++k) sum = sum - upper_[j * n_ + k] * x[k];
        x[j] = sum / upper_[j * n_ + j];
      }
  }

  /// Remove the component of a column along a unit column, and return it.
  Real without(const Real* column, Real* other) const {
    const Real share = product(column, other);
    for (int i = 0; i < m_; ++i) other[i] = other[i] - share * column[i];
    return share;
  }

  /// The value of a series at the terms computed last.
  Real sum_of(const auto* coefficients, int count, const Real* terms) const {
    Real sum(0);
    for (int k = 0; k < count; ++k) sum = sum + Real(coefficients[k]) * terms[k];
    return sum;
  }

  /// The offset of a function extrapolated by the Hermite cubic through the last two nodes, or by the line through one.
  Real extrapolated_offset(double q, int j) const {
    if (known_ < 2) return offset_[j] + Real(known_ * (q - last_)) * offset_[n_ + j];
    const double h = last_ - before_last_, x = (q - before_last_) / h, y = x - 1;
    return Real((1 + 2 * x) * y * y) * before_[j] + Real(h * x * y * y) * before_[n_ + j] + Real(x * x * (3 - 2 * x)) * offset_[j] +
           Real(h * x * x * y) * offset_[n_ + j];
  }

  void add_node(int node) {
    const double q = node_of(loops_, node);
    terms_at(loops_, q, length_, terms_, derivatives_);
    place_[0] = Real(q);
    const double* c = start_;
    for (int j = 0; j < n_; c += functions_[j++].terms)
      place_[j + 1] = Real(functions_[j].growth * q) + sum_of(c, functions_[j].terms, terms_) + extrapolated_offset(q, j);
    auto moves = Chosen::all_if(true);
    const auto iterate = [&] {
      close_(place_, residual_, by_place_);
      solve();
      Real size(0);
      for (int j = 0; j < n_; ++j) {
        size = size + step_[j] * step_[j];
        Chosen::take(moves, place_[j + 1] + step_[j], place_[j + 1]);
        Chosen::take(moves, found_derivative_[j], derivative_[j]);
      }
      moves = Chosen::both(moves, Real(closed * closed) < size);
    };
    for (int steps = 0; steps < most_steps && Chosen::any(moves); ++steps) iterate();
    if constexpr (requires { place_[0].derivative; }) {  // derivatives are those of the previous iteration
      moves = true;
      iterate();
    }
    c = start_;
    for (int j = 0; j < n_; c += functions_[j++].terms) {
      const Real straight = place_[j + 1] - Real(functions_[j].growth * q);
      before_[j] = offset_[j];
      before_[n_ + j] = offset_[n_ + j];
      offset_[j] = straight - sum_of(c, functions_[j].terms, terms_);
      offset_[n_ + j] = derivative_[j] - Real(functions_[j].growth) - sum_of(c, functions_[j].terms, derivatives_);
      mean_[j] = mean_[j] + straight;
      for (int k = 0; k < length_; ++k) sums_[j * length_ + k] = sums_[j * length_ + k] + terms_[k] * derivative_[j];
      const Real rate_squared = derivative_[j] * derivative_[j];
      Chosen::take(largest_rate_ < rate_squared, rate_squared, largest_rate_);
    }
    before_last_ = last_;
    last_ = q;
    ++known_;
  }

  /// Integrate the series of derivatives to those of the functions.
  void integrate(Real* found) const {
    for (int j = 0; j < n_; found += functions_[j++].terms) {
      const Real* const sums = sums_ + j * length_;
      found[0] = mean_[j] * Real(1.0 / loops_.nodes);
      for (int k = 1; k < functions_[j].terms; ++k) {
        const int order = (k + 1) / 2;
        if (loops_.is_periodic) found[k] = Real((k % 2 ? -2.0 : 2.0) / (loops_.nodes * order)) * sums[k % 2 ? k + 1 : k - 1];
        else found[k] = Real(loops_.half / (loops_.nodes * k)) * (sums[k - 1] - sums[k + 1]);
      }
    }
  }

  /// The margin: checks all violations, and their derivatives relative to the largest one of the functions, between the nodes.
  void check(Real* found) {
    const int between = loops_.nodes + 1;
    const Real violation(loops_.allowed * loops_.allowed), rate = violation * largest_rate_;
    Real passed(0);
    for (int i = 0; i < between; ++i) {
      const double q = node_of(loops_, i - 0.5);
      terms_at(loops_, q, length_, terms_, derivatives_);
      place_[0] = Real(q);
      const Real* c = found;
      for (int j = 0; j < n_; c += functions_[j++].terms) {
        place_[j + 1] = Real(functions_[j].growth * q) + sum_of(c, functions_[j].terms, terms_);
        derivative_[j] = Real(functions_[j].growth) + sum_of(c, functions_[j].terms, derivatives_);
      }
      close_(place_, residual_, by_place_);
      for (int row = 0; row < m_; ++row) {
        Real residual_rate = by_place_[row];
        for (int j = 0; j < n_; ++j) residual_rate = residual_rate + by_place_[m_ * (j + 1) + row] * derivative_[j];
        Chosen::take(Chosen::both(residual_[row] * residual_[row] <= violation, residual_rate * residual_rate <= rate), passed + Real(1), passed);
      }
    }
    const int count = coefficients_of(loops_, functions_);
    Real margin(margin_of_open_loops);
    Chosen::take(Real(between * m_ - 0.5) < passed, Real(1), margin);
    for (int k = 0; k < count; ++k) Chosen::take(margin < Real(0), Real(start_[k]), found[k]);
    found[count] = margin;
  }

  static constexpr double closed = 1e-11;  ///< the last step of Newton's iteration, which converges quadratically
  static constexpr int most_steps = 12;

  const LoopFit& loops_;
  const FittedFunction* functions_;
  const double* start_;
  const Close& close_;
  int n_, m_, length_;
  Real *place_, *by_place_, *residual_;  ///< derivatives with respect to q, then to each function
  Real *upper_, *derivative_, *found_derivative_, *step_;  ///< R of the decomposition, derivatives at the node and of the last iteration
  Real *offset_, *before_;              ///< of the functions at the last node from those of `start_`, then of their derivatives; and at the node before
  Real *mean_, *sums_, *terms_, *derivatives_;
  Real largest_rate_ = Real(1);
  double last_ = 0, before_last_ = 0;  ///< q of these nodes
  int known_ = 0;                      ///< nodes in this direction
};

/// The fits of a class with the tables `Fits`; `find` returns the coefficients that `load` reads, and refits if the geometry has changed.  Over dual numbers it caches
/// the fits of several sets of seeds, since those of a run are loaded in turn.
template <class Real, class Fits>
class LoopFits {
 public:
  const Real* find(const auto& generated, const Real* parameters) {
    for (std::size_t i = 0; i < number_; ++i)
      if (cached_[i].is_of(parameters)) return cached_[i].found;
    if (number_ > 0 && !cached_[0].has_values_of(parameters)) number_ = 0;
    Fit& fit = cached_[number_ < cached ? number_++ : cached - 1];
    Real work[most_work];
    Real* found = fit.found;
    const FittedFunction* functions = Fits::functions;
    const double* start = Fits::start;
    for (int block = 0; block < Fits::blocks; ++block) {
      const auto close = [&](const Real* place, Real* opening, Real* by_place) { generated.close(block, parameters, place, opening, by_place); };
      const LoopFit& loops = Fits::loops[block];
      LoopFitting<Real, decltype(close)>(loops, functions, start, work, close).find(found);
      found += coefficients_of(loops, functions) + 1;
      start += coefficients_of(loops, functions);
      functions += loops.functions;
    }
    for (std::size_t i = 0; i < count; ++i) fit.of[i] = parameters[Fits::parameters[i]];
    return fit.found;
  }

 private:
  static constexpr std::size_t count = std::size(Fits::parameters);
  static constexpr bool has_derivatives = requires(Real x) { x.derivative; };

  /// Number of fits: as few sets of seeds as hold all parameters, and one without seeds.
  static constexpr std::size_t cached = [] {
    if constexpr (has_derivatives) return count * sizeof(double) / sizeof(Real::derivative) + 2;
    else return 1;
  }();

  struct Fit {
    Real found[Fits::length], of[count];  ///< coefficients, and their parameters

    bool is_of(const Real* parameters) const {
      for (std::size_t i = 0; i < count; ++i)
        if (std::memcmp(&of[i], &parameters[Fits::parameters[i]], sizeof(Real)) != 0) return false;
      return true;
    }

    /// Whether values are equal; derivatives may differ.
    bool has_values_of(const Real* parameters) const {
      for (std::size_t i = 0; i < count; ++i)
        if (std::memcmp(&of[i], &parameters[Fits::parameters[i]], sizeof(double)) != 0) return false;
      return has_derivatives;
    }
  };

  /// The size of the largest workspace.
  static constexpr int most_work = [] {
    int most = 0;
    const FittedFunction* functions = Fits::functions;
    for (const LoopFit& loops : Fits::loops) {
      const int work = work_of_fit(loops, functions);
      most = work > most ? work : most;
      functions += loops.functions;
    }
    return most;
  }();

  Fit cached_[cached];
  std::size_t number_ = 0;
};

}  // namespace cutjoint
