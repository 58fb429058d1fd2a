// Surfaces of roads: heights on a grid with a smooth surface through them, and patches with another friction.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <span>

#include "cutjoint/core/roads/curved_field.hpp"

namespace cutjoint {

/// A surface through heights (m) on a grid: a product of cubics with central differences as slopes, one-sided ones at edges.  Beyond an edge its
/// slope across the edge runs out over one cell, and its height stays from there on.
template <class Real>
struct HeightField {
  std::array<Real, 2> start, step;    ///< the first place along x and y, and the distance of places, m
  std::array<std::ptrdiff_t, 2> counts;
  bool wraps, bilinear;               ///< it repeats along x; it is linear in x and in y between places
  std::span<const Real> heights;      ///< for each place along x those along y; they belong to somebody else

  /// The height at a place, or its derivative of orders 0 to 2 by x and y.
  Real derivative(Real x, Real y, int by_x, int by_y) const {
    const Weights rows = weigh(0, x, by_x), columns = weigh(1, y, by_y);
    const std::array<Real, 4>& a = columns.of;
    const auto above = [&](std::size_t i, const std::array<std::ptrdiff_t, 4>& at) {
      const Real* const row = heights.data() + rows.at[i] * counts[1];
      return (a[0] * row[at[0]] + a[1] * row[at[1]]) + (a[2] * row[at[2]] + a[3] * row[at[3]]);
    };
    return (rows.of[0] * above(0, columns.at) + rows.of[1] * above(1, columns.at)) + (rows.of[2] * above(2, columns.at) + rows.of[3] * above(3, columns.at));
  }

 private:
  /// The places of an axis about one between them, and the weights of their heights.
  struct Weights {
    std::array<std::ptrdiff_t, 4> at{};
    std::array<Real, 4> of{};
  };

  Weights weigh(std::size_t axis, Real place, int order) const {
    const std::ptrdiff_t n = counts[axis];
    const bool around = wraps && axis == 0;
    const Real last = Real(double(n));
    const Real u = into(place, axis, around, last);
    if (!(u >= Real(-1) && u <= last)) return beyond(u, order, n);
    auto k = static_cast<std::ptrdiff_t>(double(u));
    if (Real(double(k)) > u) --k;
    const Real t = u - Real(double(k));
    Weights w{.at = {k - 1, k, k + 1, k + 2}, .of = shares(t, order)};
    if (k < 1 || k + 2 >= n) fit(w, t, order, k, n, around);
    if (order > 0) {
      const Real scale = order == 1 ? Real(1) / step[axis] : Real(1) / (step[axis] * step[axis]);
      for (Real& weight : w.of) weight *= scale;
    }
    return w;
  }

  /// A place counted in steps; on an axis that repeats between its begin and its end.
  Real into(Real place, std::size_t axis, bool around, Real last) const {
    const Real u = (place - start[axis]) / step[axis];
    return around && !(u >= Real(0) && u < last) ? u - last * Real(std::floor(double(u / last))) : u;
  }

  /// The weights where nothing changes any more, and those of what is not a number.
  static Weights beyond(Real u, int order, std::ptrdiff_t n) {
    if (!(u < Real(0)) && !(u > Real(0))) return {{}, {u, u, u, u}};
    const std::ptrdiff_t end = u < Real(0) ? 0 : n - 1;
    return {{end, end, end, end}, {Real(order == 0 ? 1 : 0), Real(0), Real(0), Real(0)}};
  }

  /// The weights of four places by those of a cubic's ends and slopes, or of two places.
  std::array<Real, 4> shares(Real t, int order) const {
    if (bilinear) return {Real(0), order == 0 ? Real(1) - t : Real(order == 1 ? -1 : 0), order == 0 ? t : Real(order == 1 ? 1 : 0), Real(0)};
    const std::array<Real, 4> h = hermite(t, order);
    const Real begins = h[2] * Real(0.5), ends = h[3] * Real(0.5);
    return {-begins, h[0] - ends, h[1] + begins, ends};
  }

  /// The weights at an edge, whose slopes are one-sided, or over the seam of an axis that repeats.
  void fit(Weights& w, Real t, int order, std::ptrdiff_t k, std::ptrdiff_t n, bool around) const {
    for (std::ptrdiff_t& at : w.at) at = around ? (at < 0 ? at + n : at >= n ? at - n : at) : std::clamp<std::ptrdiff_t>(at, 0, n - 1);
    if (around || bilinear) return;
    const std::array<Real, 4> h = hermite(t, order);
    w.of = {Real(0), h[0], h[1], Real(0)};
    for (std::ptrdiff_t node = k; node < k + 2; ++node) {
      if (node < 0 || node >= n) continue;
      const std::ptrdiff_t low = node > 0 ? node - 1 : 0, high = node < n - 1 ? node + 1 : n - 1;
      const Real share = h[static_cast<std::size_t>(2 + node - k)] / Real(double(high - low));
      w.of[static_cast<std::size_t>(high - k + 1)] += share;
      w.of[static_cast<std::size_t>(low - k + 1)] -= share;
    }
  }

  /// The shares of both ends' heights and of their slopes in a cubic over [0, 1], or in its derivative.
  static std::array<Real, 4> hermite(Real t, int order) {
    const Real one(1), two(2), three(3), six(6), r = one - t;
    if (order == 0) return {r * r * (one + two * t), t * t * (three - two * t), t * r * r, -t * t * r};
    if (order == 1) return {-six * t * r, six * t * r, r * (one - three * t), t * (three * t - two)};
    const Real s = six * (two * t - one);
    return {s, -s, six * t - Real(4), six * t - two};
  }
};

/// A rectangle of a road with another friction, which goes over to that around it by cubics across its edges, over a width of `edge`; lengths in m.
template <class Real>
struct FrictionPatch {
  std::array<Real, 2> x, y;
  Real friction, edge;

  /// The share of the patch at a place, or its derivative of order 0 or 1 by x and y.
  Real share(Real at_x, Real at_y, int by_x, int by_y) const { return along(x, at_x, by_x) * along(y, at_y, by_y); }

 private:
  Real along(const std::array<Real, 2>& ends, Real place, int order) const { return rise(place - ends[0], order) - rise(place - ends[1], order); }

  Real rise(Real way, int order) const {
    const Real t = way / edge + Real(0.5);
    if (t <= Real(0) || t >= Real(1)) return order == 0 && t >= Real(1) ? Real(1) : Real(0);
    return order == 0 ? t * t * (Real(3) - Real(2) * t) : Real(6) * t * (Real(1) - t) / edge;
  }
};

/// What a road has beside its two tracks: a height field along x and y or along a line, if it has one, and patches, of which a later one lies on
/// those before.
template <class Real>
struct Surface {
  HeightField<Real> field{};
  CurvedField<Real> curved{};
  std::span<const FrictionPatch<Real>> patches{};

  Real height(Real x, Real y, int by_x, int by_y) const {
    if (!field.heights.empty()) return field.derivative(x, y, by_x, by_y);
    return curved.heights.empty() ? Real(0) : curved.derivative(x, y, by_x, by_y);
  }

  /// The factor of friction at a place, or its derivative of order 0 or 1 by x or y.
  Real friction(Real x, Real y, int by_x, int by_y) const {
    Real value(1), slope(0);
    for (const FrictionPatch<Real>& patch : patches) {
      const Real share = patch.share(x, y, 0, 0);
      if (by_x + by_y > 0) slope += patch.share(x, y, by_x, by_y) * (patch.friction - value) - share * slope;
      value += share * (patch.friction - value);
    }
    return by_x + by_y > 0 ? slope : value;
  }
};

}  // namespace cutjoint
