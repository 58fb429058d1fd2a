// How the stages of a step by Radau IIA change along directions, by the balances of forces in them.
#pragma once

#include <array>
#include <cstddef>
#include <span>

#include "cutjoint/core/numbers/arrays.hpp"
#include "cutjoint/core/numbers/bordered.hpp"
#include "cutjoint/core/numbers/dense.hpp"
#include "cutjoint/core/numbers/dual.hpp"
#include "cutjoint/core/mechanism/mechanism.hpp"
#include "cutjoint/core/radau/table.hpp"
#include "cutjoint/core/mechanism/retraction.hpp"
#include "cutjoint/core/mechanism/transposed_charts.hpp"

namespace cutjoint::radau {

/// A weight of the table: what the stage j adds to the stage i, both counted from 0, for a step of length 1.
inline double weight(std::size_t i, std::size_t j) { return Table::weights[i + 1][j + 1].as<double>(); }

/// How the rotation vectors of a ball in all stages, theta_i = h sum_j A_ij rho(theta_j, omega_j), follow from angular velocities in all of them, and from h.
struct BallStages {
  static constexpr std::size_t size = 3 * Table::stages;

  double by_omega[size][size], by_length[size];

  /// Of the vectors and angular velocities in a step of length h.
  void find(double h, const double (&theta)[size], const double (&omega)[size]) {
    constexpr Chart here{0, 0, 0, true};
    std::array<double, size * size> matrix;
    std::array<std::size_t, size> order;
    std::array<Along, size> right[2]{}, room;
    for (std::size_t j = 0; j < Table::stages; ++j) {
      Dual at[3], by[3], rate[3];
      for (std::size_t k = 0; k < 3; ++k) {
        at[k] = theta[3 * j + k], at[k].derivative[k] = 1.0;
        by[k] = omega[3 * j + k], by[k].derivative[3 + k] = 1.0;
      }
      chart_rates<Dual>(std::span(&here, 1), at, by, rate);
      for (std::size_t i = 0; i < Table::stages; ++i)
        for (std::size_t k = 0; k < 3; ++k) {
          const std::size_t row = 3 * i + k;
          right[size / directions][row].derivative[size % directions] += weight(i, j) * rate[k].value;
          for (std::size_t c = 0; c < 3; ++c) {
            const std::size_t column = 3 * j + c;
            matrix[column * size + row] = (row == column ? 1.0 : 0.0) - h * weight(i, j) * rate[k].derivative[c];
            right[column / directions][row].derivative[column % directions] = h * weight(i, j) * rate[k].derivative[3 + c];
          }
        }
    }
    dense::Triangles<double> triangles({matrix.data(), size, size}, order.data());
    triangles.decompose();
    for (auto& columns : right) triangles.solve(columns.data(), room.data());
    for (std::size_t i = 0; i < size; ++i) {
      for (std::size_t j = 0; j < size; ++j) by_omega[i][j] = right[j / directions][i].derivative[j % directions];
      by_length[i] = right[size / directions][i].derivative[size % directions];
    }
  }
};

/// Slopes by `Balance` of r(q_i, v_i, a_i, lambda_i) = 0 in all stages i of a step of length h, with a matrix of
///
///     v_i = v_0 + h sum_j A_ij a_j         delta_i = h sum_j A_ij T(delta_j)^-1 v_j         q_i = retract(q_0, delta_i)
///
/// over the accelerations and multipliers of all of them, which decomposes as that of one does.
template <class Balance>
class StageDerivatives {
 public:
  static constexpr std::size_t stages = Table::stages, n = Balance::n, m = Balance::m, coordinates = Balance::coordinates, unknowns = n + m;
  using Changes = Fixed<Along, stages * unknowns>;
  using DualPlaces = std::array<Fixed<Dual, coordinates>, stages>;
  using DualSpeeds = std::array<Fixed<Dual, n>, stages>;

  /// Of the stages, in which the balance is, `find(i)` being called before; false where the matrix is singular.
  template <class Points, class Find>
  bool find(Balance& balance, double h, std::span<const Chart> charts, const double* from, const Points& points, Find find) {
    for (std::size_t i = 0; i < stages; ++i) {
      find(i);
      balance.find(points[i], derivative_[i]);
      displacement<double>(charts, from, points[i].q.data(), delta_[i].data());
    }
    find_balls(h, charts, from, points);
    return decompose(balance, h) || decompose(balance, h);  // with other pivots where those of a matrix before have become small
  }

  /// Displacements, coordinates and speeds of the stages by coordinates and speeds of the step's start and by accelerations.
  template <class Q, class V>
  void lead(const Dual& h, std::span<const Chart> charts, const Q& from, const V& speeds, const DualSpeeds& derivatives, DualSpeeds& delta, DualPlaces& q, DualSpeeds& v) const {
    for (std::size_t i = 0; i < stages; ++i) {
      v[i] = speeds;
      for (std::size_t j = 0; j < stages; ++j)
        for (std::size_t l = 0; l < n; ++l) v[i][l] += weight(i, j) * h * derivatives[j][l];
    }
    for (std::size_t i = 0; i < stages; ++i) {
      delta[i].fill(Dual());
      for (std::size_t j = 0; j < stages; ++j)
        for (std::size_t l = 0; l < n; ++l) delta[i][l] += weight(i, j) * h * v[j][l];
    }
    for_balls(charts, [&](auto place, std::size_t, std::size_t at) {
      const BallStages& ball = balls_[place];
      for (std::size_t i = 0; i < stages; ++i)
        for (std::size_t k = 0; k < 3; ++k) {
          Dual& theta = delta[i][at + k] = {delta_[i][at + k], h.derivative * ball.by_length[3 * i + k]};
          for (std::size_t j = 0; j < stages; ++j)
            for (std::size_t c = 0; c < 3; ++c) theta.derivative += ball.by_omega[3 * i + k][3 * j + c] * v[j][at + c].derivative;
        }
    });
    for (std::size_t i = 0; i < stages; ++i) retract<Dual>(charts, from.data(), delta[i].data(), q[i].data());
  }

  /// Slopes by coordinates and speeds of the step's start, added, and by accelerations, from those by coordinates and speeds of the stages.
  template <class Q, class V>
  void vjp(double h, std::span<const Chart> charts, const double* from, const std::array<Q, stages>& by_q, std::array<V, stages> by_v, Q& by_from, V& by_speeds,
            std::array<V, stages>& by_derivatives) const {
    std::array<V, stages> by_delta{};
    for (std::size_t i = 0; i < stages; ++i) RetractionDerivatives<balls>(charts, from, delta_[i].data()).vjp(by_q[i].data(), by_from.data(), by_delta[i].data());
    for (const Chart& chart : charts)
      for (int k = 0; k < chart.scalars; ++k)
        for (std::size_t i = 0; i < stages; ++i)
          for (std::size_t j = 0; j < stages; ++j) by_v[j][static_cast<std::size_t>(chart.v + k)] += h * weight(i, j) * by_delta[i][static_cast<std::size_t>(chart.v + k)];
    for_balls(charts, [&](auto place, std::size_t, std::size_t at) {
      for (std::size_t i = 0; i < BallStages::size; ++i)
        for (std::size_t j = 0; j < BallStages::size; ++j) by_v[j / 3][at + j % 3] += balls_[place].by_omega[i][j] * by_delta[i / 3][at + i % 3];
    });
    for (std::size_t i = 0; i < stages; ++i)
      for (std::size_t l = 0; l < n; ++l) {
        by_speeds[l] += by_v[i][l];
        for (std::size_t j = 0; j < stages; ++j) by_derivatives[j][l] += h * weight(i, j) * by_v[i][l];
      }
  }

  /// What the balance of a stage gains by changes of accelerations and multipliers in it.
  template <class Vdot, class Lambda>
  void gain(std::size_t stage, const Vdot& vdot, const Lambda& lambda, Along* rows) const {
    for (std::size_t i = 0; i < unknowns; ++i) {
      rows[i] = {};
      for (std::size_t k = Places::middles[i]; k < Places::starts[i + 1]; ++k) {
        const std::size_t column = Places::columns[k] - Balance::first_acceleration;
        rows[i].derivative += derivative_[stage][Places::derivatives[k]] * (column < n ? vdot[column].derivative : lambda[column - n].derivative);
      }
    }
  }

  const typename Balance::OfDerivatives& derivative(std::size_t stage) const { return derivative_[stage]; }
  const auto& matrix() const { return matrix_; }

 private:
  using Places = typename Balance::Places;

  /// The parts of the unknowns of all stages.
  struct Stacked {
    static constexpr auto parts = [] {
      std::array<std::size_t, stages * unknowns> all{};
      for (std::size_t i = 0; i < all.size(); ++i) all[i] = Places::parts[i % unknowns];
      return all;
    }();
    static constexpr auto& beside = Places::beside;
  };
  using Matrix = Bordered<Stacked>;

  static constexpr std::size_t balls = Balance::has_balls ? Balance::balls : 0;

  /// The change of a quaternion in a stage by accelerations in another.
  struct Turn {
    double by[4][3];
  };

  /// Each ball: its number, and where its quaternion and its angular velocity begin.
  template <class Use>
  static void for_balls([[maybe_unused]] std::span<const Chart> charts, [[maybe_unused]] Use use) {
    if constexpr (balls > 0) {
      std::size_t place = 0;
      for (const Chart& chart : charts)
        if (chart.ball) use(place++, static_cast<std::size_t>(chart.q + chart.scalars), static_cast<std::size_t>(chart.v + chart.scalars));
    }
  }

  template <class Points>
  void find_balls(double h, std::span<const Chart> charts, const double* from, const Points& points) {
    for_balls(charts, [&](auto place, std::size_t e, std::size_t at) {
      double theta[BallStages::size], omega[BallStages::size];
      for (std::size_t i = 0; i < stages; ++i)
        for (std::size_t k = 0; k < 3; ++k) theta[3 * i + k] = delta_[i][at + k], omega[3 * i + k] = points[i].v[at + k];
      balls_[place].find(h, theta, omega);
      for (std::size_t j = 0; j < stages; ++j)
        for (std::size_t i = 0; i < stages; ++i) {
          const BallDerivatives turn = turn_derivatives(from + e, delta_[i].data() + at);
          Turn& by = turns_[place][i][j] = {};
          for (std::size_t k = 0; k < 3; ++k)
            for (std::size_t c = 0; c < 3; ++c) {
              double theta = 0.0;
              for (std::size_t l = 0; l < stages; ++l) theta += balls_[place].by_omega[3 * i + k][3 * l + c] * h * weight(l, j);
              for (std::size_t row = 0; row < 4; ++row) by.by[row][c] += turn.by[row][4 + k] * theta;
            }
        }
    });
  }

  bool decompose(const Balance& balance, double h) {
    auto& entries = matrix_.entries();
    entries.fill(0.0);
    for (std::size_t i = 0; i < stages; ++i)
      for (std::size_t row = 0; row < unknowns; ++row) {
        const auto add = [&](std::size_t j, std::size_t column, double share) { entries[Matrix::places.of(i * unknowns + row, j * unknowns + column)] += share; };
        for (std::size_t k = Places::starts[row]; k < Places::middles[row]; ++k) {
          const std::size_t column = Places::columns[k];
          if (column >= Balance::first_input) continue;
          for (std::size_t j = 0; j < stages; ++j) add_state(balance, column, i, j, h, derivative_[i][Places::derivatives[k]], [&](std::size_t at, double share) { add(j, at, share); });
        }
        for (std::size_t k = Places::middles[row]; k < Places::starts[row + 1]; ++k) add(i, Places::columns[k] - Balance::first_acceleration, derivative_[i][Places::derivatives[k]]);
        if (row >= n) add(i, row, -balance.yields(row - n));
      }
    return matrix_.decompose(Matrix::everywhere);
  }

  /// Shares of a slope by a coordinate or a speed in stage i, by the accelerations of stage j.
  template <class Add>
  void add_state(const Balance&, std::size_t column, std::size_t i, std::size_t j, double h, double derivative, Add add) const {
    if (column >= Balance::first_speed) return add(column - Balance::first_speed, derivative * h * weight(i, j));
    const std::size_t unknown = Balance::unknown_of(column);
    if (!Balance::turns(column)) {
      double twice = 0.0;
      for (std::size_t k = 0; k < stages; ++k) twice += weight(i, k) * weight(k, j);
      return add(unknown, derivative * h * h * twice);
    }
    if constexpr (balls > 0) {
      const auto [ball, c] = Balance::ball_of(column);
      for (std::size_t k = 0; k < 3; ++k) add(unknown + k, derivative * turns_[ball][i][j].by[c][k]);
    }
  }

  std::array<typename Balance::OfDerivatives, stages> derivative_;
  std::array<Fixed<double, n>, stages> delta_;
  std::array<BallStages, balls> balls_;
  std::array<std::array<std::array<Turn, stages>, stages>, balls> turns_;
  Matrix matrix_;
};

}  // namespace cutjoint::radau
