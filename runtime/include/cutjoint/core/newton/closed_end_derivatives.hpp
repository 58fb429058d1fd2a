// How the end of a trapezoidal step whose multipliers close the loops changes along directions, by balances of forces.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <span>

#include "cutjoint/core/arrays.hpp"
#include "cutjoint/core/bordered.hpp"
#include "cutjoint/core/dual.hpp"
#include "cutjoint/core/mechanism.hpp"
#include "cutjoint/core/retraction.hpp"
#include "cutjoint/core/transposed_charts.hpp"

namespace cutjoint {

/// Slopes by `Balance` of all that Newton's iteration leaves at the end of a step of length h.  With accelerations a and multipliers that lead to coordinates q
/// and speeds v, and the projections of speeds and accelerations in the norm of the tangent A there, these are
///
///     f(q, v, a, lambda) = 0     Phi(q) = 0         A (v_1 - v) + Phi_q^T mu = 0     Phid(q, v_1) = 0         A (vdot - a) + Phi_q^T nu = 0     Phidd(q, v_1, vdot) = 0
///
/// f being the balance of forces.  A times a move is how f changes on the way of it, so that slopes of that are the differences of slopes there.  Where the run has
/// the tangent of another pose, what that makes is missing.
template <class Balance>
class ClosedEndDerivatives {
 public:
  static constexpr std::size_t n = Balance::n, m = Balance::m, coordinates = Balance::coordinates, all = n + m;
  using Changes = typename Balance::Changes;
  using Columns = Fixed<double, Balance::first_acceleration>;
  using First = Fixed<double, all>;  ///< by accelerations and multipliers that lead to the end

  /// Of a step from coordinates; `rule` has what leads to its end, in which the balance is.  False where a matrix is singular.
  template <class State>
  bool find(Balance& balance, double h, std::span<const Chart> charts, const double* from, const State& rule, const State& end) {
    h_ = h;
    displacement<double>(charts, from, rule.q.data(), delta_.data());
    balance.find(rule, rule_);
    balance.find(end, end_);
    if (!decompose(balance, charts, from) && !decompose(balance, charts, from)) return false;  // with other pivots where those of matrices before have become small
    Changes pushed{}, moved{};
    for_curvatures([&](std::size_t row, std::size_t k, std::size_t column) {
      pushed[row].derivative[0] += end_[k] * (end.vdot[column] - rule.vdot[column]);
      moved[row].derivative[0] += end_[k] * (end.v[column] - rule.v[column]);
    });
    if (!balance.solve(projections_, pushed) || !balance.solve(projections_, moved)) return false;
    const auto move = [&](double scale, const Changes& by, typename Balance::OfDerivatives& derivative) {
      State at = rule;
      Fixed<double, n> way;
      for (std::size_t i = 0; i < n; ++i) {
        const double x = scale * by[i].derivative[0];
        at.vdot[i] += x, at.v[i] += h / 2 * x, way[i] = h * h / 4 * x;
      }
      retract<double>(charts, rule.q.data(), way.data(), at.q.data());
      for (std::size_t i = 0; i < m; ++i) at.lambda[i] += scale * by[n + i].derivative[0];
      balance.find(at, derivative);
      for (std::size_t k = 0; k < derivative.size(); ++k) derivative[k] = (derivative[k] - rule_[k]) / scale;
    };
    move(2 / h, moved, speeds_);
    move(1.0, pushed, accelerations_);
    return true;
  }

  /// Accelerations and multipliers that lead to the end, where loops open by `violations` along directions without their changes.
  template <class Q, class V, class Inputs, class Held>
  bool solve_rule(Balance& balance, const Q& q, const V& v, const Fixed<Dual, m>& violations, const Inputs& du, const Held& held, Changes& change) const {
    balance.lose(rule_, q, v, du, held, change.data());
    for (std::size_t i = 0; i < m; ++i) change[n + i].derivative = -4 / (h_ * h_) * violations[i].derivative;
    return balance.solve(matrix_, change);
  }

  /// How speeds change by their projection, whose rates of loops open by `violations` along directions without it; `first` are the changes that lead to the end.
  template <class Q, class V, class Inputs, class Held>
  bool solve_speeds(Balance& balance, const Q& q, const V& v, const Fixed<Dual, m>& violations, const Inputs& du, const Held& held, const Changes& first, Changes& change) const {
    lose(balance, speeds_, q, v, du, held, first, change);
    for (std::size_t i = 0; i < m; ++i) change[n + i].derivative = -violations[i].derivative;
    return balance.solve(projections_, change);
  }

  /// How accelerations do, by speeds before and behind their projection.
  template <class Q, class V, class Inputs, class Held>
  bool solve_accelerations(Balance& balance, const Q& q, const V& v, const V& projected, const Inputs& du, const Held& held, const Changes& first, Changes& change) const {
    Changes loops;
    lose(balance, accelerations_, q, v, du, held, first, change);
    balance.lose(end_, q, projected, du, held, loops.data());
    for_curvatures([&](std::size_t row, std::size_t k, std::size_t column) { loops[row].derivative -= end_[k] * first[column].derivative; });
    std::copy_n(loops.begin() + n, m, change.begin() + n);
    return balance.solve(projections_, change);
  }

  /// From slopes by the move of accelerations to those by all that `lose` reads, with speeds before their projection and behind it, and by what leads to the end.
  bool pull_accelerations(const Balance& balance, const Fixed<double, n>& by_move, Columns& by, Columns& by_projected, First& by_first) const {
    First x, loops;
    if (!pull(balance, projections_, accelerations_, by_move, {}, x, by, &by_first)) return false;
    std::copy_n(x.begin() + n, m, loops.begin() + n);
    balance.pull(end_, loops.data(), by_projected);
    for_curvatures([&](std::size_t row, std::size_t k, std::size_t column) { by_first[column] -= end_[k] * loops[row]; });
    return true;
  }

  /// From slopes by the move of speeds to those by all that `lose` reads, by what leads to the end, and by gaps of the rates of loops.
  bool pull_speeds(const Balance& balance, const Fixed<double, n>& by_move, Columns& by, First& by_first, Fixed<double, m>& by_violation) const {
    First x;
    if (!pull(balance, projections_, speeds_, by_move, {}, x, by, &by_first)) return false;
    for (std::size_t i = 0; i < m; ++i) by_violation[i] = -x[n + i];
    return true;
  }

  /// From slopes by accelerations and multipliers that lead to the end to those by all that `lose` reads, and by gaps of loops.
  bool pull_rule(const Balance& balance, const First& by_first, Columns& by, Fixed<double, m>& by_violation) const {
    First x;
    Fixed<double, n> by_a;
    Fixed<double, m> by_lambda;
    std::copy_n(by_first.begin(), n, by_a.begin()), std::copy_n(by_first.begin() + n, m, by_lambda.begin());
    if (!pull(balance, matrix_, rule_, by_a, by_lambda, x, by, nullptr)) return false;
    for (std::size_t i = 0; i < m; ++i) by_violation[i] = -4 / (h_ * h_) * x[n + i];
    return true;
  }

  const double* delta() const { return delta_.data(); }

 private:
  using Places = typename Balance::Places;
  using Matrix = Bordered<Places>;

  /// What forces lose by changes of all, `first` being those of accelerations and multipliers.
  template <class Q, class V, class Inputs, class Held>
  void lose(Balance& balance, const typename Balance::OfDerivatives& derivative, const Q& q, const V& v, const Inputs& du, const Held& held, const Changes& first, Changes& change) const {
    balance.lose(derivative, q, v, du, held, change.data());
    for (std::size_t i = 0; i < n; ++i)
      for (std::size_t k = Places::middles[i]; k < Places::starts[i + 1]; ++k) change[i].derivative -= derivative[Places::derivatives[k]] * first[Places::columns[k] - Balance::first_acceleration].derivative;
  }

  /// The solution x of transposed equations, and from it slopes by all that forces read, with `by_first` those by accelerations and multipliers, which are added.
  bool pull(const Balance& balance, const Matrix& matrix, const typename Balance::OfDerivatives& derivative, const Fixed<double, n>& by_move, const Fixed<double, m>& by_lambda,
            First& x, Columns& by, First* by_first) const {
    std::copy(by_lambda.begin(), by_lambda.end(), std::copy(by_move.begin(), by_move.end(), x.begin()));
    if (!balance.solve_transposed(matrix, x)) return false;
    First forces;
    std::copy_n(x.begin(), n, forces.begin());
    balance.pull(derivative, forces.data(), by);
    for (std::size_t i = 0; by_first && i < n; ++i)
      for (std::size_t k = Places::middles[i]; k < Places::starts[i + 1]; ++k) (*by_first)[Places::columns[k] - Balance::first_acceleration] -= derivative[Places::derivatives[k]] * x[i];
    return true;
  }

  /// Slopes by accelerations of the second rates of loops, which are those of loops by displacements: the row, the place of the slope, and the acceleration.
  template <class Use>
  static void for_curvatures(Use use) {
    for (std::size_t i = n; i < all; ++i)
      for (std::size_t k = Places::middles[i]; k < Places::starts[i + 1]; ++k)
        if (Places::columns[k] < Balance::first_multiplier) use(i, Places::derivatives[k], Places::columns[k] - Balance::first_acceleration);
  }

  bool decompose(const Balance& balance, std::span<const Chart> charts, const double* from) {
    auto &rule = matrix_.entries(), &projections = projections_.entries();
    const auto at = [](std::size_t i, std::size_t j) { return Matrix::places.of(i, j); };
    rule.fill(0.0), projections.fill(0.0);
    Fixed<double, 9 * balls> turned;
    turn_matrices<double>(charts, delta_.data(), turned.data());
    const double by_speed = h_ / 2, by_place = h_ * h_ / 4;
    for (std::size_t i = 0; i < all; ++i) {
      for (std::size_t k = Places::starts[i]; i < n && k < Places::middles[i]; ++k) {
        const std::size_t column = Places::columns[k];
        if (column >= Balance::first_input) continue;
        if (column < Balance::first_speed && Balance::turns(column)) continue;
        const bool is_speed = column >= Balance::first_speed;
        const std::size_t place = at(i, is_speed ? column - Balance::first_speed : Balance::unknown_of(column));
        const double share = (is_speed ? by_speed : by_place) * rule_[Places::derivatives[k]];
        rule[place] += share, projections[place] += share;
      }
      for (std::size_t k = Places::middles[i]; k < Places::starts[i + 1]; ++k) {
        const std::size_t column = Places::columns[k] - Balance::first_acceleration;
        const double derivative = (i < n ? rule_ : end_)[Places::derivatives[k]];
        projections[at(i, column)] += derivative;
        if (i < n || column >= n || !is_turn(charts, column)) rule[at(i, column)] += derivative;
      }
      if (i >= n) rule[at(i, i)] -= balance.gives_way(i - n), projections[at(i, i)] -= balance.gives_way(i - n);
    }
    if constexpr (balls > 0) put_balls(charts, from, turned.data());
    const bool is_regular = matrix_.decompose(Matrix::everywhere);
    return projections_.decompose(Matrix::everywhere) && is_regular;
  }

  static bool is_turn(std::span<const Chart> charts, std::size_t speed) {
    for (const Chart& chart : charts)
      if (chart.ball && speed >= static_cast<std::size_t>(chart.v + chart.scalars) && speed < static_cast<std::size_t>(chart.v + chart.scalars + 3)) return true;
    return false;
  }

  /// What depends on turns of balls.
  void put_balls(std::span<const Chart> charts, const double* from, const double* turned) {
    auto &rule = matrix_.entries(), &projections = projections_.entries();
    for (const Chart& chart : charts) {
      if (!chart.ball) continue;
      const auto e = static_cast<std::size_t>(chart.q + chart.scalars), w = static_cast<std::size_t>(chart.v + chart.scalars);
      const BallDerivatives turn = turn_derivatives(from + e, delta_.data() + w);
      for (std::size_t i = 0; i < n; ++i)
        for (std::size_t k = Places::starts[i]; k < Places::middles[i]; ++k)
          if (const std::size_t column = Places::columns[k]; column >= e && column < e + 4)
            for (std::size_t l = 0; l < 3; ++l) {
              const double share = h_ * h_ / 4 * rule_[Places::derivatives[k]] * turn.by[column - e][4 + l];
              rule[Matrix::places.of(i, w + l)] += share, projections[Matrix::places.of(i, w + l)] += share;
            }
      for_curvatures([&](std::size_t row, std::size_t k, std::size_t column) {
        if (column >= w && column < w + 3)
          for (std::size_t l = 0; l < 3; ++l) rule[Matrix::places.of(row, w + l)] += end_[k] * turned[3 * (column - w) + l];
      });
      turned += 9;
    }
  }

  static constexpr std::size_t balls = Balance::balls;

  double h_ = 0.0;
  Fixed<double, n> delta_;
  typename Balance::OfDerivatives rule_, end_, accelerations_, speeds_;  ///< what leads to the end, there, and of tangents times the moves of projections
  Matrix matrix_, projections_;  ///< of what leads to the end, and of projections
};

}  // namespace cutjoint
