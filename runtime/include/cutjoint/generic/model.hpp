// The records of a model that is interpreted at run time: indices of bodies, of registers and of design vectors.
#pragma once

#include <array>
#include <map>
#include <string>
#include <vector>

#include "cutjoint/generic/algebra.hpp"
#include "cutjoint/generic/expression.hpp"

namespace cutjoint::generic {

/// The ground's index; the bodies of the tree follow it, parents first.
constexpr int ground = 0;

enum class JointKind { fixed, revolute, prismatic, cylindrical, screw, universal, planar, spherical, point_on_line, distance, free };

/// A point or a direction fixed in a body: `vector` is its index among the design vectors.
struct Fixed {
  int body = ground;
  int vector = -1;
};

/// Registers of a guided coordinate and its first two rates.
struct Guide {
  int position = -1, rate = -1, acceleration = -1;
};

/// What joins two bodies.  `axes`, `at` and `to` are design vectors, the points from the world's origin; `pitch` is a register.
struct Joint {
  JointKind kind = JointKind::fixed;
  std::vector<int> axes;
  int at = -1, to = -1, pitch = -1;
};

/// A body and the tree joint that carries it, passed from the joint's follower to its base when `reversed`.
///
/// `q`, `v` are the joint's first coordinate and the first of its `speeds`, which is 0 for fixed and guided joints; `root` is the body
/// of this branch that stands next to the ground.  `mass` and `inertia` (xx, yy, zz, xy, xz, yz) are registers.
struct Body {
  int parent = ground, root = ground;
  Joint joint;
  bool reversed = false, guided = false, massless = false;
  std::array<Guide, 3> guides;  ///< of a guided joint's coordinates
  int q = 0, v = 0, speeds = 0;
  int mass = -1;
  Fixed centre, inner;  ///< centre of mass; the joint's point of the parent
  std::array<int, 6> inertia{};

  bool free_root() const { return joint.kind == JointKind::free && parent == ground; }
};

/// A cut joint with its equations from `first` on.
struct Cut {
  Joint joint;
  Fixed base, follower;  ///< the joint's points
  int first = 0, size = 0;
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

/// What a column reports, its meaning in `Output`.
enum class Quantity {
  zero, position, velocity, angular_velocity, acceleration, roll, pitch, yaw, reaction, force, joint_position, joint_rate
};

/// A column: `at` is a body's point, or a reaction's direction; `index` the component of a vector, the coordinate or speed of a
/// joint, or a force's quantity; `cut` the cut joint of a reaction.
struct Output {
  Quantity quantity = Quantity::zero;
  Fixed at;
  int index = 0, cut = -1;
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
  std::vector<Item> parameters, columns;
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
  explicit Model(std::size_t parameters) : expressions(parameters) {}

  Expressions<Real> expressions;
  DesignVectors<Real> vectors;
  Names names;
  int gravity = -1;
  std::vector<Body> bodies;  ///< the ground first
  std::vector<Cut> cuts;
  std::vector<PointSpring> point_springs;
  std::vector<AxialForce> axial_forces;
  std::vector<Bushing> bushings;
  std::vector<BodyLoad> loads;
  std::vector<JointForce> joint_forces;
  std::vector<Tyre> tyres;
  std::vector<Output> outputs;
  std::vector<Mark> marks;  ///< points and directions that others ask for
  int quantities = 0;  ///< how many all forces report

  bool same_branch(int a, int b) const { return body(a).root == body(b).root; }
  const Body& body(int i) const { return bodies[static_cast<std::size_t>(i)]; }
};

}  // namespace cutjoint::generic
