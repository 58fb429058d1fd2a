// The block system in body space: sum_i Z*_i^T ( M_i Zdd_i + sum_j C_ij Zdd_j - Q_i ) = 0.
#pragma once

#include <vector>

#include "cutjoint/generic/kinematics.hpp"
#include "cutjoint/generic/plan.hpp"

namespace cutjoint::generic {

/// Body matrices, forces, couplings in the slots of a plan, and forces on joints' coordinates; what is added to the ground is not read.
///
/// Nodes beyond the bodies are geared joints' unknowns.
template <class Real>
class BodySystem {
 public:
  BodySystem(std::size_t nodes, std::size_t slots)
      : M_(nodes, Matrix6<Real>::Zero()), Q_(nodes, Vector6<Real>::Zero()), joint_force_(nodes, Vector6<Real>::Zero()),
        C_(slots, Matrix6<Real>::Zero()) {}

  void clear() {
    for (auto& M : M_) M.setZero();
    for (auto& Q : Q_) Q.setZero();
    for (auto& C : C_) C.setZero();
    for (auto& force : joint_force_) force.setZero();
  }

  Matrix6<Real>& M(int i) { return M_[static_cast<std::size_t>(i)]; }
  Vector6<Real>& Q(int i) { return Q_[static_cast<std::size_t>(i)]; }
  /// On the joint's speeds, in their order.
  Vector6<Real>& joint_force(int i) { return joint_force_[static_cast<std::size_t>(i)]; }

  /// C_ij of node i's link to j.
  Matrix6<Real> coupling(const Link& link) const {
    const Matrix6<Real>& C = C_[static_cast<std::size_t>(link.slot)];
    return link.transposed ? Matrix6<Real>(C.transpose()) : C;
  }

  /// C_ij += block, C_ji += block^T; a coupling of a body with itself closes into its M.
  void couple(const Target& target, const Matrix6<Real>& block) {
    switch (target.kind) {
      case Target::Kind::nothing: return;
      case Target::Kind::diagonal: M(target.index) += block + block.transpose(); return;
      case Target::Kind::slot: {
        Matrix6<Real>& C = C_[static_cast<std::size_t>(target.index)];
        if (target.transposed) C += block.transpose();
        else C += block;
      }
    }
  }

 private:
  std::vector<Matrix6<Real>> M_;
  std::vector<Vector6<Real>> Q_;
  std::vector<Vector6<Real>> joint_force_;
  std::vector<Matrix6<Real>> C_;
};

/// Mass, and inertia about the centre of mass in body axes; set when parameters are loaded.
template <class Real>
struct Inertia {
  Real mass{0};
  Matrix3<Real> own = Matrix3<Real>::Zero();
};

template <class Real>
Inertia<Real> inertia_of(const Expressions<Real>& e, const Body& body) {
  Inertia<Real> inertia;
  const Real xx = e[body.inertia[0]], yy = e[body.inertia[1]], zz = e[body.inertia[2]];
  const Real xy = e[body.inertia[3]], xz = e[body.inertia[4]], yz = e[body.inertia[5]];
  inertia.mass = e[body.mass];
  inertia.own << xx, xy, xz, xy, yy, yz, xz, yz, zz;
  return inertia;
}

/// M = [m, -m c~; m c~, J - m c~ c~], Q = [m (g - w x v_G); c x m (g - w x v_G) - w x J w] of a body (eqs. 24, 25).
template <class Real>
void add_body(BodySystem<Real>& system, const Kinematics<Real>& k, const Vector3<Real>& gravity, int i, const Body& body,
              const Inertia<Real>& inertia) {
  const Frame<Real>& frame = k.frame(i);
  const Vector3<Real> c = k.point(body.centre), w = frame.Z.template tail<3>();
  const Matrix3<Real> J = frame.R * inertia.own * frame.R.transpose(), arm = skew<Real>(c), moment = inertia.mass * arm;
  Matrix6<Real>& M = system.M(i);
  M.template topLeftCorner<3, 3>().diagonal().array() += inertia.mass;
  M.template topRightCorner<3, 3>() -= moment;
  M.template bottomLeftCorner<3, 3>() += moment;
  M.template bottomRightCorner<3, 3>() += J - moment * arm;
  const Vector3<Real> weight = inertia.mass * (gravity - w.cross(k.velocity(i, c)));
  Vector6<Real> wrench = wrench_of<Real>(c, weight);
  wrench.template tail<3>() -= w.cross(Vector3<Real>(J * w));
  system.Q(i) += wrench;
}

}  // namespace cutjoint::generic
