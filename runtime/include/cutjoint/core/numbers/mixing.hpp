// A fixed point sought from several of its iterations at once.
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

/// Anderson's mixing of depth 2 (J. ACM 12 (1965) 547-560) for x = g(x): the next try is g less that combination of its last two differences whose
/// changes f = g - x leave least of the present change.  Two directions, those in which g follows x most, so go to where they end, also where they would
/// not by themselves.  A mixed try from which changes grow more than fourfold ends what is known.  Of several instances side by side each goes as if it
/// were alone.
template <class M>
class Mixing {
 public:
  using Real = typename M::real_type;
  using Instances = Selection<Real>;
  using Mask = typename Instances::Mask;

  explicit Mixing(std::size_t speeds) : f_(speeds), g_(speeds), now_(speeds) {
    for (Pair& pair : pairs_) pair = {Speeds<M>(speeds), Speeds<M>(speeds), Real(0)};
  }

  /// Begin a search.
  void begin() { tries_ = 0; }

  /// Values g(x) of the instances in `going` become where to try next.  `change` is g - x, in all `size`; the last components count as shares of `nominals`.
  void mix(const Speeds<M>& change, Real size, std::span<const double> nominals, Mask going, Speeds<M>& g) {
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
      Instances::take(going, part - second * older.g[i], g[i]);
    }
  }

 private:
  /// How f and g have changed from one iteration to the next, and the square of the former; nought where it is not known.
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
