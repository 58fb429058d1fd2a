// A tree joint as a chain of elementary motions of the outer body, seen from the inner one: slides, turns, at most one ball.
#pragma once

#include <algorithm>
#include <utility>
#include <vector>

#include "cutjoint/generic/model.hpp"

namespace cutjoint::generic {

/// One elementary motion.  `vector` is its axis, or the offset, in the axes that the motions before it lead to; `column` the place of its
/// coordinate among the joint's coordinates and of its speed among the speeds; `pitch` the advance of a turn in m a radian.  It moves by a
/// `share` of its coordinate, and `adds` to the column of b when a motion before it has the same one.
template <class Real>
struct ChainStep {
  StepKind kind = StepKind::offset;
  Vector3<Real> vector = Vector3<Real>::Zero();
  int column = 0;
  Real pitch{0}, share{1};
  bool adds = false, forms_b = true;
};

template <class Real>
using Chain = std::vector<ChainStep<Real>>;

/// The joint as its inner body sees it: a reversed one from its other end.
inline Joint seen_from_inner(Joint joint, bool is_reversed) {
  if (is_reversed) {
    if (joint.from_inner) std::swap(joint.at, joint.to);
    else std::reverse(joint.chain.begin(), joint.chain.end());
  }
  return joint;
}

/// Fill the chain of a body's joint, `joint` as its inner body sees it.  A reversed joint moves its base: its motions are undone in the
/// opposite order, so that a coordinate keeps its sign and meaning, but for those that count from the inner body.  Nothing is allocated where
/// the chain has room for all motions.
template <class Real>
void fill_chain(const Model<Real>& model, const Joint& joint, bool is_reversed, Chain<Real>& chain) {
  const Real sign(is_reversed && !joint.from_inner ? -1 : 1);
  chain.clear();
  for (const Motion& m : joint.chain) {
    ChainStep<Real> step{.kind = m.kind};
    if (m.kind == StepKind::ball) step.column = joint.scalars();
    else step.vector = sign * model.direction_of(joint, m.direction), step.column = m.coordinate;
    step.share = Real(m.share);
    if (m.advances) step.pitch = model.expressions[joint.pitch];
    step.forms_b = !joint.is_ball();  // a spherical joint is eliminated about its centre
    step.adds = std::any_of(chain.begin(), chain.end(), [&](const auto& other) {
      return other.kind != StepKind::offset && step.kind != StepKind::offset && other.column == step.column;
    });
    chain.push_back(step);
  }
}

}  // namespace cutjoint::generic
