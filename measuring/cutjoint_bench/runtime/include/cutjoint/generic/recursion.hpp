// The closed-loop recursion: joints are eliminated from the leaves to the ground, a block L D L^T factorisation of the body system.
//
//     D = b^T M_i b          y_p = b^T (M_i + C_ip)          y_j = b^T C_ij          e = D^-1 b^T (Q_i - M_i d)
//     M_p  += M_i + C_ip + C_pi - y_p^T D^-1 y_p             Q_p += Q_i - M_i d - C_pi d - y_p^T e
//     C_pj += C_ij - y_p^T D^-1 y_j                          Q_j -= C_ji d + y_j^T e
//     C_jk -= y_j^T D^-1 y_k
//     zdd_i = e - D^-1 ( y_p Zdd_p + sum_j y_j Zdd_j )       from the ground outwards
//
// (Cuadrado et al. 2000, eqs. 28-42, for couplings between any bodies).  A ball is eliminated about its centre in global axes.  The unknowns
// x = zdd_i of a geared joint are coupled to others as bodies are: D += M_x + C_xi b + b^T C_ix, y_p += C_xi + C_xp, y_j += C_xj, and
// b^T (Q_i - M_i d) + Q_x - C_xi d.
#pragma once

#include <vector>

#include "cutjoint/generic/body_system.hpp"

namespace cutjoint::generic {

/// Solves the body system of one model for the joints' accelerations.
template <class Real>
class Recursion {
 public:
  Recursion(const Model<Real>& model, const Kinematics<Real>& kinematics, const Plan& plan)
      : model_(model), k_(kinematics), plan_(plan), pivots_(model.bodies.size()), rows_(plan.rows, Matrix6<Real>::Zero()),
        Zdd_(static_cast<std::size_t>(model.nodes), Vector6<Real>::Zero()) {}

  /// Leaves first; the system is used up.
  void condense(BodySystem<Real>& system) {
    for (int i = static_cast<int>(model_.bodies.size()) - 1; i > ground; --i) {
      switch (elimination(i).pivot) {
        case Pivot::none: carry(system, i); break;
        case Pivot::ball: eliminate_ball(system, i); break;
        case Pivot::free_root: eliminate<6>(system, i); break;
        case Pivot::scalars:
          with_size(model_.body(i).speeds, [&](auto k) { eliminate<k.value>(system, i); });
      }
    }
  }

  /// The ground first.
  void expand(Real* vdot) {
    for (int i = ground + 1; i < static_cast<int>(model_.bodies.size()); ++i) {
      const Body& body = model_.body(i);
      Vector6<Real>& Zdd = Zdd_[static_cast<std::size_t>(i)];
      Zdd = this->Zdd(body.parent) + k_.motion(i).d;
      switch (elimination(i).pivot) {
        case Pivot::none: break;
        case Pivot::ball: solve_ball(i, Zdd, vdot + body.v); break;
        case Pivot::free_root: solve<6>(i, Zdd, vdot + body.v); break;
        case Pivot::scalars:
          with_size(body.speeds, [&](auto k) { solve<k.value>(i, Zdd, vdot + body.v); });
      }
    }
  }

  const Vector6<Real>& Zdd(int i) const { return Zdd_[static_cast<std::size_t>(i)]; }

 private:
  /// Terms for the way back: zdd = L^-T D^-1 ( g - sum_j Y_j Zdd_j ); the Y_j stand transposed among the rows.  A ball has the transposed
  /// rows of its own matrix at its centre in `own`.
  struct PivotValues {
    Matrix6<Real> lower = Matrix6<Real>::Zero();
    Vector6<Real> inverse = Vector6<Real>::Zero(), g = Vector6<Real>::Zero();
    Matrix3<Real> own = Matrix3<Real>::Zero();
  };

  const Elimination& elimination(int i) const { return plan_.eliminations[static_cast<std::size_t>(i)]; }
  Matrix6<Real>& row(const Elimination& e, std::size_t n) { return rows_[static_cast<std::size_t>(e.first_row) + n]; }

  /// A body whose motion relative to its parent is known: everything passes on.
  void carry(BodySystem<Real>& system, int i) {
    const Elimination& e = elimination(i);
    const int parent = model_.body(i).parent;
    const Vector6<Real>& d = k_.motion(i).d;
    system.Q(parent) += system.Q(i) - system.M(i) * d;
    system.M(parent) += system.M(i);
    for (std::size_t n = 0; n < e.coupled.size(); ++n) {
      const Matrix6<Real> C = system.coupling(e.coupled[n]);
      system.Q(e.coupled[n].body) -= C.transpose() * d;
      system.couple(e.inherited[n], C);
    }
  }

  /// m b; a free root's b is the unit matrix.
  template <int K, class M>
  Eigen::Matrix<Real, 6, K> times_b(const M& m, int i) const {
    if constexpr (K == 6) {
      if (elimination(i).pivot == Pivot::free_root) return m;
    }
    return m * k_.motion(i).b.template leftCols<K>();
  }

  /// b^T x.
  template <int K, class X>
  auto b_times(const X& x, int i) const -> Eigen::Matrix<Real, K, X::ColsAtCompileTime> {
    if constexpr (K == 6) {
      if (elimination(i).pivot == Pivot::free_root) return x;
    }
    return k_.motion(i).b.template leftCols<K>().transpose() * x;
  }

  template <int K>
  void eliminate(BodySystem<Real>& system, int i) {
    const Elimination& e = elimination(i);
    PivotValues& pivot = pivots_[static_cast<std::size_t>(i)];
    const int parent = model_.body(i).parent;
    const Matrix6<Real>& M = system.M(i);
    const Vector6<Real>& d = k_.motion(i).d;
    Eigen::Matrix<Real, 6, K> U = times_b<K>(M, i);
    Eigen::Matrix<Real, K, K> D = b_times<K>(U, i);
    const Vector6<Real> force = system.Q(i) - M * d;
    auto g = pivot.g.template head<K>();
    g = b_times<K>(force, i);
    g += system.joint_force(i).template head<K>();
    if (model_.body(i).node >= 0) add_own<K>(system, i, U, D, g);
    factor_ldl<K>(D, pivot.lower, pivot.inverse);
    forward<K>(pivot.lower, g);
    system.Q(parent) += force;
    system.M(parent) += M;
    for (std::size_t n = 0; n < e.coupled.size(); ++n) {
      const Matrix6<Real> C = system.coupling(e.coupled[n]);
      row(e, n).template leftCols<K>() = times_b<K>(C.transpose(), i);
      system.Q(e.coupled[n].body) -= C.transpose() * d;
      system.couple(e.inherited[n], C);
    }
    for (std::size_t n = e.coupled.size(); n < e.rows.size(); ++n) row(e, n).template leftCols<K>().setZero();
    for (std::size_t n = 0; n < e.own.size(); ++n)
      row(e, static_cast<std::size_t>(e.own_rows[n])).template leftCols<K>() += system.coupling(e.own[n]).transpose().template leftCols<K>();
    if (e.parent_row >= 0) row(e, static_cast<std::size_t>(e.parent_row)).template leftCols<K>() += U;
    for (std::size_t n = 0; n < e.rows.size(); ++n) forward_columns<K>(pivot.lower, row(e, n).template leftCols<K>());
    pass_rows<K>(system, i);
  }

  /// M_x, Q_x and C_xi of a geared joint.
  template <int K, class G>
  void add_own(BodySystem<Real>& system, int i, Eigen::Matrix<Real, 6, K>& U, Eigen::Matrix<Real, K, K>& D, G& g) const {
    const int node = model_.body(i).node;
    D += system.M(node).template topLeftCorner<K, K>();
    g += system.Q(node).template head<K>();
    if (!elimination(i).self) return;
    const Matrix6<Real> by_own = system.coupling(*elimination(i).self);
    const Eigen::Matrix<Real, 6, K> C = by_own.template leftCols<K>();
    const Eigen::Matrix<Real, K, K> projected = b_times<K>(C, i);
    D += projected + projected.transpose();
    g -= C.transpose() * k_.motion(i).d;
    U += C;
  }

  /// Q_j -= Y_j^T D^-1 g, M_j -= Y_j^T D^-1 Y_j, C_jk -= Y_j^T D^-1 Y_k.
  template <int K>
  void pass_rows(BodySystem<Real>& system, int i) {
    const Elimination& e = elimination(i);
    const PivotValues& pivot = pivots_[static_cast<std::size_t>(i)];
    const auto inverse = pivot.inverse.template head<K>();
    const Eigen::Matrix<Real, K, 1> known = inverse.cwiseProduct(pivot.g.template head<K>());
    auto fill = e.fills.begin();
    for (std::size_t j = 0; j < e.rows.size(); ++j) {
      const auto Y = row(e, j).template leftCols<K>();
      const Eigen::Matrix<Real, 6, K> weighed = Y * inverse.asDiagonal();
      system.Q(e.rows[j]) -= Y * known;
      system.M(e.rows[j]) -= weighed * Y.transpose();
      for (std::size_t k = j + 1; k < e.rows.size(); ++k) system.couple(*fill++, -weighed * row(e, k).template leftCols<K>().transpose());
    }
  }

  /// At the centre P the subspace is [0; 1]: D is the inertia about P, and what the body passes on is a force through P.
  void eliminate_ball(BodySystem<Real>& system, int i) {
    PivotValues& pivot = pivots_[static_cast<std::size_t>(i)];
    const int parent = model_.body(i).parent;
    const Vector3<Real>& centre = k_.motion(i).point;
    const Matrix3<Real> arm = skew<Real>(centre);
    const Matrix6<Real>& M = system.M(i);
    const Matrix3<Real> A = M.template topLeftCorner<3, 3>(), B = M.template topRightCorner<3, 3>(), B_at = B + A * arm;
    factor_ldl<3>(Matrix3<Real>(M.template bottomRightCorner<3, 3>() + B.transpose() * arm - arm * B_at), pivot.lower, pivot.inverse);
    pivot.own = B_at;
    forward_columns<3>(pivot.lower, pivot.own);
    const Vector6<Real> force = system.Q(i) - M * k_.motion(i).d;
    const Vector3<Real> load = force.template head<3>();
    auto g = pivot.g.template head<3>();
    g = force.template tail<3>() - centre.cross(load);
    forward<3>(pivot.lower, g);
    const Matrix3<Real> weighed = pivot.own * pivot.inverse.template head<3>().asDiagonal();
    system.Q(parent) += wrench_of<Real>(centre, load - weighed * g);
    add_mass_at(system.M(parent), Matrix3<Real>(A - weighed * pivot.own.transpose()), arm);
    pass_couplings(system, i, arm, weighed);
    pass_rows<3>(system, i);
  }

  /// The couplings of a ball's body: rows of moments about the centre, and a force through the centre that its parent inherits.
  void pass_couplings(BodySystem<Real>& system, int i, const Matrix3<Real>& arm, const Matrix3<Real>& weighed) {
    const Elimination& e = elimination(i);
    for (std::size_t n = 0; n < e.coupled.size(); ++n) {
      const Matrix6<Real> C = system.coupling(e.coupled[n]);
      const Eigen::Matrix<Real, 3, 6> force = C.template topRows<3>();
      auto Y = row(e, n).template leftCols<3>();
      Y = (C.template bottomRows<3>() - arm * force).transpose();
      forward_columns<3>(pivots_[static_cast<std::size_t>(i)].lower, Y);
      Matrix6<Real> passed;
      passed.template topRows<3>() = force - weighed * Y.transpose();
      passed.template bottomRows<3>() = arm * passed.template topRows<3>();
      system.Q(e.coupled[n].body) -= C.transpose() * k_.motion(i).d;
      system.couple(e.inherited[n], passed);
    }
  }

  /// A 3x3 mass at the point of `arm` = p~: [a, -a p~; p~ a, -p~ a p~].
  static void add_mass_at(Matrix6<Real>& M, const Matrix3<Real>& a, const Matrix3<Real>& arm) {
    const Matrix3<Real> corner = a * arm;
    M.template topLeftCorner<3, 3>() += a;
    M.template topRightCorner<3, 3>() -= corner;
    M.template bottomLeftCorner<3, 3>() -= corner.transpose();
    M.template bottomRightCorner<3, 3>() -= arm * corner;
  }

  /// g - sum_j Y_j Zdd_j.
  template <int K>
  Eigen::Matrix<Real, K, 1> right_side(int i) {
    const Elimination& e = elimination(i);
    Eigen::Matrix<Real, K, 1> right = pivots_[static_cast<std::size_t>(i)].g.template head<K>();
    for (std::size_t j = 0; j < e.rows.size(); ++j) right -= row(e, j).template leftCols<K>().transpose() * Zdd(e.rows[j]);
    return right;
  }

  template <int K>
  void solve_pivot(int i, Eigen::Matrix<Real, K, 1>& x) const {
    const PivotValues& pivot = pivots_[static_cast<std::size_t>(i)];
    x = x.cwiseProduct(pivot.inverse.template head<K>()).eval();
    backward<K>(pivot.lower, x);
  }

  template <int K>
  void solve(int i, Vector6<Real>& Zdd, Real* vdot) {
    Eigen::Matrix<Real, K, 1> x = right_side<K>(i);
    solve_pivot<K>(i, x);
    Eigen::Map<Eigen::Matrix<Real, K, 1>> out(vdot);
    out = x;
    if (const int node = model_.body(i).node; node >= 0) Zdd_[static_cast<std::size_t>(node)].template head<K>() = x;
    if constexpr (K == 6) {
      if (elimination(i).pivot == Pivot::free_root) {
        Zdd += x;
        return;
      }
    }
    Zdd += k_.motion(i).b.template leftCols<K>() * x;
  }

  /// The unknown is the absolute angular acceleration less d's, the joint's own the relative one in the parent's axes.
  void solve_ball(int i, Vector6<Real>& Zdd, Real* vdot) {
    const int parent = model_.body(i).parent;
    const Vector3<Real>& centre = k_.motion(i).point;
    const Vector6<Real>& above = this->Zdd(parent);
    const Vector3<Real> wd = above.template tail<3>(), a_P = above.template head<3>() + wd.cross(centre);
    Vector3<Real> x = right_side<3>(i);
    x -= pivots_[static_cast<std::size_t>(i)].own.transpose() * a_P;
    solve_pivot<3>(i, x);
    const Vector3<Real> relative = x - wd;
    Zdd.template head<3>() += centre.cross(relative);
    Zdd.template tail<3>() += relative;
    Eigen::Map<Vector3<Real>> out(vdot);
    out = k_.frame(parent).R.transpose() * relative;
  }

  const Model<Real>& model_;
  const Kinematics<Real>& k_;
  const Plan& plan_;
  std::vector<PivotValues> pivots_;
  std::vector<Matrix6<Real>> rows_;
  std::vector<Vector6<Real>> Zdd_;
};

}  // namespace cutjoint::generic
