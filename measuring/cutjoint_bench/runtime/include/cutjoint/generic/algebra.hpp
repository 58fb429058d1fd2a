// Small matrices of the generic mechanism: cross products, rotations, the L D L^T factorisation.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>
#include <utility>

namespace cutjoint::generic {

template <class Real>
using Vector3 = Eigen::Matrix<Real, 3, 1>;
template <class Real>
using Vector6 = Eigen::Matrix<Real, 6, 1>;
template <class Real>
using Matrix3 = Eigen::Matrix<Real, 3, 3>;
template <class Real>
using Matrix6 = Eigen::Matrix<Real, 6, 6>;

/// p~, with p~ x = p x x.
template <class Real>
Matrix3<Real> skew(const Vector3<Real>& p) {
  Matrix3<Real> m;
  m << Real(0), -p.z(), p.y(), p.z(), Real(0), -p.x(), -p.y(), p.x(), Real(0);
  return m;
}

/// The rate of a motion vector carried by a twist: [w x m_v + v x m_w; w x m_w] (Featherstone 2008, eq. 2.31).
template <class Real>
Vector6<Real> motion_cross(const Vector6<Real>& twist, const Vector6<Real>& motion) {
  const Vector3<Real> v = twist.template head<3>(), w = twist.template tail<3>();
  const Vector3<Real> mv = motion.template head<3>(), mw = motion.template tail<3>();
  Vector6<Real> rate;
  rate << w.cross(mv) + v.cross(mw), w.cross(mw);
  return rate;
}

/// A twist with its linear part taken at a pole that stands `step` further: [v0 + w x s; w].
template <class Real>
Vector6<Real> twist_at(const Vector6<Real>& twist, const Vector3<Real>& step) {
  Vector6<Real> moved = twist;
  moved.template head<3>() += twist.template tail<3>().cross(step);
  return moved;
}

/// A force at a point, as a wrench at the pole: [f; p x f].
template <class Real>
Vector6<Real> wrench_of(const Vector3<Real>& point, const Vector3<Real>& force) {
  Vector6<Real> wrench;
  wrench << force, point.cross(force);
  return wrench;
}

/// Rodrigues' formula for a unit axis.
template <class Real>
Matrix3<Real> rotation_about(const Vector3<Real>& axis, Real angle) {
  using std::cos, std::sin;
  const Real c = cos(angle), s = sin(angle);
  Matrix3<Real> R = ((Real(1) - c) * axis) * axis.transpose() + s * skew<Real>(axis);
  R.diagonal().array() += c;
  return R;
}

/// The rotation of a unit quaternion, scalar first.
template <class Real>
Matrix3<Real> rotation_of(const Real* e) {
  const Real w = e[0], x = e[1], y = e[2], z = e[3];
  Matrix3<Real> R;
  R << 1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),  //
      2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),   //
      2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y);
  return R;
}

/// Two unit vectors across a direction; the three make a right-handed frame.
template <class Real>
std::pair<Vector3<Real>, Vector3<Real>> tangents(const Vector3<Real>& normal) {
  const Vector3<Real> n = normal / normal.norm();
  int least = 0;
  for (int i = 1; i < 3; ++i)
    if (std::abs(n[i]) < std::abs(n[least])) least = i;
  const Vector3<Real> across = n.cross(Vector3<Real>::Unit(least));
  const Vector3<Real> first = across / across.norm();
  return {first, n.cross(first)};
}

/// m = L D L^T without pivoting: `lower` receives the unit triangle L, `inverse` the diagonal of D^-1.
template <int K, class M, class L, class D>
void factor_ldl(const M& m, L&& lower, D&& inverse) {
  using Real = typename M::Scalar;
  Eigen::Matrix<Real, K, K> scaled;  // L D
  for (int j = 0; j < K; ++j) {
    Real pivot = m(j, j);
    for (int k = 0; k < j; ++k) pivot -= lower(j, k) * scaled(j, k);
    inverse(j) = Real(1) / pivot;
    for (int i = j + 1; i < K; ++i) {
      Real x = m(i, j);
      for (int k = 0; k < j; ++k) x -= scaled(i, k) * lower(j, k);
      scaled(i, j) = x;
      lower(i, j) = x * inverse(j);
    }
  }
}

/// x <- x L^-T for a block of K columns: the transpose of L^-1 x^T.
template <int K, class L, class X>
void forward_columns(const L& lower, X&& x) {
  for (int j = 1; j < K; ++j)
    for (int k = 0; k < j; ++k) x.col(j) -= lower(j, k) * x.col(k);
}

/// x <- L^-1 x.
template <int K, class L, class X>
void forward(const L& lower, X&& x) {
  for (int j = 1; j < K; ++j)
    for (int k = 0; k < j; ++k) x(j) -= lower(j, k) * x(k);
}

/// x <- L^-T x.
template <int K, class L, class X>
void backward(const L& lower, X&& x) {
  for (int j = K - 1; j >= 0; --j)
    for (int k = j + 1; k < K; ++k) x(j) -= lower(k, j) * x(k);
}

/// Calls f with the integral constant k, 1 <= k <= 6.
template <class F>
void with_size(int k, F&& f) {
  switch (k) {
    case 1: return f(std::integral_constant<int, 1>{});
    case 2: return f(std::integral_constant<int, 2>{});
    case 3: return f(std::integral_constant<int, 3>{});
    case 4: return f(std::integral_constant<int, 4>{});
    case 5: return f(std::integral_constant<int, 5>{});
    default: return f(std::integral_constant<int, 6>{});
  }
}

}  // namespace cutjoint::generic
