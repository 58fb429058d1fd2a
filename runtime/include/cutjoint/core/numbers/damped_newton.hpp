// Newton's damped iteration for accelerations that follow from themselves, by differences.
#pragma once

#include <cmath>
#include <cstddef>
#include <limits>
#include <span>

#include "cutjoint/core/mechanism/contract.hpp"
#include "cutjoint/core/numbers/arrays.hpp"
#include "cutjoint/core/numbers/dense.hpp"
#include "cutjoint/core/numbers/largest.hpp"

namespace cutjoint {

/// The x with r(x) = 0, by Newton's iteration with differences of r and the damping of Deuflhard's monotonicity test (newton/newton.hpp, `shorten`).
/// It costs an evaluation for each unknown in each iteration: a last resort where a fixed point is not found.
template <class M>
class DampedNewton {
 public:
  using Real = typename M::real_type;

  explicit DampedNewton(std::size_t n) : r_(n), move_(n), from_(n), room_(n), order_(n) {
    if constexpr (!Sized<M>) a_.resize(n * n);
  }

  /// Seek x; false where it is not found.  The last components count as shares of `nominals`.  `evaluate` stores r(x).
  bool solve(Speeds<M>& x, std::span<const double> nominals, Real tolerance, int iterations, auto evaluate) {
    for (int iteration = 0; iteration < iterations; ++iteration) {
      evaluate(r_);
      move_ = r_;
      if (!differentiate(x, nominals, evaluate)) return false;
      triangles().solve(move_.data(), room_.data());
      const Real size = largest(move_, nominals), whole = Real(1) + largest(x, nominals);
      if (!std::isfinite(static_cast<double>(size))) return false;
      from_ = x;
      for (Real share(1);; share /= 2) {
        const bool last = share < Real(1e-5);
        for (std::size_t i = 0; i < x.size(); ++i) x[i] = from_[i] + (last ? Real(1) : share) * move_[i];
        evaluate(r_);
        if (last || size <= tolerance * whole) break;
        triangles().solve(r_.data(), room_.data());
        if (largest(r_, nominals) <= (1 - share / 4) * size) break;
      }
      if (size <= tolerance * whole) return true;
    }
    return false;
  }

 private:
  /// The negative matrix of r's derivatives, in triangles.
  bool differentiate(Speeds<M>& x, std::span<const double> nominals, auto evaluate) {
    using std::abs, std::sqrt;
    const std::size_t n = x.size(), first = n - nominals.size();
    for (std::size_t j = 0; j < n; ++j) {
      const Real kept = x[j], nominal = j < first ? Real(1) : Real(nominals[j - first]);
      const Real h = sqrt(std::numeric_limits<Real>::epsilon()) * (abs(kept) > nominal ? abs(kept) : nominal);
      x[j] = kept + h;
      evaluate(r_);
      for (std::size_t i = 0; i < n; ++i) a_[j * n + i] = (move_[i] - r_[i]) / h;
      x[j] = kept;
    }
    return triangles().decompose();
  }

  dense::Triangles<Real> triangles() { return {{a_.data(), order_.size(), order_.size()}, order_.data()}; }

  Speeds<M> r_, move_, from_, room_;
  Array<M, static_sizes<M>().speeds, std::size_t> order_;
  Array<M, static_sizes<M>().speeds * static_sizes<M>().speeds> a_;
};

}  // namespace cutjoint
