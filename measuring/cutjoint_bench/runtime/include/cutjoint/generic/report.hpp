// Reported quantities: motion of bodies and markers, joint coordinates, forces, reactions.
#pragma once

#include <cmath>
#include <vector>

#include "cutjoint/generic/closure.hpp"
#include "cutjoint/generic/cut_coordinate.hpp"
#include "cutjoint/generic/force.hpp"
#include "cutjoint/generic/reactions.hpp"

namespace cutjoint::generic {

/// The variables of a column.
template <class Real>
struct Instant {
  const Real *q, *v, *vdot, *lambda;
};

template <class Real>
class Reporter {
 public:
  Reporter(const Model<Real>& model, const Kinematics<Real>& kinematics, const Forces<Real>& forces, const Closures<Real>& closures)
      : model_(model), k_(kinematics), forces_(forces), reactions_(model, kinematics, forces, closures), cuts_(model, kinematics),
        Zdd_(model.bodies.size(), Vector6<Real>::Zero()) {}

  /// Kinematics, forces and closures must belong to the instant; `system` has its bodies and applied forces alone.
  void report(const Instant<Real>& instant, BodySystem<Real>& system, Real* column) {
    accelerate(instant.vdot);
    if (!model_.reactions.empty()) reactions_.update(system, Zdd_, instant.lambda);
    for (std::size_t i = 0; i < model_.outputs.size(); ++i) column[i] = value(model_.outputs[i], instant);
  }

 private:
  /// Zdd of every body from the joints' accelerations.
  void accelerate(const Real* vdot) {
    for (int i = ground + 1; i < static_cast<int>(model_.bodies.size()); ++i) {
      const Body& body = model_.body(i);
      Vector6<Real>& Zdd = Zdd_[static_cast<std::size_t>(i)];
      Zdd = Zdd_[static_cast<std::size_t>(body.parent)] + k_.motion(i).d;
      if (body.speeds > 0) add_own(Zdd, i, body, vdot + body.v);
    }
  }

  /// b zdd, with the b that kinematics does not form.
  void add_own(Vector6<Real>& Zdd, int i, const Body& body, const Real* vdot) const {
    if (body.free_root()) Zdd += Eigen::Map<const Vector6<Real>>(vdot);
    else if (body.joint.is_ball()) {
      const Vector3<Real> wd = k_.frame(body.parent).R * Eigen::Map<const Vector3<Real>>(vdot);
      Zdd.template head<3>() += k_.motion(i).point.cross(wd);
      Zdd.template tail<3>() += wd;
    } else {
      for (int n = 0; n < body.speeds; ++n) Zdd += vdot[n] * k_.motion(i).b.col(n);
    }
  }

  Real value(const Output& output, const Instant<Real>& instant) const {
    switch (output.quantity) {
      case Quantity::zero: return Real(0);
      case Quantity::reaction:
        return reactions_.component(model_.reactions[static_cast<std::size_t>(output.index)], k_.direction(output.at));
      case Quantity::gear_force: return -instant.lambda[output.index];
      case Quantity::force: return forces_.quantity(output.index);
      case Quantity::joint_position: return k_.position(output.at.body, output.index, instant.q);
      case Quantity::cut_position: return cuts_.position(output.index, instant.q);
      case Quantity::cut_rate: return cuts_.rate(output.index, instant.v);
      case Quantity::joint_rate: return k_.rate(output.at.body, output.index, instant.v);
      default: return motion(output);
    }
  }

  /// Place, velocity, acceleration of a point; angular velocity and attitude (yaw, pitch, roll about z, y, x in turn) of its body.
  Real motion(const Output& output) const {
    using std::atan2, std::hypot;
    const Frame<Real>& frame = k_.frame(output.at.body);
    const Vector3<Real> point = k_.point(output.at);
    switch (output.quantity) {
      case Quantity::position: return point[output.index] + frame.pole[output.index];
      case Quantity::velocity: return k_.velocity(output.at.body, point)[output.index];
      case Quantity::angular_velocity: return frame.Z[3 + output.index];
      case Quantity::acceleration: return acceleration(output.at.body, point)[output.index];
      case Quantity::roll: return atan2(frame.R(2, 1), frame.R(2, 2));
      case Quantity::pitch: return atan2(-frame.R(2, 0), hypot(frame.R(2, 1), frame.R(2, 2)));
      default: return atan2(frame.R(1, 0), frame.R(0, 0));
    }
  }

  /// a_0 + wd x p + w x (v_0 + w x p).
  Vector3<Real> acceleration(int body, const Vector3<Real>& point) const {
    const Vector6<Real>& Zdd = Zdd_[static_cast<std::size_t>(body)];
    const Vector3<Real> w = k_.frame(body).Z.template tail<3>(), wd = Zdd.template tail<3>();
    return Zdd.template head<3>() + wd.cross(point) + w.cross(k_.velocity(body, point));
  }

  const Model<Real>& model_;
  const Kinematics<Real>& k_;
  const Forces<Real>& forces_;
  Reactions<Real> reactions_;
  CutCoordinates<Real> cuts_;
  std::vector<Vector6<Real>> Zdd_;
};

}  // namespace cutjoint::generic
