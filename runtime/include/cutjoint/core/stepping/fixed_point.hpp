// The fixed point of a step: where its iteration starts, how it is mixed, and Newton's iteration where it fails.
#pragma once

#include <array>

#include "cutjoint/core/numbers/arrays.hpp"
#include "cutjoint/core/numbers/vectors.hpp"
#include "cutjoint/core/numbers/selection.hpp"
#include "cutjoint/core/mechanism/contract.hpp"
#include "cutjoint/core/numbers/dense.hpp"

namespace cutjoint {

/// The polynomial through the accelerations at the ends of the last steps, of a degree up to 3.
///
/// It is kept as backward differences, of which that of order k + 1 is what the polynomial of degree k was off the last step's end.  They are added as
/// long as they fall, so that accelerations that oscillate from step to step are expected to stay.  Of several instances side by side each goes as if it
/// were alone.
template <class M>
class Extrapolation {
 public:
  using Real = typename M::real_type;
  using Instances = Selection<Real>;
  using Mask = typename Instances::Mask;

  explicit Extrapolation(std::size_t speeds) : last_(speeds) {
    for (Speeds<M>& row : differences_) row = Speeds<M>(speeds);
  }

  /// Some instances begin anew.
  void forget(Mask which) {
    for (Speeds<M>& row : differences_)
      for (Real& difference : row) Instances::take(which, Real(0), difference);
    Instances::take(which, Real(1), h_);
  }

  /// The accelerations at the start of a step of length h become those that are expected at its end.
  void expect(Speeds<M>& vdot, Real h, std::span<const double> nominals) {
    extrapolate_from(vdot, h);
    Real size = largest(differences_[0], nominals);
    Mask falling = Instances::all_if(true);
    for (std::size_t k = 0; k + 1 < differences_.size(); ++k) {
      const Real next = largest(differences_[k + 1], nominals);
      falling = Instances::both(falling, next < size);
      if (!Instances::any(falling)) break;
      for (std::size_t i = 0; i < vdot.size(); ++i) Instances::take(falling, vdot[i] + differences_[k][i], vdot[i]);
      size = next;
    }
  }

  /// A step of some instances has ended with these accelerations.
  void keep(const Speeds<M>& vdot, Mask which) {
    for (std::size_t i = 0; i < vdot.size(); ++i) {
      Real difference = vdot[i] - last_[i];
      for (Speeds<M>& row : differences_) {
        const Real next = difference - row[i];
        Instances::take(which, difference, row[i]);
        difference = next;
      }
    }
  }

  /// Memory of one instance, in lane k of this, from or to that of it alone.
  void put_lane(int k, const auto& one) {
    copy(one, [k](const auto& from, Real& to) { to.v[k] = from; });
  }
  void read_lane(int k, auto& one) const {
    one.copy(*this, [k](Real from, auto& to) { to = from[k]; });
  }

 private:
  template <class>
  friend class Extrapolation;

  void copy(const auto& other, auto copy) {
    for (std::size_t k = 0; k < differences_.size(); ++k)
      for (std::size_t i = 0; i < last_.size(); ++i) copy(other.differences_[k][i], differences_[k][i]);
    copy(other.h_, h_);
  }

  /// A jump of the accelerations between steps shifts the polynomial; another length of steps scales its differences.
  void extrapolate_from(const Speeds<M>& vdot, Real h) {
    last_ = vdot;
    const Mask all = Instances::all_if(true), other = Instances::without(all, Instances::both(h <= h_, h_ <= h));
    if (!Instances::any(other)) return;
    const Real ratio = h / h_;
    Real factor(1);
    for (Speeds<M>& row : differences_) {
      Instances::take(other, factor * ratio, factor);
      for (Real& difference : row) Instances::take(other, factor * difference, difference);
    }
    h_ = h;
  }

  std::array<Speeds<M>, 4> differences_;  ///< of orders 1 to 4
  Speeds<M> last_;                        ///< at the start of the present step
  Real h_{1};                             ///< the length of the last one
};

/// Anderson's mixing of depth 2 (J. ACM 12 (1965) 547-560) for x = g(x): the next iterate is g minus the combination of its last two differences that
/// minimises the residual f = g - x by least squares.  This removes the two slowest directions, also divergent ones.  If residuals grow more than
/// fourfold after a mixed iterate, the history is discarded.  Each of several SIMD instances iterates as if it were
/// alone.
template <class M>
class Mixing {
 public:
  using Real = typename M::real_type;
  using Instances = Selection<Real>;
  using Mask = typename Instances::Mask;

  explicit Mixing(std::size_t speeds) : f_(speeds), g_(speeds), now_(speeds) {
    for (Pair& pair : pairs_) pair = {Speeds<M>(speeds), Speeds<M>(speeds), Real(0)};
  }

  /// Begin an iteration.
  void begin() { tries_ = 0; }

  /// Replace g(x) of the instances in `running` by the next iterate.  `change` is g - x, of norm `size`; its last components are relative to `nominals`.
  void mix(const Speeds<M>& change, Real size, std::span<const double> nominals, Mask running, Speeds<M>& g) {
    now_ = change;
    for (std::size_t k = 0, first = now_.size() - nominals.size(); k < nominals.size(); ++k) now_[first + k] = now_[first + k] / Real(nominals[k]);
    if (tries_++ == 0) {
      f_ = now_, g_ = g, size_ = size;
      forget(pairs_[1]);
      return;
    }
    Pair& newest = at(tries_ % 2);
    Pair& older = at((tries_ + 1) % 2);
    for (std::size_t i = 0; i < g.size(); ++i) newest.f[i] = now_[i] - f_[i], newest.g[i] = g[i] - g_[i];
    f_ = now_, g_ = g;
    const Mask grown = Instances::both(Instances::all_if(tries_ > 2), Real(4) * size_ < size);
    newest.size = where(grown, Real(0), dot(newest.f, newest.f));
    older.size = where(grown, Real(0), older.size);
    size_ = size;
    const Real common = dot(newest.f, older.f), of_newest = dot(newest.f, now_), of_older = dot(older.f, now_);
    const Real share = common / newest.size, rest = older.size - share * common, left = of_older - share * of_newest;
    const Real second = where(Real(1e-4) * older.size < rest, left / rest, Real(0));
    const Real first = where(Real(0) < newest.size, (of_newest - common * second) / newest.size, Real(0));
    for (std::size_t i = 0; i < g.size(); ++i) {
      const Real part = g[i] - first * newest.g[i];
      Instances::take(running, part - second * older.g[i], g[i]);
    }
  }

 private:
  /// Differences of f and g between iterations, and the square of the former; 0 if unknown.
  struct Pair {
    Speeds<M> f, g;
    Real size;
  };

  Pair& at(int place) { return pairs_[static_cast<std::size_t>(place)]; }

  static void forget(Pair& pair) {
    std::fill(pair.f.begin(), pair.f.end(), Real(0));
    std::fill(pair.g.begin(), pair.g.end(), Real(0));
    pair.size = Real(0);
  }

  static Real dot(const Speeds<M>& a, const Speeds<M>& b) {
    return cutjoint::dot(std::span<const Real>(a.data(), a.size()), std::span<const Real>(b.data(), b.size()));
  }

  std::array<Pair, 2> pairs_;
  Speeds<M> f_, g_, now_;
  Real size_{0};
  int tries_ = 0;
};

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
