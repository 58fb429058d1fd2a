// Gears: linear relations between joint coordinates, Phi = sum of f q, with a constant Jacobian.
//
//     M_j += f_j a f_j    C_jk += f_j a f_k    force_j -= f_j (lambda + a s)    lambda <- lambda + a (sum f qdd + s)
//
// over the unguided joints j, k, where s = sum f qdd of guides + 2 xi w Phi' + w^2 Phi.
#pragma once

#include <vector>

#include "cutjoint/generic/body_system.hpp"
#include "cutjoint/any_mechanism.hpp"

namespace cutjoint::generic {

template <class Real>
class Gears {
 public:
  Gears(const Model<Real>& model, const Kinematics<Real>& kinematics) : model_(model), k_(kinematics), values_(model.gears.size()) {}

  void load(const Stabilisation<Real>& stabilisation) { stabilisation_ = stabilisation; }

  void update(const Real* q, const Real* v) {
    for (std::size_t i = 0; i < values_.size(); ++i) update(model_.gears[i], q, v, values_[i]);
  }

  /// Penalty masses, couplings and forces.
  void add(BodySystem<Real>& system, const Plan& plan, const Real* lambda) const {
    for (std::size_t i = 0; i < values_.size(); ++i) add(system, plan.gears[i], i, lambda[model_.gears[i].equation]);
  }

  /// a (sum f qdd + s) of every gear.
  void correct_multipliers(const Real* vdot, Real* correction) const {
    for (std::size_t i = 0; i < values_.size(); ++i) {
      Real error = values_[i].s;
      for (const GearTerm& term : model_.gears[i].terms)
        if (is_unknown(term)) error += factor(term) * vdot[model_.body(term.body).v + term.coordinate];
      correction[model_.gears[i].equation] = stabilisation_.penalty * error;
    }
  }

  void constraint_residual(Real* residual, Real* rate) const {
    for (std::size_t i = 0; i < values_.size(); ++i) {
      residual[model_.gears[i].equation] = values_[i].residual;
      rate[model_.gears[i].equation] = values_[i].rate;
    }
  }

 private:
  /// Phi, Phi' and s.
  struct Values {
    Real residual{0}, rate{0}, s{0};
  };

  Real factor(const GearTerm& term) const { return model_.expressions[term.factor]; }
  bool is_unknown(const GearTerm& term) const { return !model_.body(term.body).guided; }

  void update(const Gear& gear, const Real* q, const Real* v, Values& values) const {
    values = {};
    for (const GearTerm& term : gear.terms) {
      values.residual += factor(term) * k_.position(term.body, term.coordinate, q);
      values.rate += factor(term) * k_.rate(term.body, term.coordinate, v);
      if (!is_unknown(term)) values.s += factor(term) * k_.guided_acceleration(term.body, term.coordinate);
    }
    const Real w = stabilisation_.frequency;
    values.s += 2 * stabilisation_.damping_ratio * w * values.rate + w * w * values.residual;
  }

  void add(BodySystem<Real>& system, const Target& coupling, std::size_t i, Real lambda) const {
    const auto& [first, last] = model_.gears[i].terms;
    const Real a = stabilisation_.penalty, push = lambda + a * values_[i].s;
    for (const GearTerm& term : model_.gears[i].terms) {
      if (!is_unknown(term)) continue;
      system.joint_force(term.body)[term.coordinate] -= factor(term) * push;
      system.M(model_.body(term.body).node)(term.coordinate, term.coordinate) += a * factor(term) * factor(term);
    }
    if (!is_unknown(first) || !is_unknown(last)) return;
    Matrix6<Real> coupled = Matrix6<Real>::Zero();
    coupled(first.coordinate, last.coordinate) = a * factor(first) * factor(last);
    system.couple(coupling, coupled);
  }

  const Model<Real>& model_;
  const Kinematics<Real>& k_;
  Stabilisation<Real> stabilisation_;
  std::vector<Values> values_;
};

}  // namespace cutjoint::generic
