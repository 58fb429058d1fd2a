// A tree joint as a chain of elementary motions of the outer body, seen from the inner one: slides, turns, at most one ball.
#pragma once

#include <algorithm>
#include <array>

#include "cutjoint/generic/model.hpp"

namespace cutjoint::generic {

enum class StepKind { slide, turn, ball, offset };

/// One elementary motion.  `vector` is its axis, or the offset, in the axes that the motions before it lead to; `column` the place of its
/// coordinate among the joint's coordinates and of its speed among the speeds; `pitch` the advance of a turn in m a radian.
template <class Real>
struct ChainStep {
  StepKind kind = StepKind::offset;
  Vector3<Real> vector = Vector3<Real>::Zero();
  int column = 0;
  Real pitch{0};
  bool forms_b = true;
};

template <class Real>
struct Chain {
  std::array<ChainStep<Real>, 4> steps;
  std::size_t size = 0;
  int scalars = 0;

  void slide(const Vector3<Real>& axis) { append({StepKind::slide, axis, scalars++, Real(0), true}); }
  void turn(const Vector3<Real>& axis, Real pitch = Real(0)) { append({StepKind::turn, axis, scalars++, pitch, true}); }
  void offset(const Vector3<Real>& vector) { append({StepKind::offset, vector, 0, Real(0), true}); }

  /// A ball's coordinates and speeds stand behind all `scalars` of the joint.
  void ball(int column, bool forms_b = true) { append({StepKind::ball, Vector3<Real>::Zero(), column, Real(0), forms_b}); }

  /// The motions in the opposite order, each with the coordinate that it has.
  void reverse() { std::reverse(steps.begin(), steps.begin() + static_cast<std::ptrdiff_t>(size)); }

 private:
  void append(const ChainStep<Real>& step) { steps.at(size++) = step; }
};

/// The ball of a spherical joint; its b is not needed, since such a joint is eliminated about its centre.
template <class Real>
Chain<Real> make_ball() {
  Chain<Real> chain;
  chain.ball(0, false);
  return chain;
}

/// A ball at the inner end of a rod, a universal joint across it at the outer end.
template <class Real>
Chain<Real> make_rod(const Vector3<Real>& rod) {
  const auto [first, second] = tangents<Real>(rod);
  Chain<Real> chain;
  chain.ball(2);
  chain.offset(rod);
  chain.turn(first);
  chain.turn(second);
  return chain;
}

/// The chain of a body's joint.  A reversed joint moves its base: its motions are undone in the opposite order, so that a coordinate keeps
/// its sign and meaning.
template <class Real>
Chain<Real> make_chain(const Model<Real>& model, const Body& body) {
  const Joint& joint = body.joint;
  const Real sign(body.reversed ? -1 : 1);
  const auto axis = [&](std::size_t i) -> Vector3<Real> { return sign * model.vectors[joint.axes.at(i)]; };
  Chain<Real> chain;
  switch (joint.kind) {
    case JointKind::fixed: break;
    case JointKind::revolute: chain.turn(axis(0)); break;
    case JointKind::prismatic: chain.slide(axis(0)); break;
    case JointKind::cylindrical: chain.slide(axis(0)), chain.turn(axis(0)); break;
    case JointKind::screw: chain.turn(axis(0), model.expressions[joint.pitch]); break;
    case JointKind::universal: chain.turn(axis(0)), chain.turn(axis(1)); break;
    case JointKind::planar: {
      const auto [first, second] = tangents<Real>(model.vectors[joint.axes.at(0)]);
      chain.slide(sign * first), chain.slide(sign * second), chain.turn(axis(0));
      break;
    }
    case JointKind::spherical: return make_ball<Real>();
    case JointKind::point_on_line: chain.slide(axis(0)), chain.ball(1); break;
    case JointKind::distance: return make_rod<Real>(sign * (model.vectors[joint.to] - model.vectors[joint.at]));
    case JointKind::free:
      for (int i = 0; i < 3; ++i) chain.slide(Vector3<Real>::Unit(i));
      chain.ball(3);
      return chain;
  }
  if (body.reversed) chain.reverse();
  return chain;
}

}  // namespace cutjoint::generic
