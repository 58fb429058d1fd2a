// The tyre: vertical spring on the road's height, lateral and aligning force of the Calspan model (Frik, Leister, Schwartz, Vehicle System
// Dynamics 22, suppl., 1993).
#pragma once

#include <cmath>
#include <tuple>

#include "cutjoint/generic/kinematics.hpp"
#include "cutjoint/core/roads/road.hpp"

namespace cutjoint::generic {

/// Rolling speed below which a wheel counts as standing, m/s.
constexpr double standing = 0.1;

/// The constants of one tyre.
template <class Real>
struct TyreValues {
  Real stiffness, radius, spin_inertia, A0, A1, A2, A3, A4, B1, B3, B4, SN, AF1, AF2;

  TyreValues(const Expressions<Real>& e, const TyreConstants& c)
      : stiffness(e[c.stiffness]), radius(e[c.radius]), spin_inertia(e[c.spin_inertia]), A0(e[c.A0]), A1(e[c.A1]), A2(e[c.A2]),
        A3(e[c.A3]), A4(e[c.A4]), B1(e[c.B1]), B3(e[c.B3]), B4(e[c.B4]), SN(e[c.SN]), AF1(e[c.AF1]), AF2(e[c.AF2]) {}
};

/// The action of the road on a wheel: a force at `arm` from the wheel's centre and a moment, with their reported quantities.
template <class S>
struct Contact {
  Vector3<S> arm, force, moment;
  S rolling, load, side, aligning, slip, camber, deflection;
};

/// atan, also of Eigen's numbers with derivatives, which have none.
template <class S>
S arctangent(const S& x) {
  using std::atan;
  if constexpr (requires { x.derivatives(); }) return {atan(x.value()), x.derivatives() / (1 + x.value() * x.value())};
  else return atan(x);
}

/// Lateral force and aligning moment, zero without load.
template <class S, class Real>
std::pair<S, S> calspan(const TyreValues<Real>& c, const S& load, const S& slip, const S& camber) {
  using std::abs;
  const S capped = load < c.A2 ? load : S(c.A2);
  const S cornering = c.A0 + c.A1 * capped * ((c.A2 - capped) / c.A2);
  const S thrust = c.A3 * (c.A4 - capped) * capped / c.A4;
  const S limit = (c.B1 * load + c.B3 + c.B4 * load * load) * c.SN * load;
  if (!(limit > Real(0))) return {S(0), S(0)};
  const S a = -(cornering * slip + thrust * camber) / limit, size = abs(a);
  const S inside = a * (Real(1) - size / Real(3) + a * a / Real(27));
  const S side = limit * (size < Real(3) ? inside : a < Real(0) ? S(-1) : S(1));
  return {side, (c.AF1 * load + c.AF2 * abs(side)) * side};
}

/// The contact under the wheel centre, which is `clearance` above a road of this slope: n the road's normal, e_x the rolling direction,
/// e_y the lateral one (left), e_z in the wheel's plane.  A standing wheel has no slip, no lateral force, and its contact below the centre
/// along the normal.  S is Real, or Real with derivatives.
template <class S, class Real>
Contact<S> touch_road(const TyreValues<Real>& c, const S& clearance, const S& slope, const Vector3<S>& axis, const Vector3<S>& velocity) {
  using std::sqrt;
  const S n_z = Real(1) / sqrt(Real(1) + slope * slope);
  const Vector3<S> n(-slope * n_z, S(0), n_z);
  const Vector3<S> across = axis.cross(n), e_x = across / sqrt(S(across.squaredNorm())), e_y = n.cross(e_x), e_z = e_x.cross(axis);
  Contact<S> contact;
  contact.deflection = c.radius - clearance;
  contact.load = contact.deflection > Real(0) ? S(c.stiffness * contact.deflection * n_z) : S(0);
  const S upright = n.dot(e_z), height = clearance * n_z;
  contact.camber = arctangent<S>(n.dot(axis) / upright);
  contact.rolling = e_x.dot(velocity);
  contact.slip = contact.side = contact.aligning = S(0);
  contact.arm = -height * n;
  if (contact.rolling > Real(standing)) {
    contact.slip = arctangent<S>(e_y.dot(velocity) / contact.rolling);
    std::tie(contact.side, contact.aligning) = calspan<S>(c, contact.load, contact.slip, contact.camber);
    contact.arm = S(-height / upright) * e_z;
  }
  contact.force = contact.load * n + contact.side * e_y;
  contact.moment = contact.aligning * n;
  return contact;
}

/// The contact of a wheel, and all that acts on its body as a wrench at the pole.  The rolling wheel's angular momentum turns with the
/// body, which takes its gyroscopic moment.
template <class Real>
std::pair<Contact<Real>, Vector6<Real>> meet_road(const Kinematics<Real>& k, const Tyre& tyre, const TyreValues<Real>& c,
                                                  const Road<Real>& road) {
  const int body = tyre.centre.body;
  const Vector3<Real> centre = k.point(tyre.centre), axis = k.direction(tyre.axis), place = centre + k.frame(body).pole;
  const Real clearance = place.z() - road.height(place.x(), place.y()), slope = road.slope(place.x(), place.y());
  const Contact<Real> contact = touch_road<Real, Real>(c, clearance, slope, axis, k.velocity(body, centre));
  const Vector3<Real> momentum = c.spin_inertia * contact.rolling / c.radius * axis, w = k.frame(body).Z.template tail<3>();
  Vector6<Real> wrench = wrench_of<Real>(centre + contact.arm, contact.force);
  wrench.template tail<3>() += contact.moment + momentum.cross(w);
  return {contact, wrench};
}

}  // namespace cutjoint::generic
