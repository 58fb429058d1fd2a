// Loop closures in the body system: the penalty of every cut joint and its augmented update (Cuadrado et al. 2000, eqs. 39-42).
//
//     M_f += A^T a A    M_b += A^T a A    C_fb -= A^T a A    Q_f -= A^T (lambda + a s)    Q_b += A^T (lambda + a s)
//     lambda <- lambda + a (A Zdd + s)
#pragma once

#include "cutjoint/generic/body_system.hpp"
#include "cutjoint/generic/closure.hpp"

namespace cutjoint::generic {

/// [1, -s~; 0, 1]: a twist taken at a pole that stands s further.
template <class Real>
Matrix6<Real> transport(const Vector3<Real>& step) {
  Matrix6<Real> T = Matrix6<Real>::Identity();
  T.template topRightCorner<3, 3>() = -skew<Real>(step);
  return T;
}

template <int K, class Real>
void add_closure(BodySystem<Real>& system, const Cut& cut, const Closure<Real>& closure, const Target& coupling, Real penalty,
                 const Real* lambda) {
  const auto At = closure.equations.At.template leftCols<K>();
  const Matrix6<Real> stiffness = penalty * (At * At.transpose());
  const Eigen::Map<const Eigen::Matrix<Real, K, 1>> multipliers(lambda);
  const Vector6<Real> wrench = At * (multipliers + penalty * closure.s.template head<K>());
  const int base = cut.base.body, follower = cut.follower.body;
  system.M(follower) += stiffness;
  system.Q(follower) -= wrench;
  if (base == ground) return;
  if (closure.one_pole) {
    system.M(base) += stiffness;
    system.Q(base) += wrench;
    system.couple(coupling, -stiffness);
    return;
  }
  const Matrix6<Real> T = transport<Real>(closure.step), coupled = stiffness * T;
  system.M(base) += T.transpose() * coupled;
  system.Q(base) += T.transpose() * wrench;
  system.couple(coupling, -coupled);
}

/// Penalty masses, couplings and forces of every cut joint.
template <class Real>
void add_closures(BodySystem<Real>& system, const Model<Real>& model, const Closures<Real>& closures, const Plan& plan,
                  const Real* lambda) {
  for (std::size_t i = 0; i < model.cuts.size(); ++i) {
    const Cut& cut = model.cuts[i];
    with_size(cut.size, [&](auto k) {
      add_closure<k.value>(system, cut, closures[i], plan.closures[i], closures.penalty(), lambda + cut.first);
    });
  }
}

/// a (A Zdd + s) of every cut joint.
template <class Real, class Accelerations>
void correct_multipliers(const Model<Real>& model, const Closures<Real>& closures, const Accelerations& Zdd, Real* correction) {
  for (std::size_t i = 0; i < model.cuts.size(); ++i) {
    const Cut& cut = model.cuts[i];
    const Closure<Real>& closure = closures[i];
    const Vector6<Real> relative = Zdd(cut.follower.body) - twist_at<Real>(Zdd(cut.base.body), closure.step);
    for (int n = 0; n < cut.size; ++n) {
      const Real error = closure.equations.At.col(n).dot(relative) + closure.s[n];
      correction[cut.first + n] = closures.penalty() * error;
    }
  }
}

}  // namespace cutjoint::generic
