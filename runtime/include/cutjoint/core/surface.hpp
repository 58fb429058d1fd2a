// Surfaces of roads: heights on a grid with a smooth surface through them, and patches with another friction.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <span>

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
    Real sum(0);
    for (std::size_t i = 0; i < 4; ++i) {
      const Real* const row = heights.data() + rows.at[i] * counts[1];
      sum += rows.of[i] * (columns.of[0] * row[columns.at[0]] + columns.of[1] * row[columns.at[1]] + columns.of[2] * row[columns.at[2]] +
                           columns.of[3] * row[columns.at[3]]);
    }
    return sum;
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
    Real u = (place - start[axis]) / step[axis];
    if (around) u -= Real(double(n) * std::floor(double(u) / double(n)));
    if (!(u >= Real(-1) && u <= Real(double(n)))) {
      if (!(u < Real(-1)) && !(u > Real(double(n)))) return {{}, {place, place, place, place}};  // not a number
      if (order > 0) return {};
      u = u < Real(0) ? Real(-1) : Real(double(n));
    }
    const auto k = static_cast<std::ptrdiff_t>(std::floor(double(u)));
    Weights w;
    for (std::size_t i = 0; i < 4; ++i) {
      const std::ptrdiff_t j = k - 1 + static_cast<std::ptrdiff_t>(i);
      w.at[i] = around ? (j < 0 ? j + n : j >= n ? j - n : j) : std::clamp<std::ptrdiff_t>(j, 0, n - 1);
    }
    const Real t = u - Real(double(k)), scale = order == 0 ? Real(1) : order == 1 ? Real(1) / step[axis] : Real(1) / (step[axis] * step[axis]);
    if (bilinear) {
      w.of[1] = order == 0 ? Real(1) - t : order == 1 ? -scale : Real(0);
      w.of[2] = order == 0 ? t : order == 1 ? scale : Real(0);
      return w;
    }
    const std::array<Real, 4> h = hermite(t, order);
    w.of[1] = h[0];
    w.of[2] = h[1];
    for (std::ptrdiff_t end = 0; end < 2; ++end) {
      const std::ptrdiff_t node = k + end;
      if (!around && (node < 0 || node >= n)) continue;
      const std::ptrdiff_t low = around || node > 0 ? node - 1 : 0, high = around || node < n - 1 ? node + 1 : n - 1;
      const Real share = high - low == 2 ? h[static_cast<std::size_t>(2 + end)] / Real(2) : h[static_cast<std::size_t>(2 + end)];
      w.of[static_cast<std::size_t>(high - k + 1)] += share;
      w.of[static_cast<std::size_t>(low - k + 1)] -= share;
    }
    for (Real& weight : w.of) weight *= scale;
    return w;
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

/// What a road has beside its two tracks: a height field, if it has one, and patches, of which a later one lies on those before.
template <class Real>
struct Surface {
  HeightField<Real> field{};
  std::span<const FrictionPatch<Real>> patches{};

  Real height(Real x, Real y, int by_x, int by_y) const { return field.heights.empty() ? Real(0) : field.derivative(x, y, by_x, by_y); }

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
