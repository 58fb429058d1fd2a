// Road surfaces: interpolated heights on a grid, and patches with another friction.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <span>

#include "cutjoint/core/roads/curved_field.hpp"

namespace cutjoint {

/// A surface through heights (m) on a grid: a product of cubics with central differences as slopes, one-sided ones at edges.  Beyond an edge
/// the slope across it fades out over one cell, and the height is constant from there on.
template <class Real>
struct HeightField {
  std::array<Real, 2> start, step;    ///< the first x and y, and the spacing, m
  std::array<std::ptrdiff_t, 2> counts;
  bool wraps, bilinear;               ///< periodic along x; bilinear between grid points
  std::span<const Real> heights;      ///< for each x those along y; owned by another object

  /// The height at a point, or its partial derivatives of orders 0 to 2 in x and y.
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
  /// The grid indices around a position on an axis, and the weights of their heights.
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

  /// A position in grid steps; wrapped on a periodic axis.
  Real into(Real place, std::size_t axis, bool around, Real last) const {
    const Real u = (place - start[axis]) / step[axis];
    return around && !(u >= Real(0) && u < last) ? u - last * Real(std::floor(double(u / last))) : u;
  }

  /// The weights in the constant continuation, and for NaN.
  static Weights beyond(Real u, int order, std::ptrdiff_t n) {
    if (!(u < Real(0)) && !(u > Real(0))) return {{}, {u, u, u, u}};
    const std::ptrdiff_t end = u < Real(0) ? 0 : n - 1;
    return {{end, end, end, end}, {Real(order == 0 ? 1 : 0), Real(0), Real(0), Real(0)}};
  }

  /// The weights of four grid points from those of a cubic's ends and slopes, or of two points.
  std::array<Real, 4> shares(Real t, int order) const {
    if (bilinear) return {Real(0), order == 0 ? Real(1) - t : Real(order == 1 ? -1 : 0), order == 0 ? t : Real(order == 1 ? 1 : 0), Real(0)};
    const std::array<Real, 4> h = hermite(t, order);
    const Real begins = h[2] * Real(0.5), ends = h[3] * Real(0.5);
    return {-begins, h[0] - ends, h[1] + begins, ends};
  }

  /// The weights at an edge, with one-sided slopes, or across the seam of a periodic axis.
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

  /// The Hermite basis over [0, 1], or its derivative.
  static std::array<Real, 4> hermite(Real t, int order) {
    const Real one(1), two(2), three(3), six(6), r = one - t;
    if (order == 0) return {r * r * (one + two * t), t * t * (three - two * t), t * r * r, -t * t * r};
    if (order == 1) return {-six * t * r, six * t * r, r * (one - three * t), t * (three * t - two)};
    const Real s = six * (two * t - one);
    return {s, -s, six * t - Real(4), six * t - two};
  }
};

/// A rectangle with another friction, blended into its surroundings by cubics of width `edge` across its edges; lengths in m.
template <class Real>
struct FrictionPatch {
  std::array<Real, 2> x, y;
  Real friction, edge;

  /// The blending weight of the patch at a point, or its partial derivatives of order 0 or 1 in x and y.
  Real share(Real at_x, Real at_y, int by_x, int by_y) const { return along(x, at_x, by_x) * along(y, at_y, by_y); }

 private:
  Real along(const std::array<Real, 2>& ends, Real place, int order) const { return rise(place - ends[0], order) - rise(place - ends[1], order); }

  Real rise(Real way, int order) const {
    const Real t = way / edge + Real(0.5);
    if (t <= Real(0) || t >= Real(1)) return order == 0 && t >= Real(1) ? Real(1) : Real(0);
    return order == 0 ? t * t * (Real(3) - Real(2) * t) : Real(6) * t * (Real(1) - t) / edge;
  }
};

/// The surface of a road besides its two tracks: an optional height field along x and y or along a line, and patches; later patches cover
/// earlier ones.
template <class Real>
struct Surface {
  HeightField<Real> field{};
  CurvedField<Real> curved{};
  std::span<const FrictionPatch<Real>> patches{};

  Real height(Real x, Real y, int by_x, int by_y) const {
    if (!field.heights.empty()) return field.derivative(x, y, by_x, by_y);
    return curved.heights.empty() ? Real(0) : curved.derivative(x, y, by_x, by_y);
  }

  /// The friction factor at a point, or its partial derivative of order 0 or 1 in x or y.
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
