// The masses that cut joints feel: what resists a relative acceleration of base and follower.
#pragma once

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "cutjoint/mechanism.hpp"
#include "cutjoint/state.hpp"

namespace cutjoint {

/// Penalties of the closures that find their own, by the effective masses of the cut joints while the others are held and while they are open.
///
/// What an evaluation leaves of an error is the inverse square of penalty over held mass, and what rounding takes of the accelerations grows
/// with it: 3e4 leaves ten digits of both.  A fixed point with steps `dt` (0 where there is none) wants less near singular poses: it diverges
/// once a step changes the Jacobian's vanishing direction by more than the penalty blurs it, sqrt(open mass/penalty).
template <class Real>
std::vector<Real> penalties_of_cuts(const std::vector<Real>& held, const std::vector<Real>& open, Real dt) {
  std::vector<Real> penalties(held.size());
  for (std::size_t i = 0; i < held.size(); ++i) {
    penalties[i] = Real(3e4) * held[i];
    if (dt > Real(0)) penalties[i] = std::min(penalties[i], Real(0.005) * open[i] / (dt * dt));
  }
  return penalties;
}

/// The one penalty of the closure `penalty`, between those of its cut joints: their geometric mean.
///
/// Its multipliers are corrected in each step, so that a wide range will do: from 1e3 to 1e7 times the masses the mechanisms of models/ that
/// stay away from singular poses have errors that are the same to two digits.
template <class Real>
Real common_penalty(const std::vector<Real>& penalties) {
  using std::exp, std::log;
  Real sum(0);
  for (const Real penalty : penalties) sum += log(penalty);
  return exp(sum / static_cast<Real>(penalties.size()));
}

/// Effective masses of the cut joints of a mechanism, kg or kg m^2, by S = Phi_v M^-1 Phi_v^T; a cut joint's is the largest of its equations.
///
/// A unit gap of equation k is answered by closing T e_k, T = S a/(1 + S a), with the penalties a that the mechanism was loaded with; massless
/// bodies, whose S has no bound, have a bounded T.  The velocity part of `constraint_residual` is linear in the speeds.  The answer is that of
/// `project`, or with the closure `penalty`, for which not all mechanisms have it, what multipliers of a e_k change in the accelerations.
template <Mechanism M>
class EffectiveMasses {
 public:
  using Real = typename M::real_type;
  using Matrix = Eigen::Matrix<Real, Eigen::Dynamic, Eigen::Dynamic>;
  using Vector = Eigen::Matrix<Real, Eigen::Dynamic, 1>;

  EffectiveMasses(M& mechanism, const State<Real>& state, const std::vector<Real>& penalties, bool is_proximal)
      : d_(mechanism.description()), a_(d_.equations.size()) {
    for (std::size_t c = 0; c < d_.cuts.size(); ++c) a_.segment(d_.cuts[c], end(c) - d_.cuts[c]).setConstant(penalties[c]);
    measure(mechanism, state, is_proximal);
  }

  /// With all other cut joints open, 1/S_kk where the penalties are light; equations that no speed changes count for nothing.
  std::vector<Real> open() const {
    const Vector share = T_.diagonal();
    const Real largest = share.size() ? share.maxCoeff() : Real(0);
    return by_cut([&](Eigen::Index k) {
      return share[k] > Real(1e-6) * largest ? a_[k] * (Real(1) - share[k]) / share[k] : Real(0);
    });
  }

  /// With all other equations held, (S^-1)_kk, of the directions that feel less than the penalty: dependent equations and directions that
  /// nearly vanish are left out.
  std::vector<Real> held() const {
    if (a_.size() == 0) return {};  // Eigen's solver reads the first entry
    const Vector root = a_.cwiseSqrt();
    const Matrix scaled = root.asDiagonal() * T_ * root.cwiseInverse().asDiagonal();
    const Eigen::SelfAdjointEigenSolver<Matrix> solver((scaled + scaled.transpose()) / Real(2));
    Vector mass = Vector::Zero(a_.size());
    for (Eigen::Index i = 0; i < a_.size(); ++i) {
      const Real share = solver.eigenvalues()[i];
      if (share > Real(0.5)) mass += std::max(Real(1) / share - Real(1), Real(0)) * solver.eigenvectors().col(i).cwiseAbs2();
    }
    return by_cut([&](Eigen::Index k) { return a_[k] * mass[k]; });
  }

 private:
  /// The columns of T.
  void measure(M& mechanism, const State<Real>& state, bool is_proximal) {
    const Eigen::Index m = a_.size(), n = static_cast<Eigen::Index>(d_.speeds.size());
    Vector gap = Vector::Zero(m), dz = Vector::Zero(n), residual(m), rate(m), rest(m);
    const Vector still = Vector::Zero(n);
    Vector without(n), correction(m);
    mechanism.constraint_residual(state.q.data(), still.data(), residual.data(), rest.data());
    if (!is_proximal) mechanism.evaluate(state.q.data(), still.data(), gap.data(), without.data(), correction.data());
    T_.resize(m, m);
    for (Eigen::Index k = 0; k < m; ++k) {
      gap[k] = is_proximal ? Real(1) : a_[k];
      if (is_proximal) {
        mechanism.project(state.q.data(), gap.data(), dz.data());
      } else {
        mechanism.evaluate(state.q.data(), still.data(), gap.data(), dz.data(), correction.data());
        dz -= without;
      }
      mechanism.constraint_residual(state.q.data(), dz.data(), residual.data(), rate.data());
      T_.col(k) = rest - rate;
      gap[k] = Real(0);
    }
  }

  int end(std::size_t cut) const { return cut + 1 < d_.cuts.size() ? d_.cuts[cut + 1] : static_cast<int>(d_.equations.size()); }

  /// The largest of each cut joint's equations; a cut joint whose equations have no mass gets the largest of all, or one.
  template <class OfEquation>
  std::vector<Real> by_cut(OfEquation of_equation) const {
    std::vector<Real> masses(d_.cuts.size(), Real(0));
    for (std::size_t c = 0; c < masses.size(); ++c)
      for (int k = d_.cuts[c]; k < end(c); ++k) masses[c] = std::max(masses[c], of_equation(k));
    const Real heaviest = masses.empty() ? Real(0) : *std::max_element(masses.begin(), masses.end());
    for (Real& mass : masses)
      if (!(mass > Real(1e-9) * heaviest)) mass = heaviest > Real(0) ? heaviest : Real(1);
    return masses;
  }

  const Description& d_;
  Vector a_;
  Matrix T_;
};

}  // namespace cutjoint
