// Applied forces as contributions to the body system, with the quantities that they report.
#pragma once

#include <algorithm>
#include <vector>

#include "cutjoint/generic/body_system.hpp"
#include "cutjoint/generic/cut_coordinate.hpp"
#include "cutjoint/generic/tyre.hpp"

namespace cutjoint::generic {

template <class Real>
class Forces {
 public:
  Forces(Model<Real>& model, const Kinematics<Real>& kinematics)
      : model_(model), e_(model.expressions), k_(kinematics), cuts_(model, kinematics), quantities_(static_cast<std::size_t>(model.quantities)),
        on_cut_joints_(model.cuts.size()) {}

  void load(const Road<Real>* roads) {
    roads_ = roads;
    tyres_.clear();
    for (const Tyre& tyre : model_.tyres) tyres_.emplace_back(e_, tyre.constants);
  }

  void add(BodySystem<Real>& system, const Real* q, const Real* v) {
    for (Vector6<Real>& wrench : on_cut_joints_) wrench.setZero();
    for (const PointSpring& force : model_.point_springs) add(system, force);
    for (const AxialForce& force : model_.axial_forces) add(system, force);
    for (const Bushing& force : model_.bushings) add(system, force);
    for (const BodyLoad& force : model_.loads) add(system, force);
    for (const JointForce& force : model_.joint_forces) add(system, force, q, v);
    for (std::size_t i = 0; i < tyres_.size(); ++i) add(system, model_.tyres[i], tyres_[i]);
  }

  /// The partial derivatives of the laws, at the positions and rates of the last `add`.
  void add_tangents() {
    for (const PointSpring& force : model_.point_springs) add_tangents(force.law, force.quantity);
    for (const AxialForce& force : model_.axial_forces) add_tangents(force.law, force.quantity);
    for (const JointForce& force : model_.joint_forces) add_tangents(force.law, force.quantity);
  }

  /// The wrench of forces on the coordinates of a cut joint on its follower.
  const Vector6<Real>& on_cut_joint(std::size_t cut) const { return on_cut_joints_[cut]; }

  Real quantity(int i) const { return quantities_[static_cast<std::size_t>(i)]; }

 private:
  /// Laws report force, stiffness, damping, position, rate in this order.
  Real evaluate(const Law& law, int quantity, Real position, Real rate) {
    e_.set(law.position, position);
    e_.set(law.rate, rate);
    e_.run(law.value);
    const Real force = e_[law.force];
    Real* out = &quantities_[static_cast<std::size_t>(quantity)];
    out[0] = force;
    return force;
  }

  void add_tangents(const Law& law, int quantity) {
    e_.run(law.tangents);
    Real* out = &quantities_[static_cast<std::size_t>(quantity)];
    out[1] = e_[law.stiffness];
    out[2] = e_[law.damping];
  }

  void report(int quantity, Real position, Real rate) {
    quantities_[static_cast<std::size_t>(quantity) + 3] = position;
    quantities_[static_cast<std::size_t>(quantity) + 4] = rate;
  }

  /// A force on the follower at a point, its reaction on the base on the same line.
  void push_pair(BodySystem<Real>& system, int base, int follower, const Vector3<Real>& point, const Vector3<Real>& force) {
    const Vector6<Real> wrench = wrench_of<Real>(point, force);
    system.Q(follower) += wrench;
    if (model_.same_branch(base, follower)) system.Q(base) -= wrench;
    else system.Q(base) -= wrench_of<Real>(point + k_.pole_step(base, follower), force);
  }

  /// n = (p_end - p_start)/length, the follower gets -law(length, rate) n.
  void add(BodySystem<Real>& system, const PointSpring& force) {
    const int base = force.start.body, follower = force.end.body;
    const Vector3<Real> start = k_.point(force.start), end = k_.point(force.end);
    const Vector3<Real> way = end - start + k_.pole_step(base, follower);
    const Real length = way.norm();
    const Vector3<Real> n = way / length;
    const Real rate = n.dot(k_.velocity(follower, end) - k_.velocity(base, start));
    const Real tension = evaluate(force.law, force.quantity, length, rate);
    report(force.quantity, length, rate);
    push_pair(system, base, follower, end, -tension * n);
  }

  /// travel = e . (p - p_origin), the follower gets law(travel, rate) e.
  void add(BodySystem<Real>& system, const AxialForce& force) {
    const int base = force.origin.body, follower = force.point.body;
    const Vector3<Real> axis = k_.direction(force.axis), point = k_.point(force.point), step = k_.pole_step(base, follower);
    const Real travel = axis.dot(point - k_.point(force.origin) + step);
    const Real rate = axis.dot(k_.velocity(follower, point) - k_.velocity(base, point + step));
    const Real push = evaluate(force.law, force.quantity, travel, rate);
    report(force.quantity, travel, rate);
    push_pair(system, base, follower, point, push * axis);
  }

  /// x = E^T (p_f - p_b), theta = half the sum of e_k x g_k in E, the follower gets E law(x) and E (d theta/d turn)^T law(theta).
  void add(BodySystem<Real>& system, const Bushing& bushing) {
    const int base = bushing.on_base.body, follower = bushing.on_follower.body;
    Matrix3<Real> axes;
    for (int i = 0; i < 3; ++i) axes.col(i) = model_.vectors[bushing.axes[static_cast<std::size_t>(i)]];
    const Matrix3<Real> E = k_.frame(base).R * axes, S = E.transpose() * k_.frame(follower).R * axes;
    const Matrix3<Real> by_turn = (S.trace() * Matrix3<Real>::Identity() - S) / Real(2);
    const Vector3<Real> point = k_.point(bushing.on_follower), step = k_.pole_step(base, follower);
    const Vector3<Real> spin = k_.frame(follower).Z.template tail<3>() - k_.frame(base).Z.template tail<3>();
    Vector6<Real> place, rate, load;
    place << E.transpose() * (point - k_.point(bushing.on_base) + step), S(2, 1) - S(1, 2), S(0, 2) - S(2, 0), S(1, 0) - S(0, 1);
    place.template tail<3>() /= Real(2);
    rate << E.transpose() * (k_.velocity(follower, point) - k_.velocity(base, point + step)), by_turn * (E.transpose() * spin);
    for (int i = 0; i < 6; ++i) {
      const Law& law = bushing.laws[static_cast<std::size_t>(i)];
      e_.set(law.position, place[i]);
      e_.set(law.rate, rate[i]);
      e_.run(law.value);
      load[i] = e_[law.force];
    }
    load.template tail<3>() = (by_turn.transpose() * load.template tail<3>()).eval();
    Real* out = &quantities_[static_cast<std::size_t>(bushing.quantity)];
    std::copy_n(place.data(), 6, std::copy_n(load.data(), 6, out));
    const Vector3<Real> force = E * load.template head<3>(), torque = E * load.template tail<3>();
    push_pair(system, base, follower, point, force);
    system.Q(follower).template tail<3>() += torque;
    system.Q(base).template tail<3>() -= torque;
  }

  void add(BodySystem<Real>& system, const BodyLoad& load) {
    const int body = load.point.body;
    const Frame<Real>& frame = k_.frame(body);
    const Vector3<Real> point = load.torque ? frame.r : k_.point(load.point), place = point + frame.pole;
    Vector3<Real> speed = k_.velocity(body, point), spin = frame.Z.template tail<3>(), components;
    if (load.body_axes) speed = frame.R.transpose() * speed, spin = frame.R.transpose() * spin;
    for (std::size_t i = 0; i < 3; ++i) {
      e_.set(load.place[i], place[static_cast<int>(i)]);
      e_.set(load.place[i + 3], speed[static_cast<int>(i)]);
      e_.set(load.place[i + 6], spin[static_cast<int>(i)]);
    }
    e_.run(load.value);
    for (std::size_t i = 0; i < 3; ++i) components[static_cast<int>(i)] = e_[load.components[i]];
    for (int i = 0; i < 3; ++i) quantities_[static_cast<std::size_t>(load.quantity + i)] = components[i];
    const Vector3<Real> vector = load.body_axes ? Vector3<Real>(frame.R * components) : components;
    if (load.torque) system.Q(body).template tail<3>() += vector;
    else system.Q(body) += wrench_of<Real>(point, vector);
  }

  void add(BodySystem<Real>& system, const JointForce& force, const Real* q, const Real* v) {
    if (force.body < 0) return add_to_cut_joint(system, force, q, v);
    const Real position = k_.position(force.body, force.coordinate, q), rate = k_.rate(force.body, force.coordinate, v);
    system.joint_force(force.body)[force.coordinate] += evaluate(force.law, force.quantity, position, rate);
  }

  /// A force along the coordinate, or a torque about its axis, on both bodies.
  void add_to_cut_joint(BodySystem<Real>& system, const JointForce& force, const Real* q, const Real* v) {
    const CutCoordinate& c = cuts_.of(force.coordinate);
    const Real position = cuts_.position(force.coordinate, q), rate = cuts_.rate(force.coordinate, v);
    const Vector3<Real> push = evaluate(force.law, force.quantity, position, rate) * cuts_.axis(force.coordinate);
    Vector6<Real>& wrench = on_cut_joints_[static_cast<std::size_t>(c.cut)];
    if (c.is_angle) {
      system.Q(c.point.body).template tail<3>() += push;
      system.Q(c.origin.body).template tail<3>() -= push;
      wrench.template tail<3>() += push;
    } else {
      const Vector3<Real> point = cuts_.point(force.coordinate);
      push_pair(system, c.origin.body, c.point.body, point, push);
      wrench += wrench_of<Real>(point, push);
    }
  }

  void add(BodySystem<Real>& system, const Tyre& tyre, const TyreValues<Real>& values) {
    const auto [contact, wrench] = meet_road(k_, tyre, values, roads_[tyre.road]);
    system.Q(tyre.centre.body) += wrench;
    Real* out = &quantities_[static_cast<std::size_t>(tyre.quantity)];
    out[0] = contact.load, out[1] = contact.side, out[2] = contact.aligning;
    out[3] = contact.slip, out[4] = contact.camber, out[5] = contact.deflection;
  }

  const Model<Real>& model_;
  Expressions<Real>& e_;
  const Kinematics<Real>& k_;
  CutCoordinates<Real> cuts_;
  const Road<Real>* roads_ = nullptr;
  std::vector<TyreValues<Real>> tyres_;
  std::vector<Real> quantities_;
  std::vector<Vector6<Real>> on_cut_joints_;
};

}  // namespace cutjoint::generic
