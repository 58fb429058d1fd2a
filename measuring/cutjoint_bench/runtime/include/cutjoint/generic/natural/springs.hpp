// Force laws: over the length between two points, over sums of products of forms, over angles.
#pragma once

#include <algorithm>
#include <array>
#include <string>
#include <vector>

#include "cutjoint/generic/natural/element.hpp"
#include "cutjoint/generic/read_model.hpp"

namespace cutjoint::generic::natural {

/// A law's value and its partial derivatives.
template <class Real>
struct LawValues {
  Real force{0}, stiffness{0}, damping{0};
};

template <class Real>
Real law_force(Expressions<Real>& e, const Law& law, Real position, Real rate) {
  e.set(law.position, position);
  e.set(law.rate, rate);
  e.run(law.value);
  return e[law.force];
}

/// Evaluate a law and its derivatives.
template <class Real>
LawValues<Real> law_tangents(Expressions<Real>& e, const Law& law) {
  e.run(law.tangents);
  return {e[law.force], e[law.stiffness], e[law.damping]};
}

template <class Real>
void report_law(const Setting<Real>& at, const Law& law, int quantity) {
  const LawValues<Real> f = law_tangents(at.expressions, law);
  at.quantities[quantity + 1] = f.stiffness;
  at.quantities[quantity + 2] = f.damping;
}

/// n = way/length, Q = -law(length, rate) n on the way.
template <class Real>
class PointSpring final : public FormElement<Real> {
 public:
  PointSpring(const Json& json, Expressions<Real>& e, const Forms<Real>& forms, int quantity)
      : FormElement<Real>(json, forms), law_(read_law(e, json.at("law"), "length")), quantity_(quantity) {}

  void act(const Setting<Real>& at) override {
    const Vector3<Real>& way = this->x(at, 0);
    length_ = way.norm();
    n_ = way / length_;
    rate_ = n_.dot(this->v(at, 0));
    tension_ = law_force(at.expressions, law_, length_, rate_);
    this->on(0) = -tension_ * n_;
    Real* out = at.quantities + quantity_;
    out[0] = tension_, out[3] = length_, out[4] = rate_;
  }

  /// K = f_l n n^T + f_r n (dr/dx)^T + f (1 - n n^T)/l with dr/dx = (v - r n)/l,  C = f_r n n^T.
  void linearise(const Setting<Real>& at, Real damping, Real stiffness) override {
    act(at);
    const LawValues<Real> f = law_tangents(at.expressions, law_);
    const Vector3<Real> turning = (this->v(at, 0) - rate_ * n_) / length_;
    const Real along = stiffness * (f.stiffness - tension_ / length_) + damping * f.damping;
    this->local_.noalias() = n_ * (along * n_ + stiffness * f.damping * turning).transpose();
    this->local_.diagonal().array() += stiffness * tension_ / length_;
  }

  void report_tangents(const Setting<Real>& at) override { report_law(at, law_, quantity_); }

 private:
  Law law_;
  int quantity_;
  Vector3<Real> n_ = Vector3<Real>::Zero();
  Real length_{0}, rate_{0}, tension_{0};
};

/// s = sum of factor (x_a . x_b) over local forms, and a law over it: Q = law(s, s') ds/dx.
template <class Real>
class ProductLaw {
 public:
  struct Product {
    Real factor;
    std::size_t a, b;
  };

  ProductLaw(Law law, std::vector<Product> products, std::size_t forms)
      : law_(law), products_(std::move(products)), by_place_(Vector::Zero(3 * static_cast<Eigen::Index>(forms))), by_turn_(by_place_) {}

  Real place() const { return place_; }
  Real rate() const { return rate_; }
  Real force() const { return force_; }
  const Law& law() const { return law_; }

  /// `x(i)`, `v(i)` are the local forms; adds to force (3, forms).
  template <class X, class V, class Force>
  void act(Expressions<Real>& e, X x, V v, Force& force) {
    place_ = rate_ = Real(0);
    for (const Product& p : products_) {
      place_ += p.factor * x(p.a).dot(x(p.b));
      rate_ += p.factor * (x(p.a).dot(v(p.b)) + x(p.b).dot(v(p.a)));
    }
    force_ = law_force(e, law_, place_, rate_);
    for (const Product& p : products_) {
      force.col(static_cast<Eigen::Index>(p.a)) += force_ * p.factor * x(p.b);
      force.col(static_cast<Eigen::Index>(p.b)) += force_ * p.factor * x(p.a);
    }
  }

  /// local += damping C + stiffness K after `act`, with g = ds/dx, h = ds'/dx and the constant second derivative H of s:
  /// K = -(f_s g g^T + f_r g h^T + f H),  C = -f_r g g^T.
  template <class X, class V, class Local>
  void linearise(Expressions<Real>& e, X x, V v, Real damping, Real stiffness, Local& local) {
    const LawValues<Real> f = law_tangents(e, law_);
    by_place_.setZero();
    by_turn_.setZero();
    for (const Product& p : products_) {
      segment(by_place_, p.a) += p.factor * x(p.b);
      segment(by_place_, p.b) += p.factor * x(p.a);
      segment(by_turn_, p.a) += p.factor * v(p.b);
      segment(by_turn_, p.b) += p.factor * v(p.a);
      const auto a = 3 * static_cast<Eigen::Index>(p.a), b = 3 * static_cast<Eigen::Index>(p.b);
      for (Eigen::Index i = 0; i < 3; ++i) {
        local(a + i, b + i) -= stiffness * f.force * p.factor;
        local(b + i, a + i) -= stiffness * f.force * p.factor;
      }
    }
    by_turn_ = (stiffness * f.stiffness + damping * f.damping) * by_place_ + stiffness * f.damping * by_turn_;
    local.noalias() -= by_place_ * by_turn_.transpose();
  }

 private:
  using Vector = Eigen::Matrix<Real, Eigen::Dynamic, 1>;

  static auto segment(Vector& x, std::size_t i) { return x.template segment<3>(3 * static_cast<Eigen::Index>(i)); }

  Law law_;
  std::vector<Product> products_;
  Vector by_place_, by_turn_;
  Real place_{0}, rate_{0}, force_{0};
};

/// A law over way . axis.
template <class Real>
class Along final : public FormElement<Real> {
 public:
  Along(const Json& json, Expressions<Real>& e, const Forms<Real>& forms, int quantity)
      : FormElement<Real>(json, forms), reports_place_(json.at("quantities").size() == 5), quantity_(quantity),
        law_(read_law(e, json.at("law"), json.at("variable").get<std::string>().c_str()), {{Real(1), 0, 1}}, 2) {}

  void act(const Setting<Real>& at) override {
    this->force_.setZero();
    law_.act(at.expressions, x_of(at), v_of(at), this->force_);
    Real* out = at.quantities + quantity_;
    out[0] = law_.force();
    if (reports_place_) out[3] = law_.place(), out[4] = law_.rate();
  }

  void linearise(const Setting<Real>& at, Real damping, Real stiffness) override {
    act(at);
    this->local_.setZero();
    law_.linearise(at.expressions, x_of(at), v_of(at), damping, stiffness, this->local_);
  }

  void report_tangents(const Setting<Real>& at) override { report_law(at, law_.law(), quantity_); }

 private:
  auto x_of(const Setting<Real>& at) const {
    return [this, &at](std::size_t i) -> const Vector3<Real>& { return this->x(at, i); };
  }
  auto v_of(const Setting<Real>& at) const {
    return [this, &at](std::size_t i) -> const Vector3<Real>& { return this->v(at, i); };
  }

  bool reports_place_;
  int quantity_;
  ProductLaw<Real> law_;
};

/// A law over an angle that is a coordinate.
template <class Real>
class AngleForce final : public Element<Real> {
 public:
  AngleForce(const Json& json, Expressions<Real>& e, const Forms<Real>& forms, int quantity)
      : angle_(forms.angle(json.at("angle"))), law_(read_law(e, json.at("law"), "position")), quantity_(quantity) {}

  void enter(Places& places) const override { places.add(angle_, angle_); }
  void find_entries(const Pattern& pattern) override { entry_ = entry_of(pattern, angle_, angle_); }

  void act(const Setting<Real>& at) override {
    force_ = law_force(at.expressions, law_, at.q[angle_], at.v[angle_]);
    at.quantities[quantity_] = force_;
  }

  void linearise(const Setting<Real>& at, Real damping, Real stiffness) override {
    act(at);
    const LawValues<Real> f = law_tangents(at.expressions, law_);
    tangent_ = -(damping * f.damping + stiffness * f.stiffness);
  }

  void report_tangents(const Setting<Real>& at) override { report_law(at, law_, quantity_); }
  void subtract_force(Real* force_residual) const override { force_residual[angle_] -= force_; }
  void add_tangent(Real* values) override { values[entry_] += tangent_; }

 private:
  int angle_, entry_ = -1;
  Law law_;
  int quantity_;
  Real force_{0}, tangent_{0};
};

/// A law over a guided coordinate, which does nothing but be reported.
template <class Real>
class CourseForce final : public Element<Real> {
 public:
  CourseForce(const Json& json, Expressions<Real>& e, int quantity)
      : law_(read_law(e, json.at("law"), "position")), position_(e.read(json.at("course").at(0))), rate_(e.read(json.at("course").at(1))),
        quantity_(quantity) {}

  void act(const Setting<Real>& at) override {
    at.quantities[quantity_] = law_force(at.expressions, law_, at.expressions[position_], at.expressions[rate_]);
  }

  void linearise(const Setting<Real>&, Real, Real) override {}
  void report_tangents(const Setting<Real>& at) override { report_law(at, law_, quantity_); }

 private:
  Law law_;
  int position_, rate_, quantity_;
};

}  // namespace cutjoint::generic::natural
