// The tyre in natural coordinates.
#pragma once

#include "cutjoint/generic/natural/dual.hpp"
#include "cutjoint/generic/natural/element.hpp"
#include "cutjoint/generic/read_model.hpp"
#include "cutjoint/generic/tyre.hpp"

namespace cutjoint::generic::natural {

/// Forms: the wheel's centre and axis, three axes e_i of its body, on which a torque T works as half the sum of T x e_i.
template <class Real>
class Wheel final : public FormElement<Real> {
 public:
  Wheel(const Json& json, Expressions<Real>& e, const Forms<Real>& forms, int quantity)
      : FormElement<Real>(json, forms), constants_(read_constants(e, json.at("constants"))), values_(e, constants_), road_(json.at("road")),
        quantity_(quantity) {}

  void act(const Setting<Real>& at) override {
    Vector3<Real> torque;
    const Contact<Real> contact = meet<Real>(at.roads[road_], this->x(at, 0), this->x(at, 1), this->v(at, 0), this->v(at, 1), torque);
    push(at, contact.force, torque);
    report(at, contact);
  }

  void linearise(const Setting<Real>& at, Real damping, Real stiffness) override {
    using S = Dual<Real, 12>;
    Vector3<S> torque;
    const Contact<S> contact = meet<S>(at.roads[road_], variables<Real, 12>(this->x(at, 0), 0), variables<Real, 12>(this->x(at, 1), 3),
                                       variables<Real, 12>(this->v(at, 0), 6), variables<Real, 12>(this->v(at, 1), 9), torque);
    const auto values = [](const Vector3<S>& y) { return Vector3<Real>(y[0].value(), y[1].value(), y[2].value()); };
    push(at, values(contact.force), values(torque));
    report(at, contact);
    this->local_.setZero();
    add_rows(damping, stiffness, contact.force, 0);
    for (int i = 0; i < 3; ++i) {
      const Vector3<Real>& axis = this->x(at, 2 + static_cast<std::size_t>(i));
      Vector3<S> force;
      for (int k = 0; k < 3; ++k) force[k] = (torque[(k + 1) % 3] * axis[(k + 2) % 3] - torque[(k + 2) % 3] * axis[(k + 1) % 3]) / Real(2);
      add_rows(damping, stiffness, force, 2 + i);
      this->local_.template block<3, 3>(3 * (2 + i), 3 * (2 + i)) -= stiffness * skew<Real>(values(torque)) / 2;
    }
  }

 private:
  void load_values(const Expressions<Real>& e) override { values_ = TyreValues<Real>(e, constants_); }

  /// The contact, and the torque on the body about the wheel's centre; the axis' rate turns the rolling wheel's angular momentum.
  template <class S>
  Contact<S> meet(const Road<Real>& road, const Vector3<S>& centre, const Vector3<S>& axis, const Vector3<S>& velocity,
                  const Vector3<S>& axis_rate, Vector3<S>& torque) const {
    const Real x = value_of(centre[0]), y = value_of(centre[1]);
    const S clearance = centre[2] - function_of(centre[0], road.height(x, y), road.height_dx(x, y));
    const S slope = function_of(centre[0], road.slope(x, y), road.slope_dx(x, y));
    const Contact<S> contact = touch_road<S>(values_, clearance, slope, axis, velocity);
    const S momentum = values_.spin_inertia * contact.rolling / values_.radius;
    torque = contact.arm.cross(contact.force) + contact.moment - momentum * axis_rate;
    return contact;
  }

  void push(const Setting<Real>& at, const Vector3<Real>& force, const Vector3<Real>& torque) {
    this->on(0) = force;
    this->on(1).setZero();
    for (std::size_t i = 2; i < 5; ++i) this->on(i) = torque.cross(this->x(at, i)) / 2;
  }

  /// The rows of one form: how its force changes with centre, axis and their rates.
  void add_rows(Real damping, Real stiffness, const Vector3<Dual<Real, 12>>& force, int row) {
    for (int column = 0; column < 2; ++column) {
      add_derivatives<Real, 12>(-stiffness, force, 3 * column, this->local_.template block<3, 3>(3 * row, 3 * column));
      add_derivatives<Real, 12>(-damping, force, 6 + 3 * column, this->local_.template block<3, 3>(3 * row, 3 * column));
    }
  }

  template <class S>
  void report(const Setting<Real>& at, const Contact<S>& c) const {
    Real* out = at.quantities + quantity_;
    for (const S* quantity : {&c.load, &c.side, &c.aligning, &c.slip, &c.camber, &c.deflection}) *out++ = value_of(*quantity);
  }

  TyreConstants constants_;
  TyreValues<Real> values_;
  std::size_t road_;
  int quantity_;
};

}  // namespace cutjoint::generic::natural
