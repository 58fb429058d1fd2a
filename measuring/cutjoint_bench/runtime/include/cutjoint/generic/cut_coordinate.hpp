// Coordinates of cut joints, measured from the motions of their bodies.
#pragma once

#include "cutjoint/generic/kinematics.hpp"

namespace cutjoint::generic {

/// Measures a coordinate of a cut joint, see `CutCoordinate`.
template <class Real>
class CutCoordinates {
 public:
  CutCoordinates(const Model<Real>& model, const Kinematics<Real>& kinematics) : model_(model), k_(kinematics) {}

  Real position(int index, const Real* q) const {
    const CutCoordinate& c = of(index);
    if (c.counts_turns) return sum(c, [&](const SignedTurn& t) { return k_.position(t.body, t.coordinate, q); });
    const Vector3<Real> way = k_.point(c.point) - k_.point(c.origin) + k_.pole_step(c.origin.body, c.point.body);
    const Real travel = k_.direction(c.axis).dot(way);
    return c.pitch < 0 ? travel : travel / model_.expressions[c.pitch];
  }

  Real rate(int index, const Real* v) const {
    const CutCoordinate& c = of(index);
    if (c.counts_turns) return sum(c, [&](const SignedTurn& t) { return k_.rate(t.body, t.coordinate, v); });
    const int base = c.origin.body, follower = c.point.body;
    const Vector3<Real> axis = k_.direction(c.axis);
    if (c.is_angle) return axis.dot(k_.frame(follower).Z.template tail<3>() - k_.frame(base).Z.template tail<3>());
    const Vector3<Real> point = k_.point(c.point);
    return axis.dot(k_.velocity(follower, point) - k_.velocity(base, point + k_.pole_step(base, follower)));
  }

  /// Axis and follower's point.
  Vector3<Real> axis(int index) const { return k_.direction(of(index).axis); }
  Vector3<Real> point(int index) const { return k_.point(of(index).point); }

  const CutCoordinate& of(int index) const { return model_.cut_coordinates[static_cast<std::size_t>(index)]; }

 private:
  template <class Value>
  Real sum(const CutCoordinate& c, Value value) const {
    Real total(0);
    for (const SignedTurn& t : c.turns) total += Real(t.sign) * value(t);
    return total;
  }

  const Model<Real>& model_;
  const Kinematics<Real>& k_;
};

}  // namespace cutjoint::generic
