// The bushing: six laws between two bodies, along and about axes of the base.
#pragma once

#include <array>
#include <vector>

#include "cutjoint/generic/natural/springs.hpp"

namespace cutjoint::generic::natural {

/// x = E^T way, theta = half the sum of e_k x g_k in E; forms: the way, the axes e of the base, the axes g of the follower.
template <class Real>
class Bushing final : public FormElement<Real> {
 public:
  Bushing(const Json& json, Expressions<Real>& e, const Forms<Real>& forms, int quantity)
      : FormElement<Real>(json, forms), quantity_(quantity) {
    const std::array<std::array<std::size_t, 2>, 3> turns{{{2, 1}, {0, 2}, {1, 0}}};
    const auto law = [&](std::size_t i) { return read_law(e, json.at("laws").at(i), "position"); };
    for (std::size_t i = 0; i < 3; ++i) laws_.push_back({law(i), {{Real(1), 0, base + i}}, 7});
    for (std::size_t i = 0; i < 3; ++i) {
      const auto [m, n] = turns[i];
      laws_.push_back({law(3 + i), {{Real(0.5), base + m, follower + n}, {Real(-0.5), base + n, follower + m}}, 7});
    }
  }

  void act(const Setting<Real>& at) override {
    this->force_.setZero();
    for (ProductLaw<Real>& law : laws_) law.act(at.expressions, x_of(at), v_of(at), this->force_);
    report(at);
  }

  void linearise(const Setting<Real>& at, Real damping, Real stiffness) override {
    act(at);
    this->local_.setZero();
    for (ProductLaw<Real>& law : laws_) law.linearise(at.expressions, x_of(at), v_of(at), damping, stiffness, this->local_);
  }

 private:
  static constexpr std::size_t base = 1, follower = 4;  ///< the first axis of each

  /// The force, the torque (d theta/d turn)^T law, the displacements and rotations.
  void report(const Setting<Real>& at) const {
    Matrix3<Real> S;
    for (std::size_t i = 0; i < 3; ++i)
      for (std::size_t j = 0; j < 3; ++j)
        S(static_cast<int>(i), static_cast<int>(j)) = this->x(at, base + i).dot(this->x(at, follower + j));
    const Vector3<Real> laws(laws_[3].force(), laws_[4].force(), laws_[5].force());
    const Vector3<Real> torque = (S.trace() * laws - S.transpose() * laws) / Real(2);
    Real* out = at.quantities + quantity_;
    for (std::size_t i = 0; i < 3; ++i) out[i] = laws_[i].force(), out[3 + i] = torque[static_cast<int>(i)];
    for (std::size_t i = 0; i < 6; ++i) out[6 + i] = laws_[i].place();
  }

  auto x_of(const Setting<Real>& at) const {
    return [this, &at](std::size_t i) -> const Vector3<Real>& { return this->x(at, i); };
  }
  auto v_of(const Setting<Real>& at) const {
    return [this, &at](std::size_t i) -> const Vector3<Real>& { return this->v(at, i); };
  }

  std::vector<ProductLaw<Real>> laws_;
  int quantity_;
};

}  // namespace cutjoint::generic::natural
