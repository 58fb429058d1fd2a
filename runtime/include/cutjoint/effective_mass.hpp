// The masses that cut joints feel: what resists a relative acceleration of base and follower.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "cutjoint/mechanism.hpp"
#include "cutjoint/state.hpp"

namespace cutjoint {

/// Penalty of the proximal closure over the effective mass of its cut joint.
///
/// What an evaluation leaves of an error is the inverse square of it, and what rounding takes of the accelerations grows with it: 1e5 leaves
/// ten digits of both.  With long steps it is less, for the sake of singular poses: there the fixed point diverges once a step changes the
/// Jacobian's vanishing direction by more than the penalty blurs it, sqrt(mass/penalty).
template <class Real>
Real stiffness_of_cuts(Real dt) {
  return std::min(Real(1e5), Real(0.005) / (dt * dt));
}

/// The effective mass of each cut joint: the largest 1/S_kk of its equations, S = Phi_v M^-1 Phi_v^T; kg or kg m^2.
///
/// `project` answers a unit gap of equation k with the share T_kk = a S_kk/(1 + a S_kk) of it where the equations are apart; `penalties` a are
/// those that the mechanism was loaded with, best light ones, so that T is about a S.  An equation that no speed changes, or that changes
/// a millionth as much as others, has no mass of its own.  The velocity part of `close` is linear in the speeds.
template <Mechanism M>
std::vector<typename M::real_type> effective_masses(M& mechanism, const State<typename M::real_type>& state,
                                                    const std::vector<typename M::real_type>& penalties) {
  using Real = typename M::real_type;
  const Description& d = mechanism.description();
  const std::size_t m = d.equations.size(), n = d.speeds.size();
  std::vector<Real> gap(m), dz(n), residual(m), moved(m), still(m), share(m);
  std::vector<Real> zero(n);
  mechanism.close(state.q.data(), zero.data(), residual.data(), still.data());
  for (std::size_t i = 0; i < m; ++i) {
    gap[i] = Real(1);
    mechanism.project(state.q.data(), gap.data(), dz.data());
    mechanism.close(state.q.data(), dz.data(), residual.data(), moved.data());
    share[i] = still[i] - moved[i];
    gap[i] = Real(0);
  }
  const Real largest = m ? *std::max_element(share.begin(), share.end()) : Real(0);
  std::vector<Real> masses;
  for (std::size_t c = 0; c < d.cuts.size(); ++c) {
    const std::size_t first = static_cast<std::size_t>(d.cuts[c]), end = c + 1 < d.cuts.size() ? static_cast<std::size_t>(d.cuts[c + 1]) : m;
    Real mass(0);
    for (std::size_t i = first; i < end; ++i)
      if (share[i] > Real(1e-6) * largest) mass = std::max(mass, penalties[c] * (Real(1) - share[i]) / share[i]);
    masses.push_back(mass);
  }
  const Real heaviest = masses.empty() ? Real(0) : *std::max_element(masses.begin(), masses.end());
  for (Real& mass : masses)
    if (!(mass > Real(1e-9) * heaviest)) mass = heaviest > Real(0) ? heaviest : Real(1);
  return masses;
}

}  // namespace cutjoint
