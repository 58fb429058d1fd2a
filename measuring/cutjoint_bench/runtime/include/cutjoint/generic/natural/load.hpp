// Loads: a force at a point or a torque, its components given over place, velocity and angular velocity.
#pragma once

#include <array>
#include <type_traits>
#include <vector>

#include "cutjoint/generic/natural/dual.hpp"
#include "cutjoint/generic/natural/element.hpp"

namespace cutjoint::generic::natural {

/// A load over K forms: a point, or three axes of the body, or both.  A torque T works on the axes e_i as half the sum of T x e_i.
template <class Real, int K>
class BodyLoad final : public FormElement<Real> {
 public:
  BodyLoad(const Json& json, Expressions<Real>& e, const Forms<Real>& forms, int quantity)
      : FormElement<Real>(json, forms), torque_(json.at("torque")), in_body_(json.at("in_body")), quantity_(quantity) {
    const char* const names[] = {"x", "y", "z", "vx", "vy", "vz", "wx", "wy", "wz"};
    for (std::size_t i = 0; i < 9; ++i) place_[i] = e.variable(names[i]);
    value_ = e.routine([&] {
      for (std::size_t i = 0; i < 3; ++i) components_[i] = e.read(json.at("components").at(i));
    });
    tangents_ = e.routine([&] {
      for (std::size_t i = 0; i < 3; ++i)
        for (const Json& by : json.at("by").at(i)) by_[i].push_back({by.at(0), e.read(by.at(1))});
    });
  }

  void act(const Setting<Real>& at) override {
    std::array<Vector3<Real>, K> x, v, force;
    for (std::size_t i = 0; i < K; ++i) x[i] = this->x(at, i), v[i] = this->v(at, i);
    act<Real>(at, x, v, force);
    for (std::size_t i = 0; i < K; ++i) this->on(i) = force[i];
  }

  void linearise(const Setting<Real>& at, Real damping, Real stiffness) override {
    using S = Dual<Real, 6 * K>;
    std::array<Vector3<S>, K> x, v, force;
    for (int i = 0; i < K; ++i) {
      const auto n = static_cast<std::size_t>(i);
      x[n] = variables<Real, 6 * K>(this->x(at, n), 3 * i);
      v[n] = variables<Real, 6 * K>(this->v(at, n), 3 * (K + i));
    }
    act<S>(at, x, v, force);
    this->local_.setZero();
    for (int i = 0; i < K; ++i) {
      const Vector3<S>& f = force[static_cast<std::size_t>(i)];
      this->on(static_cast<std::size_t>(i)) << f[0].value(), f[1].value(), f[2].value();
      for (int j = 0; j < K; ++j) {
        add_derivatives<Real, 6 * K>(-stiffness, f, 3 * j, this->local_.template block<3, 3>(3 * i, 3 * j));
        add_derivatives<Real, 6 * K>(-damping, f, 3 * (K + j), this->local_.template block<3, 3>(3 * i, 3 * j));
      }
    }
  }

 private:
  struct Derivative {
    std::size_t by;  ///< of the nine variables
    int value;       ///< its register
  };

  template <class S>
  void act(const Setting<Real>& at, const std::array<Vector3<S>, K>& x, const std::array<Vector3<S>, K>& v,
           std::array<Vector3<S>, K>& force) const {
    constexpr std::size_t axes = K == 4 ? 1 : 0;  // the first of them; with K = 1 there are none
    const auto in_axes = [&](const Vector3<S>& y) -> Vector3<S> {
      if constexpr (K >= 3) return {x[axes].dot(y), x[axes + 1].dot(y), x[axes + 2].dot(y)};
      else return y;
    };
    std::array<S, 9> place;
    place.fill(S(0));
    Vector3<S> load, turn = Vector3<S>::Zero();
    if (torque_) {
      if constexpr (K >= 3)
        for (std::size_t i = axes; i < axes + 3; ++i) turn += x[i].cross(v[i]) / Real(2);
      if (in_body_) turn = in_axes(turn);
      for (std::size_t i = 0; i < 3; ++i) place[6 + i] = turn[static_cast<int>(i)];
    } else {
      const Vector3<S> speed = in_body_ ? in_axes(v[0]) : v[0];
      for (std::size_t i = 0; i < 3; ++i) place[i] = x[0][static_cast<int>(i)], place[3 + i] = speed[static_cast<int>(i)];
    }
    load = components(at, place);
    if constexpr (K >= 3)
      if (in_body_) load = (load[0] * x[axes] + load[1] * x[axes + 1] + load[2] * x[axes + 2]).eval();
    for (Vector3<S>& f : force) f.setZero();
    if (!torque_) force[0] = load;
    else if constexpr (K >= 3)
      for (std::size_t i = axes; i < axes + 3; ++i) force[i] = load.cross(x[i]) / Real(2);
  }

  template <class S>
  Vector3<S> components(const Setting<Real>& at, const std::array<S, 9>& place) const {
    Expressions<Real>& e = at.expressions;
    for (std::size_t i = 0; i < 9; ++i) e.set(place_[i], value_of(place[i]));
    e.run(value_);
    if constexpr (!std::is_same_v<S, Real>) e.run(tangents_);
    Vector3<S> result;
    for (std::size_t i = 0; i < 3; ++i) {
      S& component = result[static_cast<int>(i)];
      component = S(e[components_[i]]);
      at.quantities[quantity_ + static_cast<int>(i)] = e[components_[i]];
      if constexpr (!std::is_same_v<S, Real>)
        for (const Derivative& d : by_[i]) component.derivatives() += e[d.value] * place[d.by].derivatives();
    }
    return result;
  }

  bool torque_, in_body_;
  int quantity_;
  std::array<int, 9> place_{};
  std::array<int, 3> components_{};
  std::array<std::vector<Derivative>, 3> by_;
  Routine value_, tangents_;
};

}  // namespace cutjoint::generic::natural
