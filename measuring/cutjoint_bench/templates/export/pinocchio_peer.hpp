// A model in Pinocchio as tables, and the peer that runs it.  Places and axes are those of the start, global; all coordinates are zero there.
#pragma once

#include <array>
#include <memory>
#include <span>

#include "mechanics.hpp"
#include "program.hpp"

namespace exported {

/// The ground where a joint is asked for.
inline constexpr int no_joint = -1;

/// An elementary joint on another one that comes before it, or on the ground.  `speeds` are those at the start: one along or about the axis,
/// three of a ball (angular velocity), six of a free joint (velocity of the point, angular velocity).
struct Joint {
  enum Kind { hinge, slide, screw, ball, free } kind;
  const char* name;
  int parent;
  Vector point, axis;
  double pitch;
  std::array<double, 6> speeds;
};

/// Mass on a joint; inertia about its centre: xx, xy, yy, xz, yz, zz.
struct Mass {
  int joint;
  double mass;
  Vector centre;
  std::array<double, 6> inertia;
};

/// A rigid body of forces.hpp: the joint that moves it and its centre of mass.
struct Body {
  int joint;
  Vector centre;
};

/// What two joints move stays together in a point, or altogether.
struct Contact {
  bool weld;
  int first, second;
  Vector on_first, on_second;
};

/// A force on a joint over the model's coordinate, which is `offset` at the start.
struct Law {
  int joint;
  double offset;
  double (*law)(double position, double rate, double t);
};

/// A joint that time prescribes: coordinate, rate, acceleration.
struct Guide {
  int joint;
  std::array<double, 3> (*law)(double t);
};

/// The solution of contacts: their compliance by the mean of 1/mass, in units of which their own flexibility is of the order of one; what
/// iterations leave of it, by the largest acceleration; how many there are at most.
struct Proximal {
  double compliance, accuracy;
  int iterations;
};

/// A model.  Contacts are held by Phidd + 2 ratio frequency Phid + frequency^2 Phi = 0.
struct Tree {
  Vector gravity;
  std::span<const Joint> joints;
  std::span<const Mass> masses;
  std::span<const Body> bodies;
  std::span<const Contact> contacts;
  std::span<const Law> laws;
  std::span<const Guide> guides;
  double frequency, ratio;
  Proximal factorised, articulated;  ///< by a sparse factorisation, and by LCABA
  void (*add_forces)(const Motion* motions, double t, Wrench* wrenches);  ///< null where there are none
};

class PinocchioPeer {
 public:
  PinocchioPeer(const Options& options, const Tree& tree);
  PinocchioPeer(PinocchioPeer&&) noexcept;
  ~PinocchioPeer();

  void step();
  void observe();
  const Motion& motion(int body) const;
  /// At the start.
  Acceleration acceleration(int body) const;

 private:
  class Engine;
  std::unique_ptr<Engine> engine_;
};

}  // namespace exported
