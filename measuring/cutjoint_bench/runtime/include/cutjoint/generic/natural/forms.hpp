// Forms of a system in natural coordinates: points and directions as linear combinations of coordinates, and how they move.
#pragma once

#include <array>
#include <map>
#include <span>
#include <vector>

#include "cutjoint/generic/algebra.hpp"
#include "cutjoint/generic/expression.hpp"

namespace cutjoint::generic::natural {

/// A form's part of the three elements of a coordinate from `at` on.
template <class Real>
struct Term {
  int at;
  Real coefficient;
};

/// All forms of a description, resolved to coordinates and constants when it is read; their coefficients follow when parameters are loaded.
/// The first `running` of them are those that equations and forces use.
template <class Real>
class Forms {
 public:
  Forms(const Json& document, Expressions<Real>& e) : running_(document.at("running")) {
    for (const Json& node : document.at("nodes")) nodes_.push_back(read_node(node, e));
    for (const Json& form : document.at("forms")) append(resolve(form, e), e);
    x_.assign(count(), Vector3<Real>::Zero());
    v_ = a_ = constant_ = x_;
  }

  void load(const Expressions<Real>& e) {
    for (std::size_t i = 0; i < terms_.size(); ++i) terms_[i].coefficient = sum(e, products_[i]);
    for (std::size_t i = 0; i < count(); ++i) {
      constant_[i].setZero();
      for (const Constant& c : constants_[i])
        constant_[i] += product(e, c.factors) * Vector3<Real>(e[c.value[0]], e[c.value[1]], e[c.value[2]]);
    }
  }

  /// Values and rates of the running forms, or of all.
  void update(const Real* q, const Real* v) { update(q, v, running_); }
  void update_all(const Real* q, const Real* v) { update(q, v, count()); }

  /// Second derivatives of all forms.
  void accelerate(const Real* vdot) {
    for (std::size_t i = 0; i < count(); ++i) {
      a_[i].setZero();
      for (const Term<Real>& t : terms(static_cast<int>(i))) a_[i] += t.coefficient * three(vdot + t.at);
    }
  }

  const Vector3<Real>& x(int form) const { return x_[static_cast<std::size_t>(form)]; }
  const Vector3<Real>& v(int form) const { return v_[static_cast<std::size_t>(form)]; }
  const Vector3<Real>& a(int form) const { return a_[static_cast<std::size_t>(form)]; }

  /// The terms of a form in the order of the coordinates.
  std::span<const Term<Real>> terms(int form) const {
    const auto i = static_cast<std::size_t>(form);
    return {terms_.data() + first_[i], first_[i + 1] - first_[i]};
  }

  /// The place of an angle's scalar coordinate.
  int angle(int node) const { return nodes_.at(static_cast<std::size_t>(node)).at; }

 private:
  using Product = std::vector<int>;  ///< of registers

  struct Constant {
    Product factors;
    std::array<int, 3> value;
  };

  /// A node or form over coordinates and constants, each with a sum of products.
  struct Resolved {
    int at = -1;  ///< of an angle
    std::map<int, std::vector<Product>> terms;
    std::vector<Constant> constants;
  };

  static Eigen::Map<const Vector3<Real>> three(const Real* at) { return Eigen::Map<const Vector3<Real>>(at); }

  std::size_t count() const { return constants_.size(); }

  void update(const Real* q, const Real* v, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) {
      x_[i] = constant_[i];
      v_[i].setZero();
      for (const Term<Real>& t : terms(static_cast<int>(i))) {
        x_[i] += t.coefficient * three(q + t.at);
        v_[i] += t.coefficient * three(v + t.at);
      }
    }
  }

  Resolved read_node(const Json& json, Expressions<Real>& e) const {
    Resolved node;
    if (json.contains("parts")) return resolve(json.at("parts"), e);
    if (json.contains("value")) {
      const Json& value = json.at("value");
      node.constants.push_back({{}, {e.read(value.at(0)), e.read(value.at(1)), e.read(value.at(2))}});
    } else if (node.at = json.at("coordinate"); json.at("size") == 3) {
      node.terms[node.at] = {{}};
    }
    return node;
  }

  Resolved resolve(const Json& parts, Expressions<Real>& e) const {
    Resolved sum;
    for (const Json& part : parts) {
      const Resolved& node = nodes_.at(part.at(0).template get<std::size_t>());
      const int factor = e.read(part.at(1));
      for (const auto& [at, products] : node.terms)
        for (const Product& p : products) sum.terms[at].push_back(with(p, factor, e));
      for (const Constant& c : node.constants) sum.constants.push_back({with(c.factors, factor, e), c.value});
    }
    return sum;
  }

  static Product with(Product product, int factor, const Expressions<Real>& e) {
    if (!e.is_constant(factor, 1.0)) product.push_back(factor);
    return product;
  }

  void append(const Resolved& form, const Expressions<Real>& e) {
    for (const auto& [at, products] : form.terms) {
      if (vanishes(products, e)) continue;
      terms_.push_back({at, Real(0)});
      products_.push_back(products);
    }
    first_.push_back(terms_.size());
    constants_.push_back(form.constants);
  }

  /// True if a coefficient is zero at all values of the parameters.
  static bool vanishes(const std::vector<Product>& products, const Expressions<Real>& e) {
    using std::abs;
    for (const Product& p : products)
      for (const int factor : p)
        if (!e.is_number(factor)) return false;
    return abs(sum(e, products)) < Real(1e-13);
  }

  static Real sum(const Expressions<Real>& e, const std::vector<Product>& products) {
    Real total(0);
    for (const Product& p : products) total += product(e, p);
    return total;
  }

  static Real product(const Expressions<Real>& e, const Product& factors) {
    Real result(1);
    for (const int factor : factors) result *= e[factor];
    return result;
  }

  std::size_t running_;
  std::vector<Resolved> nodes_;
  std::vector<Term<Real>> terms_;
  std::vector<std::vector<Product>> products_;  ///< of each term
  std::vector<std::size_t> first_{0};
  std::vector<std::vector<Constant>> constants_;
  std::vector<Vector3<Real>> constant_, x_, v_, a_;
};

}  // namespace cutjoint::generic::natural
