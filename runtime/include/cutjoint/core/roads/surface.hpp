// Road surfaces: interpolated heights on a grid, and patches with another friction.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>

namespace cutjoint {

/// A cross section of the line (m) and the straight segment to the next one: its direction and length (m), how far cross sections lean
/// forward for each metre to the left at its beginning, and the increase to its end, and the line's height (m) and banking.
template <class Real>
struct CrossSection {
  Real x, y, cosine, sine, length, lean, spread, z, bank;
};

/// Continuation beyond an edge, by OpenCRG's numbers of border modes.
enum class Border { zero = 1, keep, repeat, reflect };

/// Heights (m) on a grid along a line, bilinear in between.  A point belongs to the segment between whose cross sections it lies; of
/// several, to that next to the nearest cross section: results depend on the point alone.
template <class Real>
struct CurvedField {
  std::span<const CrossSection<Real>> line;  ///< of the last one the direction is that of the line's end
  std::span<const Real> across;              ///< lateral offsets of heights, positive to the left, increasing, m
  std::span<const Real> heights;             ///< for each cross section, at `across`
  std::span<const Real> boxes;               ///< a tree of bounding boxes of cross sections, each from and to x and y, the root first
  Real step;                                 ///< between cross sections, m
  std::array<Border, 2> borders;             ///< along the line and across
  std::array<Real, 2> offsets;               ///< of heights beyond the edges, m
  std::array<Real, 2> smooth;                ///< the lengths at beginning and end, m, over which heights blend into those of the line
  std::array<Real, 2> closed;                ///< beginning and length of a closed line, in steps; length zero if it is open

  /// Cross sections in a leaf of the tree.
  static constexpr std::size_t in_leaf = 8;

  /// The height at a point, or a partial derivative with respect to x and y of total order up to 2.
  Real derivative(Real x, Real y, int by_x, int by_y) const {
    const Place at = locate(x, y);
    const Real d = Real(1) / (at.length + at.spread * at.v), t = (at.s - at.lean * at.v) * d, t_v = -(at.lean + at.spread * t) * d;
    const Height z = height(at.begin + t, at.v);
    if (by_x + by_y == 0) return z.value;
    const Real c = at.cosine, s = at.sine, z_s = z.u * d, z_v = z.v + z.u * t_v;
    if (by_x + by_y == 1) return by_x ? c * z_s - s * z_v : s * z_s + c * z_v;
    const Real ss = z.uu * d * d, sv = (z.uv + z.uu * t_v - z.u * at.spread * d) * d;
    const Real vv = (Real(2) * z.uv + z.uu * t_v) * t_v - Real(2) * z.u * at.spread * t_v * d;
    if (by_x == 1) return c * s * (ss - vv) + (c * c - s * s) * sv;
    return by_x ? c * c * ss - Real(2) * c * s * sv + s * s * vv : s * s * ss + Real(2) * c * s * sv + c * c * vv;
  }

 private:
  /// A point in the axes of a segment that begins at `begin` steps: along it and to its left, m.
  struct Place {
    Real begin, s, v, cosine, sine, length, lean, spread;
  };

  /// A height, m, and its derivatives by steps along the line and metres across.
  struct Height {
    Real value, u, v, uv, uu;
  };

  // Where a place is

  Place locate(Real x, Real y) const {
    const auto last = static_cast<std::ptrdiff_t>(line.size()) - 1;
    std::ptrdiff_t k = std::clamp<std::ptrdiff_t>(nearest(x, y) - 1, 0, last - 1);
    Place at = at_section(k, x, y);
    if (ahead(at)) {
      while (k < last - 1 && ahead(at)) at = at_section(++k, x, y);
      if (ahead(at)) return beyond(last, x, y);
    } else {
      while (k > 0 && behind(at)) at = at_section(--k, x, y);
      if (behind(at)) return beyond(0, x, y);
    }
    return at;
  }

  Place at_section(std::ptrdiff_t k, Real x, Real y) const {
    const CrossSection<Real>& from = line[static_cast<std::size_t>(k)];
    const Real dx = x - from.x, dy = y - from.y;
    return {Real(double(k)), dx * from.cosine + dy * from.sine, dy * from.cosine - dx * from.sine, from.cosine, from.sine, from.length, from.lean, from.spread};
  }

  static bool behind(const Place& at) { return at.s < at.lean * at.v; }
  static bool ahead(const Place& at) { return at.s > at.length + (at.lean + at.spread) * at.v; }

  /// A point on the straight continuation of an end; for a closed line, of the end whose half of the opening contains it.
  Place beyond(std::ptrdiff_t end, Real x, Real y) const {
    const auto last = static_cast<std::ptrdiff_t>(line.size()) - 1;
    Place at = straight(end, x, y);
    const Real along = at.begin + at.s / step;
    if (closed[1] > Real(0) && (end == 0 ? along < closed[0] : along > closed[0] + closed[1])) at = straight(last - end, x, y);
    return at;
  }

  Place straight(std::ptrdiff_t end, Real x, Real y) const {
    Place at = at_section(end, x, y);
    at.length = step;
    at.lean = at.spread = Real(0);
    return at;
  }

  /// The cross section nearest to a point.
  std::ptrdiff_t nearest(Real x, Real y) const {
    struct Waiting {
      std::size_t node;
      Real distance_squared;
    };
    const std::size_t leaves = (boxes.size() / 4 + 1) / 2;
    std::array<Waiting, 64> waiting;
    std::size_t count = 0, node = 1, found = 0;
    Real least = std::numeric_limits<Real>::infinity();
    for (;;) {
      while (node && node < leaves) {
        const Real left = distance_squared(2 * node, x, y), right = distance_squared(2 * node + 1, x, y);
        const bool turns = right < left;
        if ((turns ? left : right) < least) waiting[count++] = {2 * node + !turns, turns ? left : right};
        node = (turns ? right : left) < least ? 2 * node + turns : 0;
      }
      if (node) {
        const std::size_t first = (node - leaves) * in_leaf;
        for (std::size_t i = first; i < std::min(first + in_leaf, line.size()); ++i) {
          const Real dx = x - line[i].x, dy = y - line[i].y, square = dx * dx + dy * dy;
          if (square < least) least = square, found = i;
        }
      }
      do {
        if (!count) return static_cast<std::ptrdiff_t>(found);
      } while (!(waiting[--count].distance_squared < least));
      node = waiting[count].node;
    }
  }

  /// The squared distance of a point from a box of the tree, m^2.
  Real distance_squared(std::size_t node, Real x, Real y) const {
    const Real* const box = boxes.data() + 4 * (node - 1);
    const Real dx = x < box[0] ? box[0] - x : x > box[1] ? x - box[1] : Real(0), dy = y < box[2] ? box[2] - y : y > box[3] ? y - box[3] : Real(0);
    return dx * dx + dy * dy;
  }

  // What its height is

  Height height(Real u, Real v) const {
    const Real last = Real(double(line.size() - 1)), right = across.front(), left = across.back();
    Real sign_u(1), sign_v(1);
    if (closed[1] > Real(0)) u = modulo(u - closed[0], closed[1]) + closed[0];
    if (borders[0] >= Border::repeat) u = wrapped(u, last, borders[0], sign_u);
    if (borders[1] >= Border::repeat) v = wrapped(v - right, left - right, borders[1], sign_v) + right;
    const bool off_u = u < Real(0) || u > last, off_v = v < right || v > left;
    const std::size_t k = off_u || !(u > Real(0)) ? (u > last ? line.size() - 2 : 0) : std::min(static_cast<std::size_t>(double(u)), line.size() - 2);
    const std::size_t j = static_cast<std::size_t>(std::upper_bound(across.begin() + 1, across.end() - 1, v) - across.begin()) - 1;
    const Real t = std::clamp(u - Real(double(k)), Real(0), Real(1)), w = std::clamp(v, right, left);
    const CrossSection<Real>&from = line[k], &to = line[k + 1];
    const Real *const a = heights.data() + k * across.size() + j, *const b = a + across.size();
    const Real per = Real(1) / (across[j + 1] - across[j]), by_v = (a[1] - a[0]) * per, beside = w - across[j];
    const Real uv = ((b[1] - b[0]) * per - by_v) + (to.bank - from.bank);
    const Real by_u = b[0] - a[0] + beside * ((b[1] - b[0]) * per - by_v) + (to.z - from.z) + w * (to.bank - from.bank);
    Height z{a[0] + beside * by_v + from.z + w * from.bank + t * by_u, by_u, by_v + from.bank + t * uv, uv, Real(0)};
    if (off_u) z.u = z.uv = Real(0);
    if (off_v) z.v = z.uv = Real(0);
    if (off_u) apply_border(z, 0);
    if (off_v) apply_border(z, 1);
    if (smooth[0] > Real(0)) blend(z, u * step, smooth[0], line.front().z, Real(1));
    if (smooth[1] > Real(0)) blend(z, (last - u) * step, smooth[1], line.back().z, Real(-1));
    z.u *= sign_u;
    z.v *= sign_v;
    z.uv *= sign_u * sign_v;
    return z;
  }

  /// A height beyond an edge.
  void apply_border(Height& z, std::size_t axis) const {
    if (borders[axis] == Border::zero) z = {offsets[axis], Real(0), Real(0), Real(0), Real(0)};
    else z.value += offsets[axis];
  }

  /// Blend heights near an end into those of the line.
  void blend(Height& z, Real shift, Real reach, Real line_z, Real sign) const {
    if (!(shift < reach)) return;
    const Real share = shift > Real(0) ? shift / reach : Real(0), by_u = shift > Real(0) ? sign * step / reach : Real(0), above = z.value - line_z;
    z = {line_z + share * above, share * z.u + by_u * above, share * z.v, share * z.uv + by_u * z.v, share * z.uu + Real(2) * by_u * z.u};
  }

  /// A value modulo a length.
  static Real modulo(Real shift, Real length) {
    if (shift >= Real(0) && shift < length) return shift;
    return shift - length * Real(std::floor(double(shift / length)));
  }

  /// A coordinate in a repeated or reflected field; `sign` changes its sign if reflected.
  static Real wrapped(Real place, Real length, Border border, Real& sign) {
    if (place >= Real(0) && place <= length) return place;
    if (border == Border::repeat) return modulo(place, length);
    place = modulo(place, length + length);
    if (!(place > length)) return place;
    sign = -sign;
    return length + length - place;
  }
};

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
