// Surfaces of roads along a curved line: heights over the way along it and the distance to its left, as OpenCRG has them.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>

namespace cutjoint {

/// A cross section at a place of the line (m) and the straight piece from it to the next one: its direction and length (m), how far cross sections
/// lean forward for each metre to the left, at its begin and what is added to that at its end, and the line's height (m) and banking.
template <class Real>
struct CrossSection {
  Real x, y, cosine, sine, length, lean, spread, z, bank;
};

/// What is beyond an edge, by OpenCRG's numbers of modes.
enum class Border { zero = 1, keep, repeat, reflect };

/// Heights (m) on a grid along a line, linear between its places.  A place belongs to the piece of the line between whose cross sections it lies, of
/// all such pieces to that next to the nearest cross section: an answer depends on the place alone.
template <class Real>
struct CurvedField {
  std::span<const CrossSection<Real>> line;  ///< of the last one the direction is that of the line's end
  std::span<const Real> across;              ///< places of heights to the left of the line, rising, m
  std::span<const Real> heights;             ///< for each cross section those across
  std::span<const Real> boxes;               ///< a tree of boxes about cross sections, each from and to x and y, the root first
  Real step;                                 ///< of the line between cross sections, m
  std::array<Border, 2> borders;             ///< along the line and across
  std::array<Real, 2> offsets;               ///< of heights beyond the edges, m
  std::array<Real, 2> smooth;                ///< the way at begin and end, m, over which heights become those of the line
  std::array<Real, 2> closed;                ///< where a line that closes begins, and its length, in steps; length zero of one that does not

  /// Cross sections in a leaf of the tree.
  static constexpr std::size_t in_leaf = 8;

  /// The height at a place, or its derivative of orders 0 to 2, both together, by x and y.
  Real derivative(Real x, Real y, int by_x, int by_y) const {
    const Place at = locate(x, y);
    const Real d = Real(1) / (at.length + at.spread * at.v), t = (at.s - at.lean * at.v) * d, t_v = -(at.lean + at.spread * t) * d;
    const Over z = over(at.begin + t, at.v);
    if (by_x + by_y == 0) return z.value;
    const Real c = at.cosine, s = at.sine, z_s = z.u * d, z_v = z.v + z.u * t_v;
    if (by_x + by_y == 1) return by_x ? c * z_s - s * z_v : s * z_s + c * z_v;
    const Real ss = z.uu * d * d, sv = (z.uv + z.uu * t_v - z.u * at.spread * d) * d;
    const Real vv = (Real(2) * z.uv + z.uu * t_v) * t_v - Real(2) * z.u * at.spread * t_v * d;
    if (by_x == 1) return c * s * (ss - vv) + (c * c - s * s) * sv;
    return by_x ? c * c * ss - Real(2) * c * s * sv + s * s * vv : s * s * ss + Real(2) * c * s * sv + c * c * vv;
  }

 private:
  /// A place in the axes of a piece of the line, which begins at so many steps: along it and to its left, m.
  struct Place {
    Real begin, s, v, cosine, sine, length, lean, spread;
  };

  /// A height, m, and its derivatives by steps along the line and metres across.
  struct Over {
    Real value, u, v, uv, uu;
  };

  // Where a place is

  Place locate(Real x, Real y) const {
    const auto last = static_cast<std::ptrdiff_t>(line.size()) - 1;
    std::ptrdiff_t k = std::clamp<std::ptrdiff_t>(nearest(x, y) - 1, 0, last - 1);
    Place at = seen(k, x, y);
    if (ahead(at)) {
      while (k < last - 1 && ahead(at)) at = seen(++k, x, y);
      if (ahead(at)) return beyond(last, x, y);
    } else {
      while (k > 0 && behind(at)) at = seen(--k, x, y);
      if (behind(at)) return beyond(0, x, y);
    }
    return at;
  }

  Place seen(std::ptrdiff_t k, Real x, Real y) const {
    const CrossSection<Real>& from = line[static_cast<std::size_t>(k)];
    const Real dx = x - from.x, dy = y - from.y;
    return {Real(double(k)), dx * from.cosine + dy * from.sine, dy * from.cosine - dx * from.sine, from.cosine, from.sine, from.length, from.lean, from.spread};
  }

  static bool behind(const Place& at) { return at.s < at.lean * at.v; }
  static bool ahead(const Place& at) { return at.s > at.length + (at.lean + at.spread) * at.v; }

  /// A place on the straight continuation of an end; where the line closes, of the end whose half of the violation has it.
  Place beyond(std::ptrdiff_t end, Real x, Real y) const {
    const auto last = static_cast<std::ptrdiff_t>(line.size()) - 1;
    Place at = straight(end, x, y);
    const Real along = at.begin + at.s / step;
    if (closed[1] > Real(0) && (end == 0 ? along < closed[0] : along > closed[0] + closed[1])) at = straight(last - end, x, y);
    return at;
  }

  Place straight(std::ptrdiff_t end, Real x, Real y) const {
    Place at = seen(end, x, y);
    at.length = step;
    at.lean = at.spread = Real(0);
    return at;
  }

  /// The cross section nearest to a place.
  std::ptrdiff_t nearest(Real x, Real y) const {
    struct Waiting {
      std::size_t node;
      Real away;
    };
    const std::size_t leaves = (boxes.size() / 4 + 1) / 2;
    std::array<Waiting, 64> waiting;
    std::size_t count = 0, node = 1, found = 0;
    Real least = std::numeric_limits<Real>::infinity();
    for (;;) {
      while (node && node < leaves) {
        const Real left = away(2 * node, x, y), right = away(2 * node + 1, x, y);
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
      } while (!(waiting[--count].away < least));
      node = waiting[count].node;
    }
  }

  /// The square of the distance of a place from a box of the tree, m^2.
  Real away(std::size_t node, Real x, Real y) const {
    const Real* const box = boxes.data() + 4 * (node - 1);
    const Real dx = x < box[0] ? box[0] - x : x > box[1] ? x - box[1] : Real(0), dy = y < box[2] ? box[2] - y : y > box[3] ? y - box[3] : Real(0);
    return dx * dx + dy * dy;
  }

  // What its height is

  Over over(Real u, Real v) const {
    const Real last = Real(double(line.size() - 1)), right = across.front(), left = across.back();
    Real turn_u(1), turn_v(1);
    if (closed[1] > Real(0)) u = around(u - closed[0], closed[1]) + closed[0];
    if (borders[0] >= Border::repeat) u = into(u, last, borders[0], turn_u);
    if (borders[1] >= Border::repeat) v = into(v - right, left - right, borders[1], turn_v) + right;
    const bool off_u = u < Real(0) || u > last, off_v = v < right || v > left;
    const std::size_t k = off_u || !(u > Real(0)) ? (u > last ? line.size() - 2 : 0) : std::min(static_cast<std::size_t>(double(u)), line.size() - 2);
    const std::size_t j = static_cast<std::size_t>(std::upper_bound(across.begin() + 1, across.end() - 1, v) - across.begin()) - 1;
    const Real t = std::clamp(u - Real(double(k)), Real(0), Real(1)), w = std::clamp(v, right, left);
    const CrossSection<Real>&from = line[k], &to = line[k + 1];
    const Real *const a = heights.data() + k * across.size() + j, *const b = a + across.size();
    const Real per = Real(1) / (across[j + 1] - across[j]), by_v = (a[1] - a[0]) * per, beside = w - across[j];
    const Real uv = ((b[1] - b[0]) * per - by_v) + (to.bank - from.bank);
    const Real by_u = b[0] - a[0] + beside * ((b[1] - b[0]) * per - by_v) + (to.z - from.z) + w * (to.bank - from.bank);
    Over z{a[0] + beside * by_v + from.z + w * from.bank + t * by_u, by_u, by_v + from.bank + t * uv, uv, Real(0)};
    if (off_u) z.u = z.uv = Real(0);
    if (off_v) z.v = z.uv = Real(0);
    if (off_u) pass(z, 0);
    if (off_v) pass(z, 1);
    if (smooth[0] > Real(0)) fade(z, u * step, smooth[0], line.front().z, Real(1));
    if (smooth[1] > Real(0)) fade(z, (last - u) * step, smooth[1], line.back().z, Real(-1));
    z.u *= turn_u;
    z.v *= turn_v;
    z.uv *= turn_u * turn_v;
    return z;
  }

  /// A height beyond an edge.
  void pass(Over& z, std::size_t axis) const {
    if (borders[axis] == Border::zero) z = {offsets[axis], Real(0), Real(0), Real(0), Real(0)};
    else z.value += offsets[axis];
  }

  /// Heights within a way of an end become those of the line.
  void fade(Over& z, Real shift, Real reach, Real line_z, Real sign) const {
    if (!(shift < reach)) return;
    const Real share = shift > Real(0) ? shift / reach : Real(0), by_u = shift > Real(0) ? sign * step / reach : Real(0), above = z.value - line_z;
    z = {line_z + share * above, share * z.u + by_u * above, share * z.v, share * z.uv + by_u * z.v, share * z.uu + Real(2) * by_u * z.u};
  }

  /// A way around, from zero to a length.
  static Real around(Real shift, Real length) {
    if (shift >= Real(0) && shift < length) return shift;
    return shift - length * Real(std::floor(double(shift / length)));
  }

  /// A place in what is repeated or reflected; `turn` changes its sign where it runs backwards.
  static Real into(Real place, Real length, Border border, Real& turn) {
    if (place >= Real(0) && place <= length) return place;
    if (border == Border::repeat) return around(place, length);
    place = around(place, length + length);
    if (!(place > length)) return place;
    turn = -turn;
    return length + length - place;
  }
};

}  // namespace cutjoint
