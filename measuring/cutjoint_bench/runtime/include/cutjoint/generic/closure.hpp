// Cut joints: residual, Jacobian and velocity-dependent acceleration of each kind, as the base sees them.
//
// Over what is fixed in the base (its point and directions b) and what is fixed in the follower (its point and directions f), only the
// latter move, with the relative twist Z = Z_follower - Z_base: p' = V + W x p, f' = W x f.  So Phi' = A Z, A_base = -A.
#pragma once

#include <array>
#include <vector>

#include "cutjoint/generic/kinematics.hpp"
#include "cutjoint/any_mechanism.hpp"

namespace cutjoint::generic {

/// The equations of one cut joint: Phi, its Jacobian A transposed (6, size), the drift dA/dt Z seen from the base.
template <class Real>
struct Equations {
  int size = 0;
  Matrix6<Real> At;
  Vector6<Real> phi, drift;

  void append(Real residual, const Vector3<Real>& by_v, const Vector3<Real>& by_w, Real curvature) {
    phi[size] = residual;
    At.col(size) << by_v, by_w;
    drift[size] = curvature;
    ++size;
  }

  /// Add a further term to the last equation.
  void add(Real residual, const Vector3<Real>& by_v, const Vector3<Real>& by_w, Real curvature) {
    phi[size - 1] += residual;
    At.col(size - 1).template head<3>() += by_v;
    At.col(size - 1).template tail<3>() += by_w;
    drift[size - 1] += curvature;
  }

  /// Three equations; the Jacobians' transposes.
  void append(const Vector3<Real>& residual, const Matrix3<Real>& by_v, const Matrix3<Real>& by_w, const Vector3<Real>& curvature) {
    phi.template segment<3>(size) = residual;
    At.template block<3, 3>(0, size) = by_v;
    At.template block<3, 3>(3, size) = by_w;
    drift.template segment<3>(size) = curvature;
    size += 3;
  }
};

/// The motion of a cut joint: the gap between its points, the follower's point p from its pole, its velocity P and the relative twist's W.
template <class Real>
struct RelativeMotion {
  Vector3<Real> gap, p, P, W;
};

/// Directions of a condition as base and follower carry them, in global axes.
template <class Real>
struct Carried {
  std::array<Vector3<Real>, 3> base, follower;
};

/// A cut joint at an instant: its equations, the rate A Z, s = gamma + 2 xi w Phi' + w^2 Phi, and the way from the base's pole to the
/// follower's.
template <class Real>
struct Closure {
  Equations<Real> equations;
  Vector6<Real> rate, s;
  Vector3<Real> step;
  bool one_pole = true;
};

template <class Real>
class Closures {
 public:
  Closures(const Model<Real>& model, const Kinematics<Real>& kinematics)
      : model_(model), k_(kinematics), directions_(model.cuts.size()), closures_(model.cuts.size()) {}

  void load(const Stabilisation<Real>& stabilisation) {
    stabilisation_ = stabilisation;
    for (std::size_t i = 0; i < directions_.size(); ++i) directions_[i] = directions_of(model_.cuts[i].joint);
  }

  void update() {
    for (std::size_t i = 0; i < closures_.size(); ++i) update(i);
  }

  const Closure<Real>& operator[](std::size_t i) const { return closures_[i]; }
  Real penalty() const { return stabilisation_.penalty; }

 private:
  /// All that the conditions name, in their order.
  std::vector<Vector3<Real>> directions_of(const Joint& joint) const {
    std::vector<Vector3<Real>> found;
    const auto add = [&](Direction d) { found.push_back(model_.direction_of(joint, d)); };
    for (const Condition& condition : joint.conditions) {
      for (const Direction d : condition.directions) add(d);
      for (const auto& sum : condition.sums)
        for (const Product& p : sum) add(p.left.direction), add(p.right.direction);
    }
    return found;
  }

  void update(std::size_t i) {
    const Cut& cut = model_.cuts[i];
    Closure<Real>& c = closures_[i];
    const int base = cut.base.body, follower = cut.follower.body;
    c.one_pole = model_.same_branch(base, follower);
    c.step = k_.pole_step(base, follower);
    const Vector6<Real> carried = twist_at<Real>(k_.frame(base).Z, c.step);
    const Vector6<Real> Z = k_.frame(follower).Z - carried;
    RelativeMotion<Real> e;
    e.p = k_.point(cut.follower);
    e.gap = e.p - (k_.point(cut.base) - c.step);
    e.W = Z.template tail<3>();
    e.P = Z.template head<3>() + e.W.cross(e.p);
    c.equations.size = 0;
    write(i, e, c.equations);
    stabilise(c, Z, carried);
  }

  /// gamma is the drift less A crm(Z_base) Z, which carries it from the base's axes to the common ones.
  void stabilise(Closure<Real>& c, const Vector6<Real>& Z, const Vector6<Real>& carried) const {
    const Vector6<Real> spun = motion_cross<Real>(carried, Z);
    const Real w = stabilisation_.frequency, doubled = 2 * stabilisation_.damping_ratio * w;
    for (int n = 0; n < c.equations.size; ++n) {
      const auto A = c.equations.At.col(n);
      c.rate[n] = A.dot(Z);
      c.s[n] = c.equations.drift[n] - A.dot(spun) + doubled * c.rate[n] + w * w * c.equations.phi[n];
    }
  }

  void write(std::size_t i, const RelativeMotion<Real>& e, Equations<Real>& out) const {
    const Cut& cut = model_.cuts[i];
    const Matrix3<Real>&base = k_.frame(cut.base.body).R, &follower = k_.frame(cut.follower.body).R;
    const Vector3<Real>* direction = directions_[i].data();
    for (const Condition& condition : cut.joint.conditions) {
      Carried<Real> d;
      for (std::size_t n = 0; n < condition.directions.size(); ++n, ++direction)
        d.base[n] = base * *direction, d.follower[n] = follower * *direction;
      switch (condition.kind) {
        case ConditionKind::same_point: close_gap(e, out); break;
        case ConditionKind::same_direction: align(e, d, out); break;
        case ConditionKind::same_attitude: hold_attitude(e, d, out); break;
        case ConditionKind::same_distance:
          keep_length(e, (model_.vectors[cut.joint.to] - model_.vectors[cut.joint.at]).norm(), out);
          break;
        case ConditionKind::advance: advance(e, d, model_.expressions[cut.joint.pitch], out); break;
        case ConditionKind::products: break;
      }
      for (const auto& sum : condition.sums) {
        out.append(Real(0), Vector3<Real>::Zero(), Vector3<Real>::Zero(), Real(0));
        for (const Product& p : sum) {
          const Vector3<Real> left = (p.left.kind == Factor::Kind::base ? base : follower) * *direction++;
          const Vector3<Real> right = (p.right.kind == Factor::Kind::base ? base : follower) * *direction++;
          if (p.left.kind == Factor::Kind::way) along(e, Real(p.weight) * right, out);
          else if (p.left.kind == Factor::Kind::follower) cross(e, left, Real(p.weight) * right, out);
          else cross(e, right, Real(p.weight) * left, out);
        }
      }
    }
  }

  /// Phi += b . gap
  static void along(const RelativeMotion<Real>& e, const Vector3<Real>& b, Equations<Real>& out) {
    out.add(b.dot(e.gap), b, e.p.cross(b), b.dot(e.W.cross(e.P)));
  }

  /// Phi += f . b, f of the follower and b of the base.
  static void cross(const RelativeMotion<Real>& e, const Vector3<Real>& f, const Vector3<Real>& b, Equations<Real>& out) {
    out.add(f.dot(b), Vector3<Real>::Zero(), f.cross(b), b.dot(e.W.cross(e.W.cross(f))));
  }

  /// Phi = gap
  static void close_gap(const RelativeMotion<Real>& e, Equations<Real>& out) {
    out.append(e.gap, Matrix3<Real>::Identity(), skew<Real>(e.p), e.W.cross(e.P));
  }

  /// Phi = f - b
  static void align(const RelativeMotion<Real>& e, const Carried<Real>& d, Equations<Real>& out) {
    const Vector3<Real>& f = d.follower[0];
    out.append(f - d.base[0], Matrix3<Real>::Zero(), skew<Real>(f), e.W.cross(e.W.cross(f)));
  }

  /// Phi = sum b_k x f_k / 2: the sine of a small relative rotation.
  static void hold_attitude(const RelativeMotion<Real>& e, const Carried<Real>& d, Equations<Real>& out) {
    Vector3<Real> phi = Vector3<Real>::Zero(), curvature = Vector3<Real>::Zero();
    Matrix3<Real> by_w = Matrix3<Real>::Zero();
    for (std::size_t k = 0; k < 3; ++k) {
      const Vector3<Real>&b = d.base[k], &f = d.follower[k];
      phi += b.cross(f) / 2;
      by_w += (b.dot(f) * Matrix3<Real>::Identity() - b * f.transpose()) / 2;
      curvature += b.cross(e.W.cross(e.W.cross(f))) / 2;
    }
    out.append(phi, Matrix3<Real>::Zero(), by_w, curvature);
  }

  /// Phi = (gap^2 - L^2) / (2 L)
  static void keep_length(const RelativeMotion<Real>& e, Real length, Equations<Real>& out) {
    const Vector3<Real> n = e.gap / length;
    out.append((e.gap.squaredNorm() - length * length) / (2 * length), n, e.p.cross(n), e.P.squaredNorm() / length + n.dot(e.W.cross(e.P)));
  }

  /// Over the axis and two directions across it: Phi = f_1 . c, where c = b_2 cos(angle) - b_1 sin(angle), angle = b_0 . gap / h; c' = o angle', o' = -c angle'.
  static void advance(const RelativeMotion<Real>& e, const Carried<Real>& d, Real pitch, Equations<Real>& out) {
    using std::cos, std::sin;
    const Vector3<Real>&f = d.follower[1], axis = d.base[0] / pitch;
    const Real angle = axis.dot(e.gap), rate = axis.dot(e.P);
    const Vector3<Real> c = d.base[2] * cos(angle) - d.base[1] * sin(angle), o = -d.base[2] * sin(angle) - d.base[1] * cos(angle);
    const Vector3<Real> turning = e.W.cross(f);
    const Real lead = f.dot(o);
    const Real curvature =
        c.dot(e.W.cross(turning)) + 2 * rate * o.dot(turning) - rate * rate * f.dot(c) + lead * axis.dot(e.W.cross(e.P));
    out.append(f.dot(c), lead * axis, f.cross(c) + lead * e.p.cross(axis), curvature);
  }

  const Model<Real>& model_;
  const Kinematics<Real>& k_;
  Stabilisation<Real> stabilisation_;
  std::vector<std::vector<Vector3<Real>>> directions_;
  std::vector<Closure<Real>> closures_;
};

}  // namespace cutjoint::generic
