// Projection of coordinates, rates or accelerations with the factors of an augmented tangent.
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <span>

#include "cutjoint/core/numbers/arrays.hpp"
#include "cutjoint/core/numbers/dot.hpp"
#include "cutjoint/core/simulation/fault.hpp"
#include "cutjoint/core/numbers/largest.hpp"

namespace cutjoint {

/// The default weight of the equations in an augmented tangent, relative to the heaviest coordinate.
template <class Real>
inline constexpr Real overweight{1e4};

/// With the tangent A = B + c Phi_q^T Phi_q, the projection  A dv = -c Phi_q^T violation  leaves a fraction of the violation.  It is the first step, of
/// length c, of an iteration for w in  S w = violation, S = Phi_q A^-1 Phi_q^T, dv = -A^-1 Phi_q^T w.  Conjugate residuals take steps of optimal
/// length at the same cost, a back-substitution each.  They converge also where the length c achieves almost nothing.  They are those of
/// Eisenstat, Elman, Schultz (SIAM J. Numer. Anal. 20 (1983) 345-357), since A need not be symmetric, nor belong to this very pose.
///
/// A direction far weaker than others belongs to nearly dependent equations: it is ignored, since closing it
/// would take a large change of the rates.  The penalty hides its strength: without it S is S / (1 - c S).  (Massless directions
/// have unbounded strength and are no reference for others.)
template <class S>
class Closing {
 public:
  using Real = typename S::real_type;

  static constexpr std::size_t passes = 10;

  explicit Closing(const S& system)
      : n_(sizes_of(system).speeds), m_(sizes_of(system).equations), shifts_(passes * n_), closings_(passes * m_) {}

  /// Change `values` until their `violation`, which is linear in them and updated, is `negligible`.  `follow` computes way = A^-1 Phi_q^T w and
  /// closing = Phi_q way for a w; `constraint` is c.  The fault is that of `follow`.
  template <class Follow>
  Fault close(Speeds<S>& values, Equations<S>& violation, Real constraint, Real negligible, Follow follow) {
    Real strongest(0);
    share_left_ = Real(0);
    closed_ = !(largest(violation) > negligible);
    for (std::size_t pass = 0; pass < passes && !closed_; ++pass) {
      const std::span<Real> shift(shifts_.data() + pass * n_, n_), closing(closings_.data() + pass * m_, m_);
      if (const Fault fault = follow(violation, shift, closing)) return fault;
      Real match = dot(violation, closing);
      const Real strength = match / dot(violation, violation);
      share_left_ = std::max(share_left_, 1 - constraint * strength);
      const Real free = strength / std::max(1 - constraint * strength, std::numeric_limits<Real>::epsilon());
      if (!(free > Real(1e-4) * strongest)) break;
      strongest = std::max(strongest, std::min(free, overweight<Real> / constraint));
      for (std::size_t before = 0; before < pass; ++before) {
        const std::span<Real> old_shift(shifts_.data() + before * n_, n_), old(closings_.data() + before * m_, m_);
        const Real share = dot(closing, old) / dot(old, old);
        subtract(share, old_shift, shift);
        subtract(share, old, closing);
      }
      if (pass > 0) match = dot(violation, closing);
      const Real length = match / dot(closing, closing);
      subtract(length, shift, values);
      subtract(length, closing, violation);
      closed_ = !(largest(violation) > negligible);
    }
    return {};
  }

  /// The largest fraction of the last violation that a projection of length c would leave.
  Real share_left() const { return share_left_; }

  /// Whether the last violation has been closed.
  bool closed() const { return closed_; }

 private:
  static Real dot(std::span<const Real> a, std::span<const Real> b) { return cutjoint::dot(a, b); }

  static void subtract(Real factor, std::span<const Real> a, std::span<Real> from) {
    for (std::size_t i = 0; i < a.size(); ++i) from[i] -= factor * a[i];
  }

  std::size_t n_, m_;
  bool closed_ = true;
  Real share_left_{0};
  Array<S, passes * static_sizes<S>().speeds> shifts_;         ///< increments
  Array<S, passes * static_sizes<S>().equations> closings_;  ///< their effect on the violation
};

}  // namespace cutjoint
