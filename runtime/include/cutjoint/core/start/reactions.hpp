// Reaction forces of prescribed coordinates of a mechanism at rest.
#pragma once

#include "cutjoint/core/numbers/dense.hpp"
#include "cutjoint/core/mechanism/state.hpp"

namespace cutjoint {

/// A mechanism with a kinetic energy.
template <class M>
concept Weighable = requires(M& m, const typename M::real_type* in, typename M::real_type* out) { m.energy(in, in, in, in, out); };

/// Forces along prescribed coordinates of a mechanism at rest that prevent their acceleration.
///
/// They change accelerations a, which keep the loops closed, by Gauss's principle of least constraint (1829): (a' - a)^T M (a' - a) is minimal
/// among all a' that keep the loops closed with a'_i = 0 for each prescribed i. The columns of N are M-orthonormal and keep the loops closed. Then
/// a' = a + N y for the shortest y with (N y)_i = -a_i. M is known from the kinetic energy T(v) = 1/2 v^T M v.
template <Mechanism M>
class RestReactions {
 public:
  using Real = typename M::real_type;

  explicit RestReactions(M& mechanism)
      : mechanism_(mechanism), n_(known(sizes_of(mechanism).speeds)), joint_speeds_(sizes_of(mechanism).joint_speeds()),
        m_(known(sizes_of(mechanism).equations)), N_(n_ * n_), right_(n_ * (n_ + m_)), b_(n_ + m_), x_(n_ + m_), scratch_(n_ + m_), left_(n_ + m_),
        beside_(n_ + m_), order_(n_ + m_), shift_(n_), sum_(n_), still_(n_), speeds_(n_), zero_(m_),
        jacobian_(m_ * n_), residual_(m_), rate_(m_), at_rest_(m_) {}

  /// Change accelerations of a state to those with prescribed coordinates; `begin_step` has been called for its time. `same_pose`: as in the last call.
  void constrain(const StateOf<M>& state, const auto& prescribed, Real* a, bool same_pose) {
    if (!same_pose) find_directions(state);
    find_change(prescribed, a);
    for (std::size_t i = 0; i < n_; ++i) a[i] = prescribed[i] ? Real(0) : a[i] + nominal(i) * shift_[i];
  }

  /// The same with multipliers: M (a' - a) = -Phi_v^T dlambda + `forces` along prescribed coordinates.
  void find_reactions(StateOf<M>& state, const auto& prescribed, Real* forces) {
    find_directions(state);
    find_change(prescribed, state.vdot.data());
    find_momenta(state);
    std::size_t columns = 0;
    for (; columns < m_; ++columns)
      for (std::size_t i = 0; i < n_; ++i) right_[columns * n_ + i] = -jacobian_[i * m_ + columns];
    for (std::size_t k = 0; k < n_; ++k) {
      if (!prescribed[k]) continue;
      std::fill_n(right_.data() + columns * n_, n_, Real(0));
      right_[columns++ * n_ + k] = Real(1);
    }
    solve({right_.data(), n_, columns});
    for (std::size_t i = 0; i < m_; ++i) state.lambda[i] += x_[i];
    for (std::size_t i = 0, column = m_; i < n_; ++i) forces[i] = prescribed[i] ? x_[column++] / nominal(i) : Real(0);
    for (std::size_t i = 0; i < n_; ++i) state.vdot[i] = prescribed[i] ? Real(0) : state.vdot[i] + nominal(i) * shift_[i];
  }

 private:
  /// Speeds and accelerations in private members are relative to the nominal values of rates, so that ranks do not depend on units.
  Real nominal(std::size_t speed) const { return Real(size_at(scaled_nominals_of(mechanism_), speed, n_)); }

  /// A mechanism without kinetic energy needs no memory.
  static constexpr std::size_t known(std::size_t length) { return Weighable<M> ? length : 0; }
  static constexpr std::size_t n = known(static_sizes<M>().speeds), m = known(static_sizes<M>().equations);

  /// Directions count as dependent below this fraction of their norm; rows of prescribed coordinates below it of the largest.
  static constexpr Real least() { return Real(1e-7); }

  Real energy_of(const StateOf<M>& state, const Real* v) {
    Real energy[2]{};
    const std::span<const double> nominals = scaled_nominals_of(mechanism_);
    for (std::size_t i = 0; i < joint_speeds_; ++i) speeds_[i] = Real(size_at(nominals, i, n_)) * v[i];
    if constexpr (Weighable<M>) mechanism_.energy(state.q.data(), speeds_.data(), speeds_.data(), zero_.data(), energy);
    return energy[0];
  }

  /// x_ that minimises |A x - b_|; both are overwritten.
  void solve(dense::Matrix<Real> A) {
    std::fill(x_.begin(), x_.end(), Real(0));
    if (A.rows == 0 || A.columns == 0) return;
    dense::LeastSquares<Real> squares(A, order_.data(), left_.data(), beside_.data());
    squares.decompose(least());
    squares.solve(b_.data(), x_.data(), scratch_.data());
  }

  /// N: velocities of each independent speed with the loops closed, orthogonalised against those before; first-order states move no mass.
  void find_directions(const StateOf<M>& state) {
    dofs_ = 0;
    find_jacobian(state);
    std::copy(jacobian_.begin(), jacobian_.end(), right_.begin());
    dense::LeastSquares<Real> squares({right_.data(), m_, joint_speeds_}, order_.data(), left_.data(), beside_.data());
    std::size_t rank = 0;
    if (m_ > 0 && joint_speeds_ > 0) squares.decompose(least()), rank = squares.rank();
    for (std::size_t place = rank; place < joint_speeds_; ++place) {
      const std::size_t own = m_ > 0 ? squares.column_at(place) : place;
      std::copy_n(jacobian_.data() + own * m_, m_, b_.begin());
      std::fill(x_.begin(), x_.end(), Real(0));
      if (m_ > 0) squares.solve(b_.data(), x_.data(), scratch_.data());
      Real* column = N_.data() + dofs_ * n_;
      for (std::size_t i = 0; i < n_; ++i) column[i] = (i == own ? Real(1) : Real(0)) - x_[i];
      if (add_direction(state, column)) ++dofs_;
    }
  }

  /// The Jacobian of the loops with respect to velocities, (equations, speeds), by columns.
  void find_jacobian(const StateOf<M>& state) {
    if (m_ == 0) return;
    mechanism_.constraint_residual(state.q.data(), still_.data(), residual_.data(), at_rest_.data());
    std::fill(sum_.begin(), sum_.end(), Real(0));
    for (std::size_t j = 0; j < joint_speeds_; ++j) {
      sum_[j] = nominal(j);
      mechanism_.constraint_residual(state.q.data(), sum_.data(), residual_.data(), rate_.data());
      sum_[j] = Real(0);
      for (std::size_t i = 0; i < m_; ++i) jacobian_[j * m_ + i] = rate_[i] - at_rest_[i];
    }
  }

  /// Orthogonalise a direction against those before (T = 1/2); return whether it moves mass. A second pass follows
  /// if the first left less than half of its energy, and so fewer digits.
  bool add_direction(const StateOf<M>& state, Real* column) {
    if (!scale(state, column, Real(0))) return false;
    for (bool again = true; again;) {
      Real energy(0.5);
      for (std::size_t k = 0; k < dofs_; ++k) {
        const Real* other = N_.data() + k * n_;
        for (std::size_t i = 0; i < joint_speeds_; ++i) sum_[i] = column[i] + other[i];
        const Real share = energy_of(state, sum_.data()) - Real(0.5) - energy;
        for (std::size_t i = 0; i < joint_speeds_; ++i) column[i] -= share * other[i];
        energy -= share * share / 2;
      }
      again = energy < Real(0.25);
      if (!scale(state, column, least() * least())) return false;
    }
    return true;
  }

  /// Whether a direction has more than some energy; it is then scaled to T = 1/2.
  bool scale(const StateOf<M>& state, Real* column, Real more_than) {
    using std::sqrt;
    const Real energy = energy_of(state, column);
    if (!(energy > more_than)) return false;
    for (std::size_t i = 0; i < joint_speeds_; ++i) column[i] /= sqrt(2 * energy);
    return true;
  }

  /// shift_ = N y, the change of accelerations.
  void find_change(const auto& prescribed, const Real* a) {
    using std::sqrt;
    const auto size_of_row = [this](std::size_t i) {
      Real square(0);
      for (std::size_t k = 0; k < dofs_; ++k) square += N_[k * n_ + i] * N_[k * n_ + i];
      return sqrt(square);
    };
    Real largest(0);
    for (std::size_t i = 0; i < n_; ++i) largest = std::max(largest, size_of_row(i));
    const auto is_free = [&](std::size_t i) { return prescribed[i] && size_of_row(i) > least() * least() * largest; };
    std::size_t rows = 0, row = 0;
    for (std::size_t i = 0; i < n_; ++i) rows += is_free(i);
    for (std::size_t i = 0; i < n_; ++i) {
      if (!is_free(i)) continue;
      const Real size = size_of_row(i);
      b_[row] = -a[i] / (nominal(i) * size);
      for (std::size_t k = 0; k < dofs_; ++k) right_[k * rows + row] = N_[k * n_ + i] / size;
      ++row;
    }
    solve({right_.data(), rows, dofs_});
    std::fill(shift_.begin(), shift_.end(), Real(0));
    for (std::size_t k = 0; k < dofs_; ++k)
      for (std::size_t i = 0; i < n_; ++i) shift_[i] += x_[k] * N_[k * n_ + i];
  }

  /// b_ = M shift_.
  void find_momenta(const StateOf<M>& state) {
    const Real energy = energy_of(state, shift_.data());
    for (std::size_t i = 0; i < n_; ++i) {
      std::fill(sum_.begin(), sum_.end(), Real(0));
      sum_[i] = Real(1);
      const Real own = energy_of(state, sum_.data());
      for (std::size_t k = 0; k < n_; ++k) sum_[k] += shift_[k];
      b_[i] = energy_of(state, sum_.data()) - own - energy;
    }
  }

  M& mechanism_;
  std::size_t n_, joint_speeds_, m_, dofs_ = 0;
  Array<M, n * n> N_;
  Array<M, n * (n + m)> right_;
  Array<M, n + m> b_, x_, scratch_, left_, beside_;
  Array<M, n + m, std::size_t> order_;
  Array<M, n> shift_, sum_, still_, speeds_;
  Array<M, m> zero_;
  Array<M, m * n> jacobian_;
  Array<M, m> residual_, rate_, at_rest_;
};

}  // namespace cutjoint
