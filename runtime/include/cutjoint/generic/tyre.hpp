// The tyre: vertical spring on the road's height, lateral and aligning force of the Calspan model (Frik, Leister, Schwartz, Vehicle System
// Dynamics 22, suppl., 1993).
#pragma once

#include <cmath>
#include <tuple>

#include "cutjoint/generic/kinematics.hpp"
#include "cutjoint/road.hpp"

namespace cutjoint::generic {

/// Rolling speed below which a wheel counts as standing, m/s.
constexpr double standing = 0.1;

/// The constants of one tyre.
template <class Real>
struct TyreValues {
  Real stiffness, radius, spin_inertia, A0, A1, A2, A3, A4, B1, B3, B4, SN, AF1, AF2;

  TyreValues(const Expressions<Real>& e, const TyreConstants& c)
      : stiffness(e[c.stiffness]), radius(e[c.radius]), spin_inertia(e[c.spin_inertia]), A0(e[c.A0]), A1(e[c.A1]), A2(e[c.A2]), A3(e[c.A3]), A4(e[c.A4]), B1(e[c.B1]),
        B3(e[c.B3]), B4(e[c.B4]), SN(e[c.SN]), AF1(e[c.AF1]), AF2(e[c.AF2]) {}
};

/// The road's force on a wheel as a wrench at the pole, and what is reported of it.
template <class Real>
struct Contact {
  Vector6<Real> wrench;
  Real load, side, aligning, slip, camber, deflection;
};

/// Lateral force and aligning moment, zero without load.
template <class Real>
std::pair<Real, Real> calspan(const TyreValues<Real>& c, Real load, Real slip, Real camber) {
  using std::abs;
  const Real capped = load < c.A2 ? load : c.A2;
  const Real cornering = c.A0 + c.A1 * capped * ((c.A2 - capped) / c.A2);
  const Real thrust = c.A3 * (c.A4 - capped) * capped / c.A4;
  const Real limit = (c.B1 * load + c.B3 + c.B4 * load * load) * c.SN * load;
  if (!(limit > Real(0))) return {Real(0), Real(0)};
  const Real a = -(cornering * slip + thrust * camber) / limit, size = abs(a);
  const Real inside = a * (1 - size / 3 + a * a / 27);
  const Real side = limit * (size < Real(3) ? inside : a < Real(0) ? Real(-1) : Real(1));
  return {side, (c.AF1 * load + c.AF2 * abs(side)) * side};
}

/// The contact under the wheel centre: n the road's normal, e_x the rolling direction, e_y the lateral one (left), e_z in the wheel's
/// plane.  A standing wheel has no slip, no lateral force, and its contact below the centre along the normal.  The rolling wheel's angular
/// momentum turns with the body, which takes its gyroscopic moment.
template <class Real>
Contact<Real> meet_road(const Kinematics<Real>& k, const Tyre& tyre, const TyreValues<Real>& c, const Road<Real>& road) {
  using std::atan, std::sqrt;
  const Vector3<Real> centre = k.point(tyre.centre), axis = k.direction(tyre.axis);
  const Vector3<Real> velocity = k.velocity(tyre.centre.body, centre);
  const Vector3<Real> place = centre + k.frame(tyre.centre.body).pole;
  const Real slope = road.slope(place.x(), place.y()), clearance = place.z() - road.height(place.x(), place.y());
  const Real n_z = 1 / sqrt(1 + slope * slope);
  const Vector3<Real> n(-slope * n_z, Real(0), n_z);
  const Vector3<Real> across = axis.cross(n), e_x = across / across.norm(), e_y = n.cross(e_x), e_z = e_x.cross(axis);
  Contact<Real> contact{};
  contact.deflection = c.radius - clearance;
  contact.load = contact.deflection > Real(0) ? c.stiffness * contact.deflection * n_z : Real(0);
  contact.camber = atan(n.dot(axis) / n.dot(e_z));
  const Real rolling = e_x.dot(velocity), drift = e_y.dot(velocity), height = clearance * n_z;
  Vector3<Real> point = centre - height * n;
  if (rolling > Real(standing)) {
    contact.slip = atan(drift / rolling);
    std::tie(contact.side, contact.aligning) = calspan(c, contact.load, contact.slip, contact.camber);
    point = centre - height / n.dot(e_z) * e_z;
  }
  contact.wrench = wrench_of<Real>(point, contact.load * n + contact.side * e_y);
  const Vector3<Real> momentum = c.spin_inertia * rolling / c.radius * axis, w = k.frame(tyre.centre.body).Z.template tail<3>();
  contact.wrench.template tail<3>() += contact.aligning * n + momentum.cross(w);
  return contact;
}

}  // namespace cutjoint::generic
