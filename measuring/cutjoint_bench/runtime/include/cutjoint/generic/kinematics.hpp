// Positions, velocities and motion subspaces of all bodies, from the ground outwards.
//
// The motion of a body is Z = [v0; w], the velocity of its point at the pole and its angular velocity, in global axes (Cuadrado et al.
// 2000, eqs. 23, 26, 27).  Bodies of one branch share the pole: the origin of a free root at this instant, else the first joint's
// point, so that Z_i = Z_p + b_i zd_i and Zdd_i = Zdd_p + b_i zdd_i + d_i without frame transforms.
#pragma once

#include <vector>

#include "cutjoint/generic/chain.hpp"
#include "cutjoint/generic/model.hpp"

namespace cutjoint::generic {

/// The pose and motion of a body: R body to global axes, r its origin from the pole, the pole from the world's origin.
template <class Real>
struct Frame {
  Matrix3<Real> R = Matrix3<Real>::Identity();
  Vector3<Real> r = Vector3<Real>::Zero(), pole = Vector3<Real>::Zero();
  Vector6<Real> Z = Vector6<Real>::Zero();
};

/// The motion of a joint: b (6, k) and d of Zdd_i = Zdd_p + b zdd + d; `point` is its point of the parent, from the pole.
///
/// b is not formed for a spherical joint, nor for a free root, whose b is the unit matrix.
template <class Real>
struct JointMotion {
  Matrix6<Real> b = Matrix6<Real>::Zero();
  Vector6<Real> d = Vector6<Real>::Zero();
  Vector3<Real> point = Vector3<Real>::Zero();
};

template <class Real>
class Kinematics {
 public:
  explicit Kinematics(const Model<Real>& model)
      : model_(model), joints_(model.bodies.size()), chains_(model.bodies.size()), frames_(model.bodies.size()),
        motions_(model.bodies.size()), guides_(model.bodies.size()) {
    for (std::size_t i = 1; i < chains_.size(); ++i) {
      joints_[i] = seen_from_inner(model.bodies[i].joint, model.bodies[i].reversed);
      chains_[i].reserve(joints_[i].chain.size());
    }
  }

  /// Take over the parameters; nothing is allocated.
  void load() {
    for (std::size_t i = 1; i < chains_.size(); ++i) fill_chain(model_, joints_[i], model_.bodies[i].reversed, chains_[i]);
  }

  /// Guided coordinates.
  void begin_step() {
    for (std::size_t i = 1; i < guides_.size(); ++i) {
      if (!model_.bodies[i].guided) continue;
      for (int n = 0; n < most_guides; ++n) {
        const Guide& guide = model_.bodies[i].guides[static_cast<std::size_t>(n)];
        if (guide.position < 0) break;
        guides_[i].position[n] = model_.expressions[guide.position];
        guides_[i].rate[n] = model_.expressions[guide.rate];
        guides_[i].acceleration[n] = model_.expressions[guide.acceleration];
      }
    }
  }

  void update(const Real* q, const Real* v) {
    for (std::size_t i = 1; i < frames_.size(); ++i) {
      const Body& body = model_.bodies[i];
      if (body.guided) follow_guide(i);
      else if (body.free_root()) place_free_root(i, q + body.q, v + body.v);
      else carry(i, q + body.q, v + body.v);
    }
  }

  const Frame<Real>& frame(int body) const { return frames_[static_cast<std::size_t>(body)]; }
  const JointMotion<Real>& motion(int body) const { return motions_[static_cast<std::size_t>(body)]; }

  /// Coordinate and speed of a joint, guided or not.
  Real position(int body, int coordinate, const Real* q) const {
    const Body& b = model_.body(body);
    return b.guided ? guides_[static_cast<std::size_t>(body)].position[coordinate] : q[b.q + coordinate];
  }
  Real rate(int body, int speed, const Real* v) const {
    const Body& b = model_.body(body);
    return b.guided ? guides_[static_cast<std::size_t>(body)].rate[speed] : v[b.v + speed];
  }

  Real guided_acceleration(int body, int coordinate) const { return guides_[static_cast<std::size_t>(body)].acceleration[coordinate]; }

  /// A body-fixed direction in global axes.
  Vector3<Real> direction(Fixed fixed) const { return frame(fixed.body).R * model_.vectors[fixed.vector]; }

  /// A body-fixed point from its branch's pole.
  Vector3<Real> point(Fixed fixed) const { return frame(fixed.body).r + direction(fixed); }

  /// The velocity of a body's point that stands at `point` from the pole.
  Vector3<Real> velocity(int body, const Vector3<Real>& point) const {
    const Vector6<Real>& Z = frame(body).Z;
    return Z.template head<3>() + Z.template tail<3>().cross(point);
  }

  /// The way from the pole of `start` to the pole of `end`.
  Vector3<Real> pole_step(int start, int end) const {
    if (model_.same_branch(start, end)) return Vector3<Real>::Zero();
    return frame(end).pole - frame(start).pole;
  }

 private:
  struct GuideValues {
    using Values = Eigen::Matrix<Real, most_guides, 1>;
    Values position = Values::Zero(), rate = Values::Zero(), acceleration = Values::Zero();
  };

  void follow_guide(std::size_t i) {
    const GuideValues& guide = guides_[i];
    carry(i, guide.position.data(), guide.rate.data());
    motions_[i].d += motions_[i].b.template leftCols<most_guides>() * guide.acceleration;
  }

  /// A free root carries its pole along: b is the unit matrix, d = [-w x v; 0].
  void place_free_root(std::size_t i, const Real* q, const Real* v) {
    Frame<Real>& frame = frames_[i];
    frame.R = rotation_of(q + 3);
    frame.pole = model_.vectors[model_.bodies[i].inner.vector] + Vector3<Real>(q[0], q[1], q[2]);
    frame.Z = Eigen::Map<const Vector6<Real>>(v);
    motions_[i].d << frame.Z.template head<3>().cross(frame.Z.template tail<3>()), Vector3<Real>::Zero();
  }

  /// A body that its parent, or the ground, carries by a chain of elementary motions.
  void carry(std::size_t i, const Real* q, const Real* v) {
    const Body& body = model_.bodies[i];
    const Frame<Real>& parent = frame(body.parent);
    Frame<Real>& frame = frames_[i];
    JointMotion<Real>& motion = motions_[i];
    if (body.parent == ground) frame.pole = model_.vectors[body.inner.vector];
    else {
      frame.pole = parent.pole;
      motion.point = point(body.inner);
    }
    frame.R = parent.R;
    frame.r = motion.point;
    frame.Z = parent.Z;
    motion.d.setZero();
    for (const ChainStep<Real>& s : chains_[i]) step(s, parent, q, v, frame, motion);
  }

  static void step(const ChainStep<Real>& s, const Frame<Real>& parent, const Real* q, const Real* v, Frame<Real>& frame,
                   JointMotion<Real>& motion) {
    switch (s.kind) {
      case StepKind::slide: return slide(s, q[s.column], v[s.column], frame, motion);
      case StepKind::turn: return turn(s, s.share * q[s.column], s.share * v[s.column], frame, motion);
      case StepKind::ball: return ball(s, parent, q + s.column, v + s.column, frame, motion);
      case StepKind::offset: frame.r += frame.R * s.vector; return;
    }
  }

  /// b = [e; 0], moved by all that comes before it.
  static void slide(const ChainStep<Real>& s, Real q, Real u, Frame<Real>& frame, JointMotion<Real>& motion) {
    const Vector3<Real> e = frame.R * s.vector;
    motion.b.col(s.column) << e, Vector3<Real>::Zero();
    motion.d.template head<3>() += frame.Z.template tail<3>().cross(u * e);
    frame.Z.template head<3>() += u * e;
    frame.r += q * e;
  }

  /// b = [r x e + h e; e], moved by all that comes before it.
  static void turn(const ChainStep<Real>& s, Real q, Real u, Frame<Real>& frame, JointMotion<Real>& motion) {
    const Vector3<Real> e = frame.R * s.vector;
    Vector6<Real> b;
    b << frame.r.cross(e) + s.pitch * e, e;
    if (s.adds) motion.b.col(s.column) += s.share * b;
    else motion.b.col(s.column) = s.share * b;
    const Vector6<Real> added = u * b;
    motion.d += motion_cross<Real>(frame.Z, added);
    frame.Z += added;
    frame.r += (s.pitch * q) * e;
    frame.R *= rotation_about<Real>(s.vector, q);
  }

  /// b_k = [r x e_k; e_k] with the parent's axes e_k, which move with the parent alone.
  static void ball(const ChainStep<Real>& s, const Frame<Real>& parent, const Real* e, const Real* u, Frame<Real>& frame,
                   JointMotion<Real>& motion) {
    if (s.forms_b) {
      const Matrix3<Real> arm = skew<Real>(frame.r);
      motion.b.template block<3, 3>(0, s.column) = arm * parent.R;
      motion.b.template block<3, 3>(3, s.column) = parent.R;
    }
    const Vector3<Real> W = parent.R * Eigen::Map<const Vector3<Real>>(u);
    const Vector3<Real> centre = frame.Z.template head<3>() + frame.Z.template tail<3>().cross(frame.r);
    const Vector3<Real> turned = parent.Z.template tail<3>().cross(W);
    motion.d.template head<3>() += centre.cross(W) + frame.r.cross(turned);
    motion.d.template tail<3>() += turned;
    frame.Z.template head<3>() += frame.r.cross(W);
    frame.Z.template tail<3>() += W;
    frame.R *= rotation_of(e);
  }

  const Model<Real>& model_;
  std::vector<Joint> joints_;  ///< as their inner bodies see them
  std::vector<Chain<Real>> chains_;
  std::vector<Frame<Real>> frames_;
  std::vector<JointMotion<Real>> motions_;
  std::vector<GuideValues> guides_;
};

}  // namespace cutjoint::generic
