// Forces on rigid bodies: vectors, motions, and the force elements of cutjoint's models.  SI units, global axes unless said otherwise.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <span>

namespace exported {

struct Vector {
  double x = 0, y = 0, z = 0;
};

inline Vector operator+(Vector a, Vector b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline Vector operator-(Vector a, Vector b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline Vector operator*(double s, Vector a) { return {s * a.x, s * a.y, s * a.z}; }
inline Vector& operator+=(Vector& a, Vector b) { return a = a + b; }
inline Vector& operator-=(Vector& a, Vector b) { return a = a - b; }
inline double dot(Vector a, Vector b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Vector cross(Vector a, Vector b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }
inline double norm(Vector a) { return std::sqrt(dot(a, a)); }

/// Three columns: where the axes of a frame point.
struct Rotation {
  Vector x{1, 0, 0}, y{0, 1, 0}, z{0, 0, 1};

  Vector operator*(Vector a) const { return a.x * x + a.y * y + a.z * z; }
  Rotation operator*(const Rotation& other) const { return {*this * other.x, *this * other.y, *this * other.z}; }
  /// Components of a global vector along the axes.
  Vector components(Vector a) const { return {dot(x, a), dot(y, a), dot(z, a)}; }
};

/// A body: the turn from its attitude at the start, its centre of mass, that point's velocity, its angular velocity.
struct Motion {
  Rotation R;
  Vector p, v, w;
};

/// A force through a body's centre of mass and a torque.
struct Wrench {
  Vector force, torque;
};

/// A body in a force element: how it moves, and what acts on it.
struct Side {
  const Motion& motion;
  Wrench& wrench;
};

/// A point that a body carries, its `arm` from the centre of mass given at the start.
struct Point {
  Vector arm, place, velocity;

  Point(const Motion& body, Vector arm_at_start)
      : arm(body.R * arm_at_start), place(body.p + arm), velocity(body.v + cross(body.w, arm)) {}
};

/// A force at `arm` from the centre of mass.
inline void push(Side body, Vector arm, Vector force) {
  body.wrench.force += force;
  body.wrench.torque += cross(arm, force);
}

/// A force on the follower at a place and its reaction on the base at the same place.
inline void push_pair(Side base, Side follower, Vector place, Vector force) {
  push(follower, place - follower.motion.p, force);
  push(base, place - base.motion.p, -1.0 * force);
}

/// Tension law(length, rate) between two points.
template <class Law>
void point_spring(Side base, Vector start, Side follower, Vector end, Law law) {
  const Point from(base.motion, start), to(follower.motion, end);
  const Vector way = to.place - from.place;
  const double length = norm(way);
  const Vector n = (1 / length) * way;
  push_pair(base, follower, to.place, -law(length, dot(n, to.velocity - from.velocity)) * n);
}

/// Push law(travel, rate) on the follower's point along an axis of the base; travel counts from the origin on the base.
template <class Law>
void axial_force(Side base, Vector origin, Vector axis, Side follower, Vector at, Law law) {
  const Point from(base.motion, origin), to(follower.motion, at);
  const Vector e = base.motion.R * axis, way = to.place - from.place;
  // the axis turns with the base: what of the way lies across it changes the travel too
  const double travel = dot(e, way), rate = dot(e, to.velocity - from.velocity) + dot(cross(base.motion.w, e), way);
  push_pair(base, follower, to.place, law(travel, rate) * e);
}

/// Six springs along and about the axes E of the base; G are the same axes as the follower carries them.
/// law(position, rate) takes and returns six numbers, those on the follower; a torque works on half the sum of e_k x g_k.
template <class Law>
void bushing(Side base, Vector on_base, const Rotation& E_start, Side follower, Vector on_follower, const Rotation& G_start, Law law) {
  const Point from(base.motion, on_base), to(follower.motion, on_follower);
  const Rotation E = base.motion.R * E_start, G = follower.motion.R * G_start;
  const Vector way = to.place - from.place, w = follower.motion.w - base.motion.w;
  const Vector turned = 0.5 * (cross(E.x, G.x) + cross(E.y, G.y) + cross(E.z, G.z));
  // d/dt (e_k x g_k) = e_k' x g_k + e_k x g_k', seen from the base: e_k x (w x g_k)
  const Vector turning = 0.5 * (cross(E.x, cross(w, G.x)) + cross(E.y, cross(w, G.y)) + cross(E.z, cross(w, G.z)));
  const Vector slid = E.components(way), slide_rate = E.components(to.velocity - from.velocity - cross(base.motion.w, way));
  const Vector turn = E.components(turned), turn_rate = E.components(turning);
  const std::array<double, 6> f =
      law(std::array{slid.x, slid.y, slid.z, turn.x, turn.y, turn.z},
          std::array{slide_rate.x, slide_rate.y, slide_rate.z, turn_rate.x, turn_rate.y, turn_rate.z});
  push_pair(base, follower, to.place, E * Vector{f[0], f[1], f[2]});
  const Vector m = E * Vector{f[3], f[4], f[5]};
  // m . e_k x (w x g_k) = w . g_k x (m x e_k)
  const Vector torque = 0.5 * (cross(G.x, cross(m, E.x)) + cross(G.y, cross(m, E.y)) + cross(G.z, cross(m, E.z)));
  follower.wrench.torque += torque;
  base.wrench.torque -= torque;
}

/// Force law(place, velocity) at a point, in global axes.
template <class Law>
void load(Side body, Vector at, Law law) {
  const Point point(body.motion, at);
  push(body, point.arm, law(point.place, point.velocity));
}

/// The same in axes that the body carries; the place stays global.
template <class Law>
void body_load(Side body, Vector at, const Rotation& axes_start, Law law) {
  const Point point(body.motion, at);
  const Rotation axes = body.motion.R * axes_start;
  push(body, point.arm, axes * law(point.place, axes.components(point.velocity)));
}

/// Torque law(w) over the angular velocity, in global axes.
template <class Law>
void torque(Side body, Law law) {
  body.wrench.torque += law(body.motion.w);
}

/// The same in axes that the body carries.
template <class Law>
void body_torque(Side body, const Rotation& axes_start, Law law) {
  const Rotation axes = body.motion.R * axes_start;
  body.wrench.torque += axes * law(axes.components(body.motion.w));
}

/// One stretch of road from x = start to the next one's start.
struct Piece {
  enum Kind { line, arc, cosine } kind;
  double start, a, b, c;

  double height(double x) const {
    if (kind == arc) return a + std::sqrt(std::max(b * b - (x - c) * (x - c), 0.0));
    if (kind == cosine) return a + b * (1 - std::cos(c * (x - start)));
    return a + b * (x - start);
  }
  double slope(double x) const {
    if (kind == arc) return (c - x) / std::sqrt(std::max(b * b - (x - c) * (x - c), 1e-12));
    return kind == cosine ? b * c * std::sin(c * (x - start)) : b;
  }
};

/// Height over x, left (y > 0) and right.  A road for rigid discs holds their envelope, and its force is vertical.
struct Road {
  std::span<const Piece> left, right;
  bool disc;

  double height(double x, double y) const { return at(x, y).height(x); }
  double slope(double x, double y) const { return disc ? 0.0 : at(x, y).slope(x); }

 private:
  const Piece& at(double x, double y) const {
    const std::span<const Piece> side = y > 0 ? left : right;
    const auto after = std::upper_bound(side.begin(), side.end(), x, [](double value, const Piece& p) { return value < p.start; });
    return after == side.begin() ? side.front() : *(after - 1);
  }
};

struct TyreData {
  double radius, stiffness, spin_inertia, A0, A1, A2, A3, A4, B1, B3, B4, SN, AF1, AF2;
};

/// Lateral force and aligning moment after Calspan (Frik, Leister, Schwartz, Vehicle System Dynamics 22, suppl., 1993).
inline std::array<double, 2> calspan(const TyreData& c, double load, double slip, double camber) {
  const double limit = (c.B1 * load + c.B3 + c.B4 * load * load) * c.SN * load;
  if (limit <= 0) return {0.0, 0.0};
  const double low = std::min(load, c.A2);
  const double cornering = c.A0 + c.A1 * low * (c.A2 - low) / c.A2, thrust = c.A3 * (c.A4 - low) * low / c.A4;
  const double a = -(cornering * slip + thrust * camber) / limit, size = std::abs(a);
  const double side = limit * (size < 3 ? a * (1 - size / 3 + a * a / 27) : (a < 0 ? -1.0 : 1.0));
  return {side, (c.AF1 * load + c.AF2 * std::abs(side)) * side};
}

/// A wheel that rolls on a road without a coordinate of its own; one that rolls at 0.1 m/s or less stands and is a spring along the
/// road's normal n through its centre.
inline void tyre(Side body, Vector centre_at_start, Vector axis_at_start, const TyreData& c, const Road& road) {
  const Point centre(body.motion, centre_at_start);
  const Vector axis = body.motion.R * axis_at_start;
  const double slope = road.slope(centre.place.x, centre.place.y), across = 1 / std::sqrt(1 + slope * slope);
  const Vector n{-slope * across, 0, across};
  const double clearance = centre.place.z - road.height(centre.place.x, centre.place.y);
  const double load = std::max(0.0, c.stiffness * (c.radius - clearance) * across);
  const Vector ahead = cross(axis, n), forward = (1 / norm(ahead)) * ahead, left = cross(n, forward), up = cross(forward, axis);
  const double rolling = dot(forward, centre.velocity);
  body.wrench.torque -= (c.spin_inertia * rolling / c.radius) * cross(body.motion.w, axis);
  if (rolling <= 0.1) return push(body, centre.arm, load * n);
  const auto [side, aligning] = calspan(c, load, std::atan(dot(left, centre.velocity) / rolling), std::atan(dot(n, axis) / dot(n, up)));
  // the road's plane under the centre, met along the wheel's own plane
  push(body, centre.arm - (clearance * across / dot(n, up)) * up, load * n + side * left);
  body.wrench.torque += aligning * n;
}

/// x to a whole power.
template <int n>
constexpr double power(double x) {
  if constexpr (n == 1) return x;
  else if constexpr (n % 2) return x * power<n - 1>(x);
  else return power<n / 2>(x * x);
}

}  // namespace exported
