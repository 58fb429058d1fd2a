// Roads: piecewise profiles of height and slope over x, left and right of y = 0, plus a surface.
#pragma once

#include "cutjoint/core/roads/surface.hpp"

namespace cutjoint {

enum class PieceKind {
  line,    ///< z = a + b (x - start)
  arc,     ///< z = a + sqrt(b^2 - (x - c)^2): the path of the centre of a disc of radius b over an edge at x = c
  cosine,  ///< z = a + b (1 - cos(c (x - start)))
};

/// One piece of road from x = start to the next piece's start; lengths in m.
template <class Real>
struct Piece {
  PieceKind kind;
  Real start, a, b, c;

  Real height(Real x) const {
    using std::cos, std::sqrt, std::max;
    switch (kind) {
      case PieceKind::arc: return a + sqrt(max(b * b - (x - c) * (x - c), Real(0)));
      case PieceKind::cosine: return a + b * (Real(1) - cos(c * (x - start)));
      case PieceKind::line: break;
    }
    return a + b * (x - start);
  }

  Real slope(Real x) const {
    using std::sin, std::sqrt, std::max;
    switch (kind) {
      case PieceKind::arc: return -(x - c) / sqrt(max(b * b - (x - c) * (x - c), Real(1e-12)));
      case PieceKind::cosine: return b * c * sin(c * (x - start));
      case PieceKind::line: break;
    }
    return b;
  }

  Real curvature(Real x) const {
    using std::cos, std::sqrt, std::max;
    switch (kind) {
      case PieceKind::arc: {
        const Real root = sqrt(max(b * b - (x - c) * (x - c), Real(1e-12)));
        return -b * b / (root * root * root);
      }
      case PieceKind::cosine: return b * c * c * cos(c * (x - start));
      case PieceKind::line: break;
    }
    return Real(0);
  }
};

/// One side of a road: its pieces in the order of x, of which the first also holds before its beginning, and the beginnings of the others; owned by
/// another object.
template <class Real>
struct Track {
  std::span<const Piece<Real>> pieces;
  std::span<const Real> breaks;

  const Piece<Real>& at(Real x) const {
    const auto after = std::upper_bound(breaks.begin(), breaks.end(), x);
    return pieces[static_cast<std::size_t>(after - breaks.begin())];
  }
};

/// A road for one wheel.  A point follower has height and slope; a rigid disc has the height of its envelope and no slope.
template <class Real>
class Road {
 public:
  constexpr Road() : Road({.pieces = flat, .breaks = {}}, {.pieces = flat, .breaks = {}}, false) {}
  constexpr Road(const Track<Real>& left, const Track<Real>& right, bool disc, const Surface<Real>* surface = nullptr)
      : left_(left), right_(right), disc_(disc), surface_(surface) {}

  Real height(Real x, Real y) const { return track(y).at(x).height(x); }
  Real slope(Real x, Real y) const { return disc_ ? Real(0) : track(y).at(x).slope(x); }

  /// The breaks between pieces on the side of y.
  std::span<const Real> breaks(Real y) const { return track(y).breaks; }

  /// The derivatives of height and slope with respect to x.
  Real height_dx(Real x, Real y) const { return track(y).at(x).slope(x); }
  Real slope_dx(Real x, Real y) const { return disc_ ? Real(0) : track(y).at(x).curvature(x); }

  /// The surface's height above the tracks, and the friction factor, or their partial derivatives with respect to x and y.
  Real surface(Real x, Real y, int by_x, int by_y) const { return surface_ ? surface_->height(x, y, by_x, by_y) : Real(0); }
  Real friction(Real x, Real y, int by_x, int by_y) const { return surface_ ? surface_->friction(x, y, by_x, by_y) : Real(by_x + by_y > 0 ? 0 : 1); }

 private:
  static constexpr Piece<Real> flat[1] = {{PieceKind::line, Real(0), Real(0), Real(0), Real(0)}};

  const Track<Real>& track(Real y) const { return y > Real(0) ? left_ : right_; }

  Track<Real> left_, right_;
  bool disc_;
  const Surface<Real>* surface_ = nullptr;  ///< shared by all wheels
};

}  // namespace cutjoint
