// Derivatives of the end of a trapezoidal step whose multipliers close the loops, by the force residual.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <span>

#include "cutjoint/core/numbers/arrays.hpp"
#include "cutjoint/core/numbers/bordered.hpp"
#include "cutjoint/core/numbers/dual.hpp"
#include "cutjoint/core/mechanism/mechanism.hpp"
#include "cutjoint/core/mechanism/retraction.hpp"
#include "cutjoint/core/mechanism/transposed_charts.hpp"

namespace cutjoint {

/// Derivatives by `ForceResidual` of the end of a step by Newton's iteration: accelerations a, multipliers, coordinates q and velocities v of the rule, and the
/// projections of velocities and accelerations in the metric of the tangent A there:
///
///     f(q, v, a, lambda) = 0     Phi(q) = 0         A (v_1 - v) + Phi_q^T mu = 0     Phid(q, v_1) = 0         A (vdot - a) + Phi_q^T nu = 0     Phidd(q, v_1, vdot) = 0
///
/// f is the force residual.  Derivatives of A times a displacement are differences of Jacobians along it.  The effect of a reused tangent of
/// another pose is neglected.
template <class ForceResidual>
class ClosedEndDerivatives {
 public:
  static constexpr std::size_t n = ForceResidual::n, m = ForceResidual::m, coordinates = ForceResidual::coordinates, all = n + m;
  using Changes = typename ForceResidual::Changes;
  using Entries = typename ForceResidual::JacobianEntries;
  using Matrix = Bordered<typename ForceResidual::Places>;
  using Columns = Fixed<double, ForceResidual::first_acceleration>;
  using First = Fixed<double, all>;  ///< with respect to accelerations and multipliers of the rule

  /// Prepare for a step by its formula; `rule` is the end before the projections.  False if a matrix is singular.
  template <class Formula, class State>
  bool find(ForceResidual& force_residual, const Formula& formula, const State& rule, const State& end) {
    position_weights_ = formula.position_weights().end;
    force_residual.find(rule, rule_);
    force_residual.find(end, end_);
    const auto decomposes = [&] { return decompose(force_residual, formula); };
    if (!decomposes() && !decomposes()) return false;  // with other pivots if those of earlier matrices have become small
    Changes pushed{}, moved{};
    ForceResidual::visit_unknowns(n, all, [&](std::size_t row, std::size_t k, std::size_t column) {
      pushed[row].derivative[0] += end_[k] * (end.vdot[column] - rule.vdot[column]);
      moved[row].derivative[0] += end_[k] * (end.v[column] - rule.v[column]);
    });
    if (!force_residual.solve(projections_, pushed) || !force_residual.solve(projections_, moved)) return false;
    const auto move = [&](double scale, const Changes& by, Entries& derivative) {
      State at = rule;
      Fixed<double, n> shift;
      for (std::size_t i = 0; i < n; ++i) {
        const double x = scale * by[i].derivative[0];
        at.vdot[i] += x, at.v[i] += formula.velocity_weights().end * x, shift[i] = position_weights_ * x;
      }
      retract<double>(ForceResidual::charts(), rule.q.data(), shift.data(), at.q.data());
      for (std::size_t i = 0; i < m; ++i) at.lambda[i] += scale * by[n + i].derivative[0];
      force_residual.find(at, derivative);
      for (std::size_t k = 0; k < derivative.size(); ++k) derivative[k] = (derivative[k] - rule_[k]) / scale;
    };
    move(1 / formula.velocity_weights().end, moved, speeds_);
    move(1.0, pushed, accelerations_);
    return true;
  }

  /// A linear equation of the end: its matrix, the Jacobian of its equations of motion, and the weight of violations of constraints.
  struct Part {
    const Matrix& matrix;
    const Entries& derivative;
    double weight;
  };

  Part rule() const { return {matrix_, rule_, -1 / position_weights_}; }        ///< accelerations and multipliers of the rule
  Part speeds() const { return {projections_, speeds_, -1.0}; }                 ///< the projection of velocities
  Part accelerations() const { return {projections_, accelerations_, 1.0}; }  ///< and of accelerations

  /// Its derivatives; `violations` has those of constraints for constant unknowns, `first` those of the rule, if it is none itself.
  template <class Q, class V, class Violation, class Inputs, class Discrete>
  bool solve(const Part& part, ForceResidual& force_residual, const Q& q, const V& v, const Violation* violations, const Inputs& du, const Discrete& discrete, const Changes* first, Changes& change) const {
    force_residual.subtract_jvp(part.derivative, q, v, du, discrete, change.data());
    for (std::size_t i = 0; i < m; ++i) change[n + i].derivative = part.weight * violations[i].derivative;
    if (first) ForceResidual::visit_unknowns(0, n, [&](std::size_t i, std::size_t k, std::size_t column) { change[i].derivative -= part.derivative[k] * (*first)[column].derivative; });
    return force_residual.solve(part.matrix, change);
  }

  /// The transpose: derivatives with respect to all that `subtract_jvp` reads, to violations, and added to `by_first` those to the rule.
  template <class By>
  bool vjp(const Part& part, const ForceResidual& force_residual, const By& by_solution, Columns& by, Fixed<double, m>& by_violation, First* by_first) const {
    First x, forces;
    std::copy(by_solution.begin(), by_solution.end(), x.begin());
    if (!force_residual.solve_transposed(part.matrix, x)) return false;
    std::copy_n(x.begin(), n, forces.begin());
    force_residual.vjp(part.derivative, forces.data(), by);
    if (by_first) ForceResidual::visit_unknowns(0, n, [&](std::size_t i, std::size_t k, std::size_t column) { (*by_first)[column] -= part.derivative[k] * x[i]; });
    for (std::size_t i = 0; i < m; ++i) by_violation[i] = part.weight * x[n + i];
    return true;
  }

  /// Derivatives of the projection of accelerations, with velocities before and after theirs.
  template <class Q, class V, class Inputs, class Discrete>
  bool solve_accelerations(ForceResidual& force_residual, const Q& q, const V& v, const V& projected, const Inputs& du, const Discrete& discrete, const Changes& first, Changes& change) const {
    Changes loops;
    force_residual.subtract_jvp(end_, q, projected, du, discrete, loops.data());
    ForceResidual::visit_unknowns(n, all, [&](std::size_t row, std::size_t k, std::size_t column) { loops[row].derivative -= end_[k] * first[column].derivative; });
    return solve(accelerations(), force_residual, q, v, loops.data() + n, du, discrete, &first, change);
  }

  /// The transpose: derivatives with respect to all that `subtract_jvp` reads, with velocities before and after their projection, and to the rule.
  bool accelerations_vjp(const ForceResidual& force_residual, const Fixed<double, n>& by_move, Columns& by, Columns& by_projected, First& by_first) const {
    Fixed<double, m> by_loops;
    First loops;
    if (!vjp(accelerations(), force_residual, by_move, by, by_loops, &by_first)) return false;
    std::copy(by_loops.begin(), by_loops.end(), loops.begin() + n);
    force_residual.vjp(end_, loops.data(), by_projected);
    ForceResidual::visit_unknowns(n, all, [&](std::size_t row, std::size_t k, std::size_t column) { by_first[column] -= end_[k] * loops[row]; });
    return true;
  }

 private:
  template <class Formula>
  bool decompose(const ForceResidual& force_residual, const Formula& formula) {
    auto &rule = matrix_.entries(), &projections = projections_.entries();
    const auto at = [](std::size_t i, std::size_t j) { return Matrix::places.of(i, j); };
    rule.fill(0.0), projections.fill(0.0);
    force_residual.gather_entries(formula, 0, rule_, n, [&](std::size_t i, std::size_t, std::size_t j, double x) { rule[at(i, j)] += x, projections[at(i, j)] += x; });
    ForceResidual::visit_unknowns(n, all, [&](std::size_t i, std::size_t k, std::size_t j) {
      projections[at(i, j)] += end_[k];
      if (!is_rotation(j)) rule[at(i, j)] += end_[k];
    });
    for (std::size_t i = n; i < all; ++i) rule[at(i, i)] -= force_residual.compliance(i - n), projections[at(i, i)] -= force_residual.compliance(i - n);
    if constexpr (balls > 0) rotate_violations(formula.delta());
    const bool is_regular = matrix_.decompose(Matrix::everywhere);
    return projections_.decompose(Matrix::everywhere) && is_regular;
  }

  static bool is_rotation(std::size_t speed) {
    for (const Chart& chart : ForceResidual::charts())
      if (chart.ball && speed >= static_cast<std::size_t>(chart.v + chart.scalars) && speed < static_cast<std::size_t>(chart.v + chart.scalars + 3)) return true;
    return false;
  }

  /// Add the derivatives of constraints with respect to the rotation vectors of balls.
  void rotate_violations(const double* delta) {
    Fixed<double, 9 * balls> turned;
    ball_tangents<double>(ForceResidual::charts(), delta, turned.data());
    const double* T = turned.data();
    for (const Chart& chart : ForceResidual::charts()) {
      if (!chart.ball) continue;
      const auto w = static_cast<std::size_t>(chart.v + chart.scalars);
      ForceResidual::visit_unknowns(n, all, [&](std::size_t row, std::size_t k, std::size_t column) {
        for (std::size_t l = 0; column >= w && column < w + 3 && l < 3; ++l) matrix_.entries()[Matrix::places.of(row, w + l)] += end_[k] * T[3 * (column - w) + l];
      });
      T += 9;
    }
  }

  static constexpr std::size_t balls = ForceResidual::balls;

  double position_weights_ = 0.0;  ///< of accelerations in coordinates at the end
  Entries rule_, end_, accelerations_, speeds_;  ///< Jacobians before the projections, after them, and of tangents times the displacements of projections
  Matrix matrix_, projections_;  ///< of the rule, and of projections
};

}  // namespace cutjoint
