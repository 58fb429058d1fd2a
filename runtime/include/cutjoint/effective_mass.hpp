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

/// Penalties of the proximal closure, by the effective masses of its cut joints while the others are held and while they are open.
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

/// Effective masses of the cut joints of a mechanism, kg or kg m^2, by S = Phi_v M^-1 Phi_v^T; a cut joint's is the largest of its equations.
///
/// `project` answers a unit gap of equation k by closing T e_k, T = S a/(1 + S a), with the penalties a that the mechanism was loaded with;
/// massless bodies, whose S has no bound, have a bounded T.  The velocity part of `constraint_residual` is linear in the speeds.
template <Mechanism M>
class EffectiveMasses {
 public:
  using Real = typename M::real_type;
  using Matrix = Eigen::Matrix<Real, Eigen::Dynamic, Eigen::Dynamic>;
  using Vector = Eigen::Matrix<Real, Eigen::Dynamic, 1>;

  EffectiveMasses(M& mechanism, const State<Real>& state, const std::vector<Real>& penalties)
      : d_(mechanism.description()), T_(measure(mechanism, state)), a_(T_.rows()) {
    for (std::size_t c = 0; c < d_.cuts.size(); ++c) a_.segment(d_.cuts[c], end(c) - d_.cuts[c]).setConstant(penalties[c]);
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
  static Matrix measure(M& mechanism, const State<Real>& state) {
    const std::size_t m = mechanism.description().equations.size(), n = mechanism.description().speeds.size();
    Matrix T(m, m);
    Vector gap = Vector::Zero(T.rows()), dz = Vector::Zero(static_cast<Eigen::Index>(n)), residual(gap), rate(gap), rest(gap);
    mechanism.constraint_residual(state.q.data(), dz.data(), residual.data(), rest.data());
    for (Eigen::Index k = 0; k < T.cols(); ++k) {
      gap[k] = Real(1);
      mechanism.project(state.q.data(), gap.data(), dz.data());
      mechanism.constraint_residual(state.q.data(), dz.data(), residual.data(), rate.data());
      T.col(k) = rest - rate;
      gap[k] = Real(0);
    }
    return T;
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
  Matrix T_;
  Vector a_;
};

}  // namespace cutjoint
