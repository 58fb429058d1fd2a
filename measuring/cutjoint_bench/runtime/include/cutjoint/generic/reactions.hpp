// Reactions of joints: what a joint does to its follower.
//
//     cut joint:   W = -A^T lambda + what acts on its coordinates
//     tree joint:  W_i = M Zdd - Q + sum of A^T lambda + sum of W_j        over the cut joints at body i and the bodies j that it carries
#pragma once

#include <vector>

#include "cutjoint/generic/force.hpp"
#include "cutjoint/generic/loops.hpp"

namespace cutjoint::generic {

template <class Real>
class Reactions {
 public:
  Reactions(const Model<Real>& model, const Kinematics<Real>& kinematics, const Forces<Real>& forces, const Closures<Real>& closures)
      : model_(model), k_(kinematics), forces_(forces), closures_(closures), pulls_(model.cuts.size()), carried_(model.bodies.size()) {}

  /// `system` must have the bodies and the applied forces alone.
  void update(BodySystem<Real>& system, const std::vector<Vector6<Real>>& Zdd, const Real* lambda) {
    for (int i = ground; i < static_cast<int>(carried_.size()); ++i) carried(i) = system.M(i) * Zdd[static_cast<std::size_t>(i)] - system.Q(i);
    for (std::size_t i = 0; i < pulls_.size(); ++i) pull(i, lambda);
    for (int i = static_cast<int>(carried_.size()) - 1; i > ground; --i) {
      if (model_.body(i).parent != ground) carried(model_.body(i).parent) += carried(i);
    }
  }

  /// The component along a direction in global axes, of the force or of the moment about the follower's point.
  Real component(const Reaction& reaction, const Vector3<Real>& direction) const {
    const bool cut = reaction.cut >= 0;
    const int at = cut ? reaction.follower.body : reaction.outer;
    const Vector6<Real>& wrench = cut ? pulls_[static_cast<std::size_t>(reaction.cut)] : carried_[static_cast<std::size_t>(at)];
    const Real sign(at == reaction.follower.body ? 1 : -1);
    const Vector3<Real> force = wrench.template head<3>();
    if (!reaction.moment) return sign * direction.dot(force);
    const Vector3<Real> point = k_.point(reaction.follower) + k_.pole_step(at, reaction.follower.body);
    return sign * direction.dot(wrench.template tail<3>() - point.cross(force));
  }

 private:
  Vector6<Real>& carried(int i) { return carried_[static_cast<std::size_t>(i)]; }

  /// -A^T lambda on the follower, and what the joints that carry the cut joint's bodies must do for it.
  void pull(std::size_t i, const Real* lambda) {
    const Cut& cut = model_.cuts[i];
    pulls_[i].setZero();
    for (int n = 0; n < cut.size; ++n) pulls_[i] -= lambda[cut.first + n] * closures_[i].equations.At.col(n);
    carried(cut.follower.body) -= pulls_[i];
    carried(cut.base.body) += transport<Real>(closures_[i].step).transpose() * pulls_[i];
    pulls_[i] += forces_.on_cut_joint(i);
  }

  const Model<Real>& model_;
  const Kinematics<Real>& k_;
  const Forces<Real>& forces_;
  const Closures<Real>& closures_;
  std::vector<Vector6<Real>> pulls_, carried_;
};

}  // namespace cutjoint::generic
