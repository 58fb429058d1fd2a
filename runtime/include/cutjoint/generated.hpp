// Adapters of generated classes to virtual functions.
#pragma once

#include "cutjoint/lagrangian/any_system.hpp"

namespace cutjoint {

/// Adapts a generated class to the virtual functions common to mechanisms and systems; its description is separate.
template <class Base, class Described, class Generated>
class VirtualAdapter : public Base {
 public:
  using Real = typename Base::real_type;

  explicit VirtualAdapter(const Described& description) : description_(description) {}

  const Described& description() const final { return description_; }
  void begin_step(Real t, Real motion) final { generated_.begin_step(t, motion); }

  void drive_by([[maybe_unused]] const InputSource<Real>& source) final {
    if constexpr (requires { generated_.drive_by(source); }) generated_.drive_by(source);
  }

  void report(const Real* q, const Real* v, const Real* vdot, const Real* lambda, Real* column) const final {
    generated_.report(q, v, vdot, lambda, column);
  }

  void energy(const Real* q, const Real* v, const Real* vdot, const Real* lambda, Real* energy) const final {
    if constexpr (requires { generated_.energy(q, v, vdot, lambda, energy); }) generated_.energy(q, v, vdot, lambda, energy);
    else Base::energy(q, v, vdot, lambda, energy);
  }

  void sample([[maybe_unused]] const Real* q, [[maybe_unused]] const Real* v, [[maybe_unused]] const Real* vdot, [[maybe_unused]] const Real* lambda,
              [[maybe_unused]] Real* next) const final {
    if constexpr (requires { generated_.sample(q, v, vdot, lambda, next); }) generated_.sample(q, v, vdot, lambda, next);
  }

  void guard(const Real* q, const Real* v, Real* margin) const final {
    if constexpr (requires { generated_.guard(q, v, margin); }) generated_.guard(q, v, margin);
  }

  void events(const Real* q, const Real* v, Real* value) const final {
    if constexpr (requires { generated_.events(q, v, value); }) generated_.events(q, v, value);
  }

  void domains(const Real* q, const Real* v, const Real* lambda, Real* inside) const final {
    if constexpr (requires { generated_.domains(q, v, lambda, inside); }) generated_.domains(q, v, lambda, inside);
  }

 protected:
  Generated generated_;

 private:
  const Described& description_;
};

/// A generated mechanism for the driver.
template <class Generated>
class GeneratedMechanism final : public VirtualAdapter<AnyMechanism<typename Generated::real_type>, Description, Generated> {
 public:
  using Real = typename Generated::real_type;
  using VirtualAdapter<AnyMechanism<Real>, Description, Generated>::VirtualAdapter;

  void load(const Real* parameters, const Stabilisation<Real>& stabilisation, const Road<Real>* roads) override {
    generated_.load(parameters, stabilisation, roads);
  }

  void evaluate(const Real* q, const Real* v, const Real* lambda, Real* vdot, Real* correction) const override {
    generated_.evaluate(q, v, lambda, vdot, correction);
  }

  void constraint_residual(const Real* q, const Real* v, Real* residual, Real* rate) const override {
    generated_.constraint_residual(q, v, residual, rate);
  }

  void project(const Real* q, const Real* violation, Real* dz) const override {
    if constexpr (requires { generated_.project(q, violation, dz); }) generated_.project(q, violation, dz);
    else AnyMechanism<Real>::project(q, violation, dz);
  }

 private:
  using VirtualAdapter<AnyMechanism<Real>, Description, Generated>::generated_;
};

/// A generated system for the driver.
template <class Generated>
class GeneratedSystem final : public VirtualAdapter<AnySystem<typename Generated::real_type>, SystemDescription, Generated> {
 public:
  using Real = typename Generated::real_type;
  using VirtualAdapter<AnySystem<Real>, SystemDescription, Generated>::VirtualAdapter;

  void load(const Real* parameters, const Road<Real>* roads) override { generated_.load(parameters, roads); }

  void initial_coordinates(const Real* relative_q, const Real* relative_v, Real* q, Real* v) const override {
    generated_.initial_coordinates(relative_q, relative_v, q, v);
  }

  void dynamic_residual(const Real* q, const Real* v, const Real* vdot, const Real* lambda, Real penalty, Real* force_residual,
                        Real* residual) const override {
    generated_.dynamic_residual(q, v, vdot, lambda, penalty, force_residual, residual);
  }

  void linearise(const Real* q, const Real* v, const Real* vdot, const Real* lambda, Real penalty, const Weights<Real>& weights,
                 Real* force_residual, Real* residual, Real* tangent) const override {
    generated_.linearise(q, v, vdot, lambda, penalty, weights, force_residual, residual, tangent);
  }

  void constraint_residual(const Real* q, const Real* v, const Real* vdot, Real* residual, Real* rate, Real* curvature) const override {
    generated_.constraint_residual(q, v, vdot, residual, rate, curvature);
  }

  void apply_jacobian_transposed(const Real* q, const Real* w, Real* force) const override { generated_.apply_jacobian_transposed(q, w, force); }
  void apply_jacobian(const Real* q, const Real* x, Real* change) const override { generated_.apply_jacobian(q, x, change); }
  int factor(const Real* tangent, Real* factors) const override { return generated_.factor(tangent, factors); }
  void solve(const Real* factors, Real* x) const override { generated_.solve(factors, x); }

 private:
  using VirtualAdapter<AnySystem<Real>, SystemDescription, Generated>::generated_;
};

}  // namespace cutjoint
