// Roads: height and slope over x, in pieces, one profile left of y = 0 and one right of it.
#pragma once

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

namespace cutjoint {

enum class PieceKind {
  line,    ///< z = a + b (x - begin)
  arc,     ///< z = a + sqrt(b^2 - (x - c)^2): what the centre of a disc of radius b sees of an edge at x = c
  cosine,  ///< z = a + b (1 - cos(c (x - begin)))
};

/// One piece of road from x = begin to the next piece's begin; lengths in m.
template <class Real>
struct Piece {
  PieceKind kind;
  Real begin, a, b, c;

  Real height(Real x) const {
    using std::cos, std::sqrt, std::max;
    switch (kind) {
      case PieceKind::arc: return a + sqrt(max(b * b - (x - c) * (x - c), Real(0)));
      case PieceKind::cosine: return a + b * (Real(1) - cos(c * (x - begin)));
      case PieceKind::line: break;
    }
    return a + b * (x - begin);
  }

  Real slope(Real x) const {
    using std::sin, std::sqrt, std::max;
    switch (kind) {
      case PieceKind::arc: return -(x - c) / sqrt(max(b * b - (x - c) * (x - c), Real(1e-12)));
      case PieceKind::cosine: return b * c * sin(c * (x - begin));
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
      case PieceKind::cosine: return b * c * c * cos(c * (x - begin));
      case PieceKind::line: break;
    }
    return Real(0);
  }
};

/// A road as one wheel meets it.  A point follower sees height and slope; a rigid disc sees its envelope and no slope.
template <class Real>
class Road {
 public:
  Road() : left_{flat()}, right_{flat()} {}

  /// Pieces in the order of x; the first also holds before its begin.
  Road(std::vector<Piece<Real>> left, std::vector<Piece<Real>> right, bool disc)
      : left_(std::move(left)), right_(std::move(right)), left_breaks_(breaks_of(left_)), right_breaks_(breaks_of(right_)), disc_(disc) {}

  Real height(Real x, Real y) const { return at(x, y).height(x); }
  Real slope(Real x, Real y) const { return disc_ ? Real(0) : at(x, y).slope(x); }

  /// Where one piece ends and the next begins, on the side of y.
  const std::vector<Real>& breaks(Real y) const { return y > Real(0) ? left_breaks_ : right_breaks_; }

  /// The derivatives of height and slope by x.
  Real height_dx(Real x, Real y) const { return at(x, y).slope(x); }
  Real slope_dx(Real x, Real y) const { return disc_ ? Real(0) : at(x, y).curvature(x); }

 private:
  static Piece<Real> flat() { return {PieceKind::line, Real(0), Real(0), Real(0), Real(0)}; }

  static std::vector<Real> breaks_of(const std::vector<Piece<Real>>& pieces) {
    std::vector<Real> begins;
    for (std::size_t i = 1; i < pieces.size(); ++i) begins.push_back(pieces[i].begin);
    return begins;
  }

  const Piece<Real>& at(Real x, Real y) const {
    const auto& pieces = y > Real(0) ? left_ : right_;
    const auto after = std::upper_bound(pieces.begin(), pieces.end(), x, [](Real value, const Piece<Real>& p) { return value < p.begin; });
    return after == pieces.begin() ? pieces.front() : *(after - 1);
  }

  std::vector<Piece<Real>> left_, right_;
  std::vector<Real> left_breaks_, right_breaks_;
  bool disc_ = false;
};

}  // namespace cutjoint
