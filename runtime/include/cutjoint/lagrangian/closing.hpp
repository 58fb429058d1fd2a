// Bringing coordinates, rates or accelerations back to the equations with the factors of an augmented tangent.
#pragma once

#include <algorithm>
#include <limits>
#include <span>
#include <vector>

#include "cutjoint/core/largest.hpp"

namespace cutjoint {

/// How much heavier than the heaviest coordinate the equations of an augmented tangent are, where nothing else is asked for.
template <class Real>
inline constexpr Real overweight{1e4};

/// With the tangent A = B + c Phi_q^T Phi_q, the projection  A dv = -c Phi_q^T gap  leaves a share of the gap.  It is the first step, of
/// length c, of an iteration for w in  S w = gap, S = Phi_q A^-1 Phi_q^T, dv = -A^-1 Phi_q^T w; conjugate residuals take steps of the best
/// length at the same price, a back-substitution each, and close gaps where that length closes next to nothing.  They are those of
/// Eisenstat, Elman, Schultz (SIAM J. Numer. Anal. 20 (1983) 345-357), since A need not be symmetric, nor belong to this very pose.
///
/// A direction far weaker than others belongs to equations that depend on each other, or nearly do: it is left as it is, since closing
/// it would take a leap in the rates.  How strong it is, the penalty hides: without it S is S / (1 - c S).  (Those that move no
/// mass at all are strong without limit, which says nothing of others.)
template <class Real>
class Closing {
 public:
  static constexpr std::size_t passes = 10;

  Closing(std::size_t unknowns, std::size_t equations) : n_(unknowns), m_(equations), ways_(passes * n_), closings_(passes * m_) {}

  /// Change `values` until their gap is `negligible`; it is left in `gap`, which is linear in them.  `follow` puts way = A^-1 Phi_q^T w and
  /// closing = Phi_q way for a w, and `constraint` is c.  Returns the share of the gap that a projection of length c would leave, where most would
  /// be left.
  template <class Follow>
  Real close(std::vector<Real>& values, std::vector<Real>& gap, Real constraint, Real negligible, Follow follow) {
    Real strongest(0), share_left(0);
    closed_ = !(largest(gap) > negligible);
    for (std::size_t pass = 0; pass < passes && !closed_; ++pass) {
      const std::span<Real> way(ways_.data() + pass * n_, n_), closing(closings_.data() + pass * m_, m_);
      follow(gap, way, closing);
      const Real strength = dot(gap, closing) / dot(gap, gap);
      share_left = std::max(share_left, 1 - constraint * strength);
      const Real free = strength / std::max(1 - constraint * strength, std::numeric_limits<Real>::epsilon());
      if (!(free > Real(1e-4) * strongest)) break;
      strongest = std::max(strongest, std::min(free, overweight<Real> / constraint));
      for (std::size_t before = 0; before < pass; ++before) {
        const std::span<Real> old_way(ways_.data() + before * n_, n_), old(closings_.data() + before * m_, m_);
        const Real share = dot(closing, old) / dot(old, old);
        subtract(share, old_way, way);
        subtract(share, old, closing);
      }
      const Real length = dot(gap, closing) / dot(closing, closing);
      subtract(length, way, values);
      subtract(length, closing, gap);
      closed_ = !(largest(gap) > negligible);
    }
    return share_left;
  }

  /// Whether the last gap has been closed.
  bool closed() const { return closed_; }

 private:
  static Real dot(std::span<const Real> a, std::span<const Real> b) {
    Real sums[4] = {Real(0), Real(0), Real(0), Real(0)};  // they do not wait for each other
    std::size_t i = 0;
    for (; i + 4 <= a.size(); i += 4)
      for (std::size_t j = 0; j < 4; ++j) sums[j] += a[i + j] * b[i + j];
    for (; i < a.size(); ++i) sums[0] += a[i] * b[i];
    return (sums[0] + sums[1]) + (sums[2] + sums[3]);
  }

  static void subtract(Real factor, std::span<const Real> a, std::span<Real> from) {
    for (std::size_t i = 0; i < a.size(); ++i) from[i] -= factor * a[i];
  }

  std::size_t n_, m_;
  bool closed_ = true;
  std::vector<Real> ways_, closings_;  ///< increments, and what they close
};

}  // namespace cutjoint
