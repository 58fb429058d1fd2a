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

namespace cutjoint {

/// Slopes by `Balance` of all that Newton's iteration leaves at the end of a step of length h.  With accelerations a and multipliers that lead to coordinates q
/// and speeds v, and a momentum and accelerations that projections in the norm of the masses leave, these are
///
///     f(q, v, a, lambda) = 0    Phi(q) = 0        M (v_1 - v) + Phi_q^T mu = 0    Phid(q, v_1) = 0        f(q, v, vdot, lambda_1) = 0    Phidd(q, v_1, vdot) = 0
///
/// f being the balance of forces, which is affine in accelerations and multipliers.
template <class Balance>
class ClosedEndSlopes {
 public:
  static constexpr std::size_t n = Balance::n, m = Balance::m, coordinates = Balance::coordinates, all = n + m;
  using Changes = typename Balance::Changes;
  using Columns = Fixed<double, Balance::first_acceleration>;

  /// Of a step from coordinates; `rule` has what leads to its end, in which the balance is.  False where a matrix is singular.
  template <class State>
  bool find(Balance& balance, double h, std::span<const Chart> charts, const double* from, const State& rule, const State& end) {
    h_ = h;
    displacement<double>(charts, from, rule.q.data(), delta_.data());
    balance.find(rule, rule_);
    balance.find(end, end_);
    if (!decompose(balance, charts, from)) return false;
    Changes pushed, moved;
    for_curvatures([&](std::size_t row, std::size_t k, std::size_t column) {
      pushed[row].slope[0] += end_[k] * (end.vdot[column] - rule.vdot[column]);
      moved[row].slope[0] += end_[k] * (end.v[column] - rule.v[column]);
    });
    if (!balance.solve(masses_, pushed) || !balance.solve(masses_, moved)) return false;
    State at = rule;
    at.vdot = end.vdot;
    for (std::size_t i = 0; i < m; ++i) at.lambda[i] += pushed[n + i].slope[0];
    balance.find(at, forces_);
    const double scale = 2 / h;
    at = end;
    for (std::size_t i = 0; i < n; ++i) at.vdot[i] += scale * moved[i].slope[0];
    for (std::size_t i = 0; i < m; ++i) at.lambda[i] += scale * moved[n + i].slope[0];
    balance.find(at, momentum_);
    for (std::size_t k = 0; k < momentum_.size(); ++k) momentum_[k] = (momentum_[k] - end_[k]) / scale;
    return true;
  }

  /// Accelerations and multipliers that lead to the end, where loops open by `gaps` along directions without their changes.
  template <class Q, class V, class Inputs, class Held>
  bool solve_rule(Balance& balance, const Q& q, const V& v, const Fixed<Dual, m>& gaps, const Inputs& du, const Held& held, Changes& change) const {
    balance.lose(rule_, q, v, du, held, change.data());
    for (std::size_t i = 0; i < m; ++i) change[n + i].slope = -4 / (h_ * h_) * gaps[i].slope;
    return balance.solve(matrix_, change);
  }

  /// How speeds change by their projection, whose rates of loops open by `gaps` along directions without it.
  template <class Q, class V, class Inputs, class Held>
  bool solve_speeds(Balance& balance, const Q& q, const V& v, const Fixed<Dual, m>& gaps, const Inputs& du, const Held& held, Changes& change) const {
    balance.lose(momentum_, q, v, du, held, change.data());
    for (std::size_t i = 0; i < m; ++i) change[n + i].slope = -gaps[i].slope;
    return balance.solve(masses_, change);
  }

  /// Accelerations at the end, by speeds before and behind their projection.
  template <class Q, class V, class Inputs, class Held>
  bool solve_accelerations(Balance& balance, const Q& q, const V& v, const V& projected, const Inputs& du, const Held& held, Changes& change) const {
    Changes curvature;
    balance.lose(forces_, q, v, du, held, change.data());
    balance.lose(end_, q, projected, du, held, curvature.data());
    std::copy_n(curvature.begin() + n, m, change.begin() + n);
    return balance.solve(masses_, change);
  }

  /// From slopes by accelerations at the end to those by all that `lose` reads, with speeds before their projection, and behind it.
  bool pull_accelerations(const Balance& balance, const Fixed<double, n>& by_vdot, Columns& by, Columns& by_projected) const {
    Fixed<double, all> x;
    std::copy(by_vdot.begin(), by_vdot.end(), x.begin());
    if (!balance.solve_transposed(masses_, x)) return false;
    Fixed<double, all> loops;
    std::copy_n(x.begin() + n, m, loops.begin() + n);
    std::fill_n(x.begin() + n, m, 0.0);
    balance.pull(forces_, x.data(), by);
    balance.pull(end_, loops.data(), by_projected);
    return true;
  }

  /// From slopes by projected speeds to those by all that `lose` reads, and by gaps of the rates of loops.
  bool pull_speeds(const Balance& balance, const Fixed<double, n>& by_v, Columns& by, Fixed<double, m>& by_gap) const {
    return pull(balance, masses_, momentum_, by_v, {}, -1.0, by, by_gap);
  }

  /// From slopes by accelerations and multipliers that lead to the end to those by all that `lose` reads, and by gaps of loops.
  bool pull_rule(const Balance& balance, const Fixed<double, n>& by_a, const Fixed<double, m>& by_lambda, Columns& by, Fixed<double, m>& by_gap) const {
    return pull(balance, matrix_, rule_, by_a, by_lambda, -4 / (h_ * h_), by, by_gap);
  }

  const double* delta() const { return delta_.data(); }

 private:
  using Places = typename Balance::Places;
  using Matrix = Bordered<Places>;

  bool pull(const Balance& balance, const Matrix& matrix, const typename Balance::OfSlopes& slope, const Fixed<double, n>& by_x, const Fixed<double, m>& by_lambda,
            double scale, Columns& by, Fixed<double, m>& by_gap) const {
    Fixed<double, all> x;
    std::copy(by_lambda.begin(), by_lambda.end(), std::copy(by_x.begin(), by_x.end(), x.begin()));
    if (!balance.solve_transposed(matrix, x)) return false;
    for (std::size_t i = 0; i < m; ++i) by_gap[i] = scale * x[n + i], x[n + i] = 0.0;
    balance.pull(slope, x.data(), by);
    return true;
  }

  /// Slopes by accelerations of the second rates of loops, which are those of loops by displacements: the row, the place of the slope, and the acceleration.
  template <class Use>
  static void for_curvatures(Use use) {
    for (std::size_t i = n; i < all; ++i)
      for (std::size_t k = Places::middles[i]; k < Places::starts[i + 1]; ++k)
        if (Places::columns[k] < Balance::first_multiplier) use(i, k, Places::columns[k] - Balance::first_acceleration);
  }

  bool decompose(const Balance& balance, std::span<const Chart> charts, const double* from) {
    auto &rule = matrix_.entries(), &masses = masses_.entries();
    const auto at = [](std::size_t i, std::size_t j) { return Matrix::places.of(i, j); };
    rule.fill(0.0), masses.fill(0.0);
    Fixed<double, 9 * balls> turned;
    turn_matrices<double>(charts, delta_.data(), turned.data());
    const double by_speed = h_ / 2, by_place = h_ * h_ / 4;
    for (std::size_t i = 0; i < all; ++i) {
      for (std::size_t k = Places::starts[i]; i < n && k < Places::middles[i]; ++k) {
        const std::size_t column = Places::columns[k];
        if (column >= Balance::first_input) continue;
        if (column >= Balance::first_speed) rule[at(i, column - Balance::first_speed)] += by_speed * rule_[k];
        else if (!Balance::turns(column)) rule[at(i, Balance::unknown_of(column))] += by_place * rule_[k];
      }
      for (std::size_t k = Places::middles[i]; k < Places::starts[i + 1]; ++k) {
        const std::size_t column = Places::columns[k] - Balance::first_acceleration;
        masses[at(i, column)] += end_[k];
        if (i < n || column >= n || !is_turn(charts, column)) rule[at(i, column)] += (i < n ? rule_ : end_)[k];
      }
      if (i >= n) rule[at(i, i)] -= balance.gives_way(i - n), masses[at(i, i)] -= balance.gives_way(i - n);
    }
    if constexpr (balls > 0) put_balls(charts, from, turned.data(), rule);
    return matrix_.decompose() && masses_.decompose();
  }

  static bool is_turn(std::span<const Chart> charts, std::size_t speed) {
    for (const Chart& chart : charts)
      if (chart.ball && speed >= static_cast<std::size_t>(chart.v + chart.scalars) && speed < static_cast<std::size_t>(chart.v + chart.scalars + 3)) return true;
    return false;
  }

  /// What depends on turns of balls.
  template <class Entries>
  void put_balls(std::span<const Chart> charts, const double* from, const double* turned, Entries& rule) const {
    for (const Chart& chart : charts) {
      if (!chart.ball) continue;
      const auto e = static_cast<std::size_t>(chart.q + chart.scalars), w = static_cast<std::size_t>(chart.v + chart.scalars);
      Dual begun[4], theta[3], to[4];
      for (std::size_t c = 0; c < 4; ++c) begun[c] = from[e + c];
      for (std::size_t k = 0; k < 3; ++k) theta[k] = delta_[w + k], theta[k].slope[k] = h_ * h_ / 4;
      cutjoint::turn<Dual>(begun, theta, to);
      for (std::size_t i = 0; i < n; ++i)
        for (std::size_t k = Places::starts[i]; k < Places::middles[i]; ++k)
          if (const std::size_t column = Places::columns[k]; column >= e && column < e + 4)
            for (std::size_t l = 0; l < 3; ++l) rule[Matrix::places.of(i, w + l)] += rule_[k] * to[column - e].slope[l];
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
  typename Balance::OfSlopes rule_, end_, forces_, momentum_;
  Matrix matrix_, masses_;  ///< of what leads to the end, and of masses and loops there
};

}  // namespace cutjoint
