// The masses that cut joints feel: what resists a relative acceleration of base and follower.
#pragma once

#include "cutjoint/core/start/reactions.hpp"

namespace cutjoint {

/// Penalties of the closures that find their own, by the effective masses of the cut joints while the others are held and while they are open.
///
/// An evaluation leaves of an error the inverse square of penalty over held mass.  The rounding of the accelerations grows with that ratio:
/// 3e4 leaves ten digits of both.  A fixed point with steps `dt` (0 where there is none), in units of the time of falling an arm's length at
/// 1 m/s2, wants less near singular poses: it diverges once a step changes the Jacobian's vanishing direction by more than the penalty
/// blurs it, sqrt(open mass/penalty).
template <class Numbers, class Real>
Numbers penalties_of_cuts(const Numbers& closed, const Numbers& open, Real dt) {
  Numbers penalties(closed.size());
  for (std::size_t i = 0; i < closed.size(); ++i) {
    penalties[i] = Real(3e4) * closed[i];
    if (dt > Real(0)) penalties[i] = std::min(penalties[i], Real(0.005) * open[i] / (dt * dt));
  }
  return penalties;
}

/// The one penalty of the closure `penalty`, between those of its cut joints: their geometric mean.
///
/// Its multipliers are corrected in each step, so that a wide range will do.  Mechanisms of models/ that stay away from singular poses have
/// the same errors to two digits with 1e3 to 1e7 times the masses.
template <class Numbers>
auto common_penalty(const Numbers& penalties) {
  using std::exp, std::log;
  using Real = typename Numbers::value_type;
  Real sum(0);
  for (const Real penalty : penalties) sum += log(penalty);
  return exp(sum / static_cast<Real>(penalties.size()));
}

/// Effective masses of the cut joints of a mechanism, kg or kg m^2, by S = Phi_v M^-1 Phi_v^T; a cut joint's is the largest of its equations.
///
/// A unit violation of equation k is answered by closing T e_k, T = S a/(1 + S a), with the penalties a that the mechanism was loaded with; massless
/// bodies, whose S has no bound, have a bounded T.  A mass that is rounding beside the one that single speeds move counts as
/// none; the kinetic energy tells the latter.  The velocity part of `constraint_residual` is linear in the speeds.  The answer is that of
/// `project`, or with the closure `penalty`, for which not all mechanisms have it, what multipliers of a e_k change in the accelerations.
template <Mechanism M>
class EffectiveMasses {
 public:
  using Real = typename M::real_type;

  explicit EffectiveMasses(M& mechanism)
      : mechanism_(mechanism), m_(sizes_of(mechanism).equations), a_(m_), violation_(m_), residual_(m_), rate_(m_), rate_at_rest_(m_), mass_(m_),
        alone_(m_), zero_speeds_(sizes_of(mechanism).speeds), dz_(zero_speeds_.size()), without_(zero_speeds_.size()), T_(m_ * m_), scaled_(m_ * m_), vectors_(m_ * m_) {}

  /// Measure T in a state with the penalties of the cut joints that the mechanism was loaded with.
  void measure(const StateOf<M>& state, const Cuts<M>& penalties, bool is_proximal) {
    for (std::size_t c = 0; c < penalties.size(); ++c)
      for (std::size_t k = first(c); k < first(c + 1); ++k) a_[k] = penalties[c];
    std::fill(violation_.begin(), violation_.end(), Real(0));
    mechanism_.constraint_residual(state.q.data(), zero_speeds_.data(), residual_.data(), rate_at_rest_.data());
    if constexpr (Weighable<M>) measure_alone(state);
    if (!is_proximal) mechanism_.evaluate(state.q.data(), zero_speeds_.data(), violation_.data(), without_.data(), rate_.data());
    for (std::size_t k = 0; k < m_; ++k) {
      violation_[k] = is_proximal ? Real(1) : a_[k];
      if (is_proximal) {
        if constexpr (requires { mechanism_.project(dz_.data(), dz_.data(), dz_.data()); })
          mechanism_.project(state.q.data(), violation_.data(), dz_.data());
      } else {
        mechanism_.evaluate(state.q.data(), zero_speeds_.data(), violation_.data(), dz_.data(), rate_.data());
        for (std::size_t i = 0; i < dz_.size(); ++i) dz_[i] -= without_[i];
      }
      mechanism_.constraint_residual(state.q.data(), dz_.data(), residual_.data(), rate_.data());
      for (std::size_t i = 0; i < m_; ++i) T_[k * m_ + i] = rate_at_rest_[i] - rate_[i];
      violation_[k] = Real(0);
    }
  }

  /// With all other cut joints open, 1/S_kk where the penalties are light; equations that no speed changes count for nothing.
  Cuts<M> open() {
    Real largest(0);
    for (std::size_t k = 0; k < m_; ++k) largest = std::max(largest, T_[k * m_ + k]);
    for (std::size_t k = 0; k < m_; ++k) {
      const Real share = T_[k * m_ + k];
      mass_[k] = share > Real(1e-6) * largest ? a_[k] * (Real(1) - share) / share : Real(0);
    }
    return by_cut();
  }

  /// With all other equations closed, (S^-1)_kk, in the directions with less mass than the penalty: dependent equations and directions that
  /// nearly vanish are left out.  So are those with more mass because the penalty is light; see `has_light_penalties`.
  Cuts<M> closed(const StateOf<M>& state) {
    using std::sqrt;
    const auto scaled = [&](std::size_t i, std::size_t j) { return sqrt(a_[i]) * T_[j * m_ + i] / sqrt(a_[j]); };
    for (std::size_t j = 0; j < m_; ++j)
      for (std::size_t i = 0; i < m_; ++i) scaled_[j * m_ + i] = (scaled(i, j) + scaled(j, i)) / Real(2);
    dense::diagonalise<Real>({scaled_.data(), m_, m_}, {vectors_.data(), m_, m_});
    std::fill(mass_.begin(), mass_.end(), Real(0));
    has_light_penalties_ = false;
    for (std::size_t i = 0; i < m_; ++i) {
      const Real share = scaled_[i * m_ + i];
      if (!(share > Real(0.5))) {
        has_light_penalties_ = has_light_penalties_ || (share > Real(1e-12) && moves(state, i));
        continue;
      }
      const Real inverse = std::max(Real(1) / share - Real(1), Real(0));
      for (std::size_t k = 0; k < m_; ++k) mass_[k] += inverse * vectors_[i * m_ + k] * vectors_[i * m_ + k];
    }
    for (std::size_t k = 0; k < m_; ++k) mass_[k] *= a_[k];
    return by_cut();
  }

  /// Whether penalties of the last `closed` are too light for a direction of motion, as with light bodies between heavy ones.
  bool has_light_penalties() const { return has_light_penalties_; }

 private:
  static constexpr std::size_t m = static_sizes<M>().equations;

  /// The first equation of a cut joint; of the one behind the last, how many equations there are.
  std::size_t first(std::size_t cut) const {
    const auto cuts = cuts_of(mechanism_);
    return cut < cuts.size() ? static_cast<std::size_t>(cuts[cut]) : m_;
  }

  /// Whether speeds change a direction, one of the scaled equations' eigenvectors: its equations do not cancel each other.
  bool moves(const StateOf<M>& state, std::size_t direction) {
    using std::sqrt;
    Real together(0), single(0);
    std::fill(dz_.begin(), dz_.end(), Real(0));
    for (std::size_t i = 0; i < dz_.size(); ++i) {
      dz_[i] = Real(1);
      mechanism_.constraint_residual(state.q.data(), dz_.data(), residual_.data(), rate_.data());
      dz_[i] = Real(0);
      Real sum(0);
      for (std::size_t k = 0; k < m_; ++k) {
        const Real part = vectors_[direction * m_ + k] * sqrt(a_[k]) * (rate_[k] - rate_at_rest_[k]);
        sum += part, single += part * part;
      }
      together += sum * sum;
    }
    return together > Real(1e-4) * single;
  }

  /// The mass that each equation would feel if each speed moved alone, 1/sum_i Phi_ki^2/M_ii, of the speeds that move a mass.
  void measure_alone(const StateOf<M>& state) {
    const auto energy = [&](const Speeds<M>& v) {
      Real result[2]{};
      mechanism_.energy(state.q.data(), v.data(), v.data(), violation_.data(), result);
      return result[0];
    };
    std::fill(alone_.begin(), alone_.end(), Real(0));
    std::fill(dz_.begin(), dz_.end(), Real(0));
    for (std::size_t i = 0; i < dz_.size(); ++i) {
      dz_[i] = Real(1);
      Real mass = energy(dz_);
      dz_[i] = Real(-1);
      mass += energy(dz_) - Real(2) * energy(zero_speeds_);
      if (mass > Real(0)) {
        mechanism_.constraint_residual(state.q.data(), dz_.data(), residual_.data(), rate_.data());
        for (std::size_t k = 0; k < m_; ++k) alone_[k] += (rate_[k] - rate_at_rest_[k]) * (rate_[k] - rate_at_rest_[k]) / mass;
      }
      dz_[i] = Real(0);
    }
    for (Real& mass : alone_) mass = mass > Real(0) ? Real(1) / mass : Real(0);
  }

  /// The largest of each cut joint's equations.  A cut joint whose equations have no mass gets the largest of all.  Where none has one, each gets
  /// the mass that single speeds move, or 1.
  Cuts<M> by_cut() const {
    constexpr Real rounding = Real(1e4) * std::numeric_limits<Real>::epsilon();
    Cuts<M> masses(sizes_of(mechanism_).cuts), others(masses);
    Real heaviest(0);
    for (std::size_t c = 0; c < masses.size(); ++c) {
      for (std::size_t k = first(c); k < first(c + 1); ++k) {
        if (!(mass_[k] < rounding * alone_[k])) masses[c] = std::max(masses[c], mass_[k]);
        others[c] = std::max(others[c], alone_[k]);
      }
      heaviest = std::max(heaviest, masses[c]);
    }
    for (std::size_t c = 0; c < masses.size(); ++c)
      if (!(masses[c] > Real(1e-9) * heaviest)) masses[c] = heaviest > Real(0) ? heaviest : others[c] > Real(0) ? others[c] : Real(1);
    return masses;
  }

  M& mechanism_;
  std::size_t m_;
  Equations<M> a_, violation_, residual_, rate_, rate_at_rest_, mass_, alone_;
  Speeds<M> zero_speeds_, dz_, without_;
  Array<M, m * m> T_, scaled_, vectors_;
  bool has_light_penalties_ = false;
};

}  // namespace cutjoint
