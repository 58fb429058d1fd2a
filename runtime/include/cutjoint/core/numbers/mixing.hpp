// Anderson mixing for fixed points.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <span>

#include "cutjoint/core/numbers/arrays.hpp"
#include "cutjoint/core/mechanism/contract.hpp"
#include "cutjoint/core/numbers/dot.hpp"
#include "cutjoint/core/numbers/selection.hpp"

namespace cutjoint {

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

}  // namespace cutjoint
