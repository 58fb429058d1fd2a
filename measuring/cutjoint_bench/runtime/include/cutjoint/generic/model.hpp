// The records of a model that is interpreted at run time: indices of bodies, of registers and of design vectors.
#pragma once

#include <algorithm>
#include <array>
#include <map>
#include <stdexcept>
#include <string>
#include <vector>

#include "cutjoint/generic/algebra.hpp"
#include "cutjoint/generic/expression.hpp"

namespace cutjoint::generic {

/// The ground's index; the bodies of the tree follow it, parents first.
constexpr int ground = 0;

/// A direction of a joint by its meaning: its axes, across both of them, from the base's point to the follower's, across the axis or that
/// way, the axes of the design position.
enum class Direction { axis, axis_2, normal, rod, across_1, across_2, x, y, z };

enum class StepKind { slide, turn, ball, offset };

/// An elementary motion of a joint's chain by a share of a coordinate; one that `advances` turns and slides.
struct Motion {
  StepKind kind = StepKind::offset;
  Direction direction = Direction::axis;
  int coordinate = 0;
  double share = 1.0;
  bool advances = false;
};

/// The way between a joint's points, or a direction that its base or its follower carries.
struct Factor {
  enum class Kind { way, base, follower };
  Kind kind = Kind::way;
  Direction direction = Direction::axis;
};

struct Product {
  Factor left, right;
  double weight = 1.0;
};

/// The condition of a cut joint: points, a direction, a frame, sums of products, a distance, an advance.
enum class ConditionKind { same_point, same_direction, same_attitude, products, same_distance, advance };

struct Condition {
  ConditionKind kind = ConditionKind::same_point;
  std::vector<Direction> directions{};
  std::vector<std::vector<Product>> sums{};
};

/// A point or a direction fixed in a body: `vector` is its index among the design vectors.
struct Fixed {
  int body = ground;
  int vector = -1;
};

/// The most coordinates of a joint that can be guided.
inline constexpr int most_guides = 4;

/// Registers of a guided coordinate and its first two rates.
struct Guide {
  int position = -1, rate = -1, acceleration = -1;
};

/// A joint of two bodies.  `axes`, `at` and `to` are design vectors, the points from the world's origin; `pitch` is a register.
///
/// `chain` moves the follower beside the base, or with `from_inner` the outer body beside the inner one; `conditions` are those of a cut
/// joint.
struct Joint {
  std::vector<int> axes;
  int at = -1, to = -1, pitch = -1;
  std::vector<Motion> chain;
  bool from_inner = false;
  std::vector<Condition> conditions;

  int scalars() const {
    int last = -1;
    for (const Motion& m : chain)
      if (m.kind == StepKind::slide || m.kind == StepKind::turn) last = std::max(last, m.coordinate);
    return last + 1;
  }
  bool has_ball() const {
    return std::any_of(chain.begin(), chain.end(), [](const Motion& m) { return m.kind == StepKind::ball; });
  }
  bool is_ball() const { return chain.size() == 1 && has_ball(); }
  bool is_free() const { return has_ball() && scalars() == 3; }
};

/// A body and the tree joint that carries it, passed from the joint's follower to its base when `reversed`.
///
/// `q`, `v` are the joint's first coordinate and the first of its `speeds`, which is 0 for fixed and guided joints; `root` is the body
/// of this branch that stands next to the ground.  `node` is the node of the body system that stands for a geared joint's unknowns, -1 of
/// others.  `mass` and `inertia` (xx, yy, zz, xy, xz, yz) are registers.
struct Body {
  int parent = ground, root = ground;
  Joint joint;
  bool reversed = false, guided = false, massless = false;
  std::array<Guide, most_guides> guides;  ///< of a guided joint's coordinates
  int q = 0, v = 0, speeds = 0, node = -1;
  int mass = -1;
  Fixed centre, inner;  ///< centre of mass; the joint's point of the parent
  std::array<int, 6> inertia{};

  bool free_root() const { return joint.is_free() && parent == ground; }
};

/// A cut joint with its equations from `first` on.
struct Cut {
  Joint joint;
  Fixed base, follower;  ///< the joint's points
  int first = 0, size = 0;
};

/// A coordinate of a gear: its place in a body's joint, and the register of its factor.
struct GearTerm {
  int body, coordinate, factor;
};

/// A gear: the sum of factor times coordinate is zero.
struct Gear {
  std::array<GearTerm, 2> terms;
  int equation = 0;
};

/// A law over a position and a rate: registers of both, of the force, and of its partial derivatives.
struct Law {
  int position = -1, rate = -1, force = -1, stiffness = -1, damping = -1;
  Routine value, tangents;
};

/// Each force writes its quantities from `quantity` on.
struct PointSpring {
  Fixed start, end;
  Law law;
  int quantity;
};

struct AxialForce {
  Fixed origin, point, axis;
  Law law;
  int quantity;
};

/// Six laws between two bodies at a point, along and about axes of the base; the registers of each law's position, rate and force.
struct Bushing {
  Fixed on_base, on_follower;
  std::array<int, 3> axes;
  std::array<Law, 6> laws;
  int quantity;
};

/// A force at `point`, or a torque; `place` and `components` are registers.
struct BodyLoad {
  Fixed point;
  bool torque, body_axes;
  std::array<int, 9> place;
  std::array<int, 3> components;
  Routine value;
  int quantity;
};

/// A tree joint's angle that joins another with a sign.
struct SignedTurn {
  int body, coordinate, sign;
};

/// A coordinate of a cut joint: the sum of turns around a planar loop, or the way from `origin` to `point` along an axis of the base, an
/// angle by the register of a screw's `pitch`.  Without these an angle has a rate only.
struct CutCoordinate {
  int cut;
  Fixed origin, point, axis;
  std::vector<SignedTurn> turns;
  bool is_angle = false, counts_turns = false;
  int pitch = -1;
};

/// A force on a coordinate of the tree joint of a body, or on a coordinate of a cut joint if `body` is negative.
struct JointForce {
  int body, coordinate;
  Law law;
  int quantity;
};

/// The constants of a tyre, as registers.
struct TyreConstants {
  int stiffness, radius, spin_inertia, A0, A1, A2, A3, A4, B1, B3, B4, SN, AF1, AF2;
};

struct Tyre {
  Fixed centre, axis;
  TyreConstants constants;
  int road, quantity;
};

/// The quantity of a column, its meaning in `Output`.
enum class Quantity {
  zero, position, velocity, angular_velocity, acceleration, roll, pitch, yaw, reaction, gear_force, force, joint_position, joint_rate,
  cut_position, cut_rate
};

/// A column: `at` is a body's point, or a reaction's direction; `index` the component of a vector, the coordinate or speed of a
/// joint, a force's quantity, a gear's equation, a reaction, or a coordinate of a cut joint.
struct Output {
  Quantity quantity = Quantity::zero;
  Fixed at;
  int index = 0;
};

/// The force or the moment of a joint on its follower: a cut joint, or the tree joint of a body if `cut` is negative.
struct Reaction {
  int cut, outer;
  Fixed follower;  ///< the follower's point
  bool moment;
};

/// A body's point or direction that others ask for.
struct Mark {
  Fixed at;
  bool is_point;
};

/// The names that a description refers to.
struct Names {
  struct Item {
    std::string name, unit;
    double value = 0.0;
  };
  std::string model;
  std::vector<std::string> coordinates, speeds, equations, roads;
  std::vector<Item> parameters, inputs, columns;
};

/// Points and directions of the design position, computed when parameters are loaded; a body's points from the body's origin.
template <class Real>
class DesignVectors {
 public:
  /// A direction, or a point from the world's origin.
  int add(const std::array<int, 3>& registers) { return append({registers, -1}); }

  /// A point from an earlier one.
  int add(const std::array<int, 3>& registers, int origin) { return append({registers, origin}); }

  void load(const Expressions<Real>& expressions) {
    for (std::size_t i = 0; i < entries_.size(); ++i) {
      const auto& [registers, origin] = entries_[i];
      values_[i] << expressions[registers[0]], expressions[registers[1]], expressions[registers[2]];
      if (origin >= 0) values_[i] -= values_[static_cast<std::size_t>(origin)];
    }
  }

  const Vector3<Real>& operator[](int i) const { return values_[static_cast<std::size_t>(i)]; }

 private:
  struct Entry {
    std::array<int, 3> registers;
    int origin;
  };

  int append(Entry entry) {
    entries_.push_back(entry);
    values_.push_back(Vector3<Real>::Zero());
    return static_cast<int>(entries_.size()) - 1;
  }

  std::vector<Entry> entries_;
  std::vector<Vector3<Real>> values_;
};

/// A model in a scene.
template <class Real>
struct Model {
  Model(std::size_t parameters, const Json& inputs) : expressions(parameters, inputs) {}

  Expressions<Real> expressions;
  DesignVectors<Real> vectors;
  Names names;
  int gravity = -1;
  std::vector<Body> bodies;  ///< the ground first
  std::vector<Cut> cuts;
  std::vector<Gear> gears;
  std::vector<PointSpring> point_springs;
  std::vector<AxialForce> axial_forces;
  std::vector<Bushing> bushings;
  std::vector<BodyLoad> loads;
  std::vector<JointForce> joint_forces;
  std::vector<CutCoordinate> cut_coordinates;
  std::vector<Tyre> tyres;
  std::vector<Output> outputs;
  std::vector<Reaction> reactions;
  std::vector<Mark> marks;  ///< points and directions that others ask for
  int quantities = 0;  ///< how many all forces report
  int nodes = 0;       ///< of the body system: the bodies, then the unknowns of geared joints

  /// A direction of a joint in the design position.
  Vector3<Real> direction_of(const Joint& joint, Direction direction) const {
    const auto axis = [&](std::size_t i) { return vectors[joint.axes.at(i)]; };
    const Vector3<Real> rod = vectors[joint.to] - vectors[joint.at];
    switch (direction) {
      case Direction::axis: return axis(0);
      case Direction::axis_2: return axis(1);
      case Direction::normal: return axis(0).cross(axis(1));
      case Direction::rod: return rod;
      case Direction::across_1: return tangents<Real>(joint.axes.empty() ? rod : axis(0)).first;
      case Direction::across_2: return tangents<Real>(joint.axes.empty() ? rod : axis(0)).second;
      case Direction::x: return Vector3<Real>::UnitX();
      case Direction::y: return Vector3<Real>::UnitY();
      case Direction::z: return Vector3<Real>::UnitZ();
    }
    throw std::logic_error("a direction without a meaning");
  }

  bool same_branch(int a, int b) const { return body(a).root == body(b).root; }
  const Body& body(int i) const { return bodies[static_cast<std::size_t>(i)]; }
};

}  // namespace cutjoint::generic
