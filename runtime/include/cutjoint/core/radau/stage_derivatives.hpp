// Derivatives of the stages of a step by Radau IIA, by the force residuals in them.
#pragma once

#include "cutjoint/core/numbers/bordered.hpp"
#include "cutjoint/core/numbers/dense.hpp"
#include "cutjoint/core/radau/table.hpp"
#include "cutjoint/core/mechanism/transposed_charts.hpp"

namespace cutjoint::radau {

/// A weight of the table: of stage j in stage i, both counted from 0; `twice` is the matrix's square.
constexpr double weight(std::size_t i, std::size_t j) { return Table::weights[i + 1][j + 1].as<double>(); }
inline constexpr auto twice = [] {
  std::array<std::array<double, Table::stages>, Table::stages> found{};
  for (std::size_t i = 0; i < Table::stages; ++i)
    for (std::size_t j = 0; j < Table::stages; ++j)
      for (std::size_t k = 0; k < Table::stages; ++k) found[i][j] += weight(i, k) * weight(k, j);
  return found;
}();

/// Derivatives of the rotation vectors of a ball in all stages, theta_i = h sum_j A_ij rho(theta_j, omega_j), with respect to angular velocities and h.
struct BallStages {
  static constexpr std::size_t size = 3 * Table::stages;

  double by_omega[size][size], by_length[size];
  double quaternion_by_vdot[Table::stages][4][size];  ///< quaternions by accelerations

  /// Evaluate them from vectors and angular velocities, by stage and component, in a step of length h.
  void find(double h, auto theta, auto omega) {
    constexpr Chart here{0, 0, 0, true};
    std::array<double, size * size> matrix;
    std::array<std::size_t, size> order;
    std::array<DualPart, size> right[2]{}, room;
    for (std::size_t j = 0; j < Table::stages; ++j) {
      Dual at[3], by[3], rate[3];
      for (std::size_t k = 0; k < 3; ++k) {
        at[k] = theta(j, k), at[k].derivative[k] = 1.0;
        by[k] = omega(j, k), by[k].derivative[3 + k] = 1.0;
      }
      chart_rates<Dual>(std::span(&here, 1), at, by, rate);
      for (std::size_t i = 0; i < Table::stages; ++i)
        for (std::size_t k = 0; k < 3; ++k) {
          const std::size_t row = 3 * i + k;
          right[size / seeds_at_once][row].derivative[size % seeds_at_once] += weight(i, j) * rate[k].value;
          for (std::size_t c = 0; c < 3; ++c) {
            const std::size_t column = 3 * j + c;
            matrix[column * size + row] = (row == column ? 1.0 : 0.0) - h * weight(i, j) * rate[k].derivative[c];
            right[column / seeds_at_once][row].derivative[column % seeds_at_once] = h * weight(i, j) * rate[k].derivative[3 + c];
          }
        }
    }
    dense::Triangles<double> triangles({matrix.data(), size, size}, order.data());
    triangles.decompose();
    for (auto& columns : right) triangles.solve(columns.data(), room.data());
    for (std::size_t i = 0; i < size; ++i) {
      for (std::size_t j = 0; j < size; ++j) by_omega[i][j] = right[j / seeds_at_once][i].derivative[j % seeds_at_once];
      by_length[i] = right[size / seeds_at_once][i].derivative[size % seeds_at_once];
    }
  }
};

/// Derivatives of r(q_i, v_i, a_i, lambda_i) = 0, a `ForceResidual`, in all stages i of a step of length h, and the formula (derivatives/rule_derivatives.hpp)
///
///     v_i = v_0 + h sum_j A_ij a_j         delta_i = h sum_j A_ij T(delta_j)^-1 v_j         q_i = retract(q_0, delta_i)
///
/// with the matrix of both over accelerations and multipliers of all stages, decomposed by blocks like that of one.
template <class ForceResidual>
class StageDerivatives {
 public:
  static constexpr std::size_t stages = Table::stages, n = ForceResidual::n, m = ForceResidual::m, coordinates = ForceResidual::coordinates, unknowns = n + m;

  /// Evaluate at the stages, with `find(i)` called before each; false if the matrix is singular.
  bool find(ForceResidual& force_residual, double h, const auto& from, const auto& points, auto find) {
    h_ = h;
    for (std::size_t i = 0; i < stages; ++i) {
      find(i);
      force_residual.find(points[i], derivative_[i]);
      displacement<double>(ForceResidual::charts(), from.q.data(), points[i].q.data(), delta_[i].data());
      retraction_[i] = {ForceResidual::charts(), from.q.data(), delta_[i].data()};
      for (std::size_t l = 0; l < coordinates; ++l) q_[i][l].value = points[i].q[l];
      for (std::size_t l = 0; l < n; ++l) {  // sums over stages: differences over a short step would be rounding
        v_[i][l].value = points[i].v[l], accelerations_[i][l] = speeds_[i][l] = 0.0;
        for (std::size_t j = 0; j < stages; ++j) accelerations_[i][l] += weight(i, j) * points[j].vdot[l], speeds_[i][l] += weight(i, j) * points[j].v[l];
      }
      for (const Chart& chart : ForceResidual::charts())
        for (int k = chart.v; k < chart.v + chart.scalars; ++k) delta_[i][static_cast<std::size_t>(k)] = h * speeds_[i][static_cast<std::size_t>(k)];
    }
    for_balls([&](auto place, std::size_t at) {
      BallStages& ball = balls_[place] = {};
      ball.find(h, [&](std::size_t i, std::size_t k) { return delta_[i][at + k]; }, [&](std::size_t i, std::size_t k) { return points[i].v[at + k]; });
      for (std::size_t i = 0; i < BallStages::size; ++i)
        for (std::size_t j = 0; j < BallStages::size; ++j) {
          double theta = 0.0;
          for (std::size_t l = 0; l < stages; ++l) theta += ball.by_omega[i][3 * l + j % 3] * h * weight(l, j / 3);
          for (std::size_t c = 0; c < 4; ++c) ball.quaternion_by_vdot[i / 3][c][j] += retraction_[i / 3][place].by[c][4 + i % 3] * theta;
        }
    });
    return decompose(force_residual) || decompose(force_residual);  // with other pivots if those of an earlier matrix have become small
  }

  /// Derivatives of coordinates and velocities of the stages for constant accelerations, from those of the step's start and length.
  template <class Q, class V>
  void begin_jvp(const Q& q, const V& v, const V&, const V&, const Tangents& length) {
    shift_ = Fixed<Dual, n>();
    for (std::size_t i = 0; i < stages; ++i) {
      for (std::size_t l = 0; l < n; ++l) v_[i][l].derivative = v[l].derivative + accelerations_[i][l] * length;
      for (std::size_t l = 0; l < coordinates; ++l) q_[i][l].derivative = q[l].derivative;
    }
    move(v_, length, true);
  }

  /// Add the terms of accelerations; coordinates and velocities become those of the last stage.
  void end_jvp(const DualPart* change, auto& q, auto& v) {
    std::array<Fixed<DualPart, n>, stages> more;
    for (std::size_t i = 0; i < stages; ++i)
      for (std::size_t l = 0; l < n; ++l) {
        for (std::size_t j = 0; j < stages; ++j) more[i][l] += h_ * weight(i, j) * change[j * unknowns + l];
        v_[i][l].derivative += more[i][l].derivative;
      }
    move(more, {}, false);
    q = q_.back(), v = v_.back();
  }

  /// From derivatives with respect to coordinates and velocities of the stages to those with respect to the step's start; those with respect to accelerations are added.
  template <class Q, class V, class Point>
  void vjp(const std::array<Q, stages>& by_q, std::array<V, stages> by_v, Point& begun, std::array<V, stages>& by_vdot) const {
    std::array<V, stages> by_delta{};
    for (std::size_t i = 0; i < stages; ++i) retraction_[i].vjp(ForceResidual::charts(), by_q[i].data(), begun.q.data(), by_delta[i].data());
    for (const Chart& chart : ForceResidual::charts())
      for (int k = 0; k < chart.scalars; ++k)
        for (std::size_t i = 0; i < stages; ++i)
          for (std::size_t j = 0; j < stages; ++j) by_v[j][static_cast<std::size_t>(chart.v + k)] += h_ * weight(i, j) * by_delta[i][static_cast<std::size_t>(chart.v + k)];
    for_balls([&](auto place, std::size_t at) {
      for (std::size_t i = 0; i < BallStages::size; ++i)
        for (std::size_t j = 0; j < BallStages::size; ++j) by_v[j / 3][at + j % 3] += balls_[place].by_omega[i][j] * by_delta[i / 3][at + i % 3];
    });
    for (std::size_t i = 0; i < stages; ++i)
      for (std::size_t l = 0; l < n; ++l) {
        begun.v[l] += by_v[i][l];
        for (std::size_t j = 0; j < stages; ++j) by_vdot[j][l] += h_ * weight(i, j) * by_v[i][l];
      }
  }

  /// Visit each unknown of stage j that a coordinate or velocity in stage i depends on, with the partial derivative.
  template <class Residual, class Use>
  void visit_weights(std::size_t column, std::size_t i, std::size_t j, Use use) const {
    if (column >= ForceResidual::first_speed) return use(column - ForceResidual::first_speed, h_ * weight(i, j));
    const std::size_t unknown = ForceResidual::unknown_of(column);
    if (!ForceResidual::is_quaternion(column)) return use(unknown, h_ * h_ * twice[i][j]);
    if constexpr (balls > 0) {
      const auto [ball, c] = ForceResidual::ball_of(column);
      for (std::size_t k = 0; k < 3; ++k) use(unknown + k, balls_[ball].quaternion_by_vdot[i][c][3 * j + k]);
    }
  }

  const typename ForceResidual::JacobianEntries& derivative(std::size_t stage) const { return derivative_[stage]; }
  const auto& matrix() const { return matrix_; }
  const auto& q(std::size_t stage) const { return q_[stage]; }
  const auto& v(std::size_t stage) const { return v_[stage]; }
  const Fixed<Dual, n>& shift() const { return shift_; }  ///< the displacement of the step

 private:
  using Places = typename ForceResidual::Places;

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

  static constexpr std::size_t balls = ForceResidual::has_balls ? ForceResidual::balls : 0;

  /// Add derivatives of coordinates of the stages through velocities in all of them, and through the length.
  void move(const auto& speeds, const Tangents& length, bool from_start) {
    for (std::size_t i = 0; i < stages; ++i) {
      std::array<DualPart, n> delta;
      for (std::size_t l = 0; l < n; ++l) {
        delta[l].derivative = speeds_[i][l] * length;
        for (std::size_t j = 0; j < stages; ++j) delta[l].derivative += h_ * weight(i, j) * speeds[j][l].derivative;
      }
      for_balls([&](auto place, std::size_t at) {
        for (std::size_t k = 0; k < 3; ++k) {
          Tangents& theta = delta[at + k].derivative = balls_[place].by_length[3 * i + k] * length;
          for (std::size_t j = 0; j < BallStages::size; ++j) theta += balls_[place].by_omega[3 * i + k][j] * speeds[j / 3][at + j % 3].derivative;
        }
      });
      retraction_[i].jvp(ForceResidual::charts(), delta, q_[i], from_start);
      for (std::size_t l = 0; i + 1 == stages && l < n; ++l) shift_[l] = {delta_[i][l], shift_[l].derivative + delta[l].derivative};
    }
  }

  /// Visit each ball: its index, and the first index of its angular velocity.
  static void for_balls([[maybe_unused]] auto use) {
    if constexpr (balls > 0) {
      std::size_t place = 0;
      for (const Chart& chart : ForceResidual::charts())
        if (chart.ball) use(place++, static_cast<std::size_t>(chart.v + chart.scalars));
    }
  }

  bool decompose(const ForceResidual& force_residual) {
    auto& entries = matrix_.entries();
    const auto at = [](std::size_t i, std::size_t row, std::size_t j, std::size_t unknown) { return Matrix::places.of(i * unknowns + row, j * unknowns + unknown); };
    entries.fill(0.0);
    for (std::size_t i = 0; i < stages; ++i) {
      force_residual.gather_entries(*this, i, derivative_[i], unknowns, [&](std::size_t row, std::size_t j, std::size_t unknown, double x) { entries[at(i, row, j, unknown)] += x; });
      for (std::size_t l = 0; l < m; ++l) entries[at(i, n + l, i, n + l)] -= force_residual.compliance(l);
    }
    return matrix_.decompose(Matrix::everywhere);
  }

  double h_ = 0.0;
  std::array<typename ForceResidual::JacobianEntries, stages> derivative_;
  std::array<Fixed<double, n>, stages> delta_, speeds_, accelerations_;  ///< displacements, and averages of velocities and accelerations up to the stages
  std::array<RetractionDerivatives<balls>, stages> retraction_;
  std::array<Fixed<Dual, coordinates>, stages> q_;
  std::array<Fixed<Dual, n>, stages> v_;
  Fixed<Dual, n> shift_;
  std::array<BallStages, balls> balls_;
  Matrix matrix_;
};

}  // namespace cutjoint::radau
