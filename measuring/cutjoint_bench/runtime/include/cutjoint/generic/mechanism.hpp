// The generic solver of generated code: the same mechanics, with the model read and interpreted at run time.
#pragma once

#include <algorithm>
#include <limits>
#include <vector>

#include "cutjoint/generic/description.hpp"
#include "cutjoint/generic/force.hpp"
#include "cutjoint/generic/gear.hpp"
#include "cutjoint/generic/loops.hpp"
#include "cutjoint/generic/read_model.hpp"
#include "cutjoint/generic/recursion.hpp"
#include "cutjoint/generic/report.hpp"

namespace cutjoint::generic {

/// Interprets a model that the compiler has described (generic/mechanism.py).  Satisfies the concept Mechanism; nothing allocates after `load`.
template <class Real>
class GenericMechanism {
 public:
  using real_type = Real;

  explicit GenericMechanism(const Json& document)
      : model_(read_model<Real>(document)), description_(describe(model_)), plan_(Planner().plan(model_)), kinematics_(model_),
        closures_(model_, kinematics_), gears_(model_, kinematics_), forces_(model_, kinematics_), system_(static_cast<std::size_t>(model_.nodes), plan_.slots),
        recursion_(model_, kinematics_, plan_), reporter_(model_, kinematics_, forces_, closures_), inertias_(model_.bodies.size()), still_(description_.speeds.size()),
        without_(still_.size()), pull_(description_.equations.size()), correction_(pull_.size()) {}

  GenericMechanism(const GenericMechanism&) = delete;
  GenericMechanism& operator=(const GenericMechanism&) = delete;

  const Description& description() const { return description_; }

  /// Set all that depends on parameters alone; `roads` must outlive the mechanism.
  void load(const Real* parameters, const Stabilisation<Real>& stabilisation, const Road<Real>* roads) {
    model_.expressions.load(parameters);
    model_.vectors.load(model_.expressions);
    kinematics_.load();
    closures_.load(stabilisation);
    gears_.load(stabilisation);
    forces_.load(roads);
    for (std::size_t i = 1; i < inertias_.size(); ++i) inertias_[i] = inertia_of(model_.expressions, model_.bodies[i]);
  }

  void drive_by(const InputSource<Real>& source) { model_.expressions.drive_by(source); }

  void sample(const Real*, const Real*, const Real*, const Real*, Real*) const {}  ///< of q, v, vdot, lambda; generic solvers have no controllers

  /// Set all that depends on time and on inputs.
  void begin_step(Real t, Real motion) {
    model_.expressions.begin_step(t, motion);
    kinematics_.begin_step();
  }

  /// Accelerations for given multipliers, and the correction that the augmented update adds to these.
  void evaluate(const Real* q, const Real* v, const Real* lambda, Real* vdot, Real* correction) {
    update(q, v);
    assemble(q, v);
    add_closures(system_, model_, closures_, plan_, lambda);
    gears_.add(system_, plan_, lambda);
    recursion_.condense(system_);
    recursion_.expand(vdot);
    correct_multipliers(model_, closures_, [this](int body) -> const Vector6<Real>& { return recursion_.Zdd(body); }, correction);
    gears_.correct_multipliers(vdot, correction);
  }

  /// Residual of the cut joints and gears, and its rate.
  void constraint_residual(const Real* q, const Real* v, Real* residual, Real* rate) {
    update(q, v);
    gears_.constraint_residual(residual, rate);
    for (std::size_t i = 0; i < model_.cuts.size(); ++i) {
      for (int n = 0; n < model_.cuts[i].size; ++n) {
        residual[model_.cuts[i].first + n] = closures_[i].equations.phi[n];
        rate[model_.cuts[i].first + n] = closures_[i].rate[n];
      }
    }
  }

  /// The reported columns.
  void report(const Real* q, const Real* v, const Real* vdot, const Real* lambda, Real* column) {
    update(q, v);
    assemble(q, v);
    forces_.add_tangents();
    reporter_.report({q, v, vdot, lambda}, system_, column);
  }

  /// The step that closes gaps of the cut joints and gears: what multipliers of penalty times gap change in the accelerations.
  void project(const Real* q, const Real* gap, Real* dz) {
    std::fill(pull_.begin(), pull_.end(), Real(0));
    evaluate(q, still_.data(), pull_.data(), without_.data(), correction_.data());
    for (std::size_t i = 0; i < pull_.size(); ++i) pull_[i] = closures_.penalty() * gap[i];
    evaluate(q, still_.data(), pull_.data(), dz, correction_.data());
    for (std::size_t i = 0; i < without_.size(); ++i) dz[i] -= without_[i];
  }

  /// Kinetic energy; power is not known.
  void energy(const Real* q, const Real* v, const Real*, const Real*, Real* energy) {
    update(q, v);
    assemble(q, v);
    energy[0] = Real(0);
    energy[1] = std::numeric_limits<Real>::quiet_NaN();
    for (int i = ground + 1; i < static_cast<int>(model_.bodies.size()); ++i)
      energy[0] += kinematics_.frame(i).Z.dot(system_.M(i) * kinematics_.frame(i).Z) / Real(2);
  }

  /// The compiler does not describe models with guards to this generic solver.
  void guard(const Real*, const Real*, Real*) const {}

 private:
  void update(const Real* q, const Real* v) {
    kinematics_.update(q, v);
    closures_.update();
    gears_.update(q, v);
  }

  /// The bodies and the applied forces.
  void assemble(const Real* q, const Real* v) {
    system_.clear();
    const Vector3<Real>& gravity = model_.vectors[model_.gravity];
    for (int i = ground + 1; i < static_cast<int>(model_.bodies.size()); ++i) {
      const Body& body = model_.body(i);
      if (!body.massless) add_body(system_, kinematics_, gravity, i, body, inertias_[static_cast<std::size_t>(i)]);
    }
    forces_.add(system_, q, v);
  }

  Model<Real> model_;
  Description description_;
  Plan plan_;
  Kinematics<Real> kinematics_;
  Closures<Real> closures_;
  Gears<Real> gears_;
  Forces<Real> forces_;
  BodySystem<Real> system_;
  Recursion<Real> recursion_;
  Reporter<Real> reporter_;
  std::vector<Inertia<Real>> inertias_;
  std::vector<Real> still_, without_, pull_, correction_;
};

}  // namespace cutjoint::generic
