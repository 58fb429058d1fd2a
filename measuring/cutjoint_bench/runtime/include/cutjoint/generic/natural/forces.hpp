// The force elements of a description.
#pragma once

#include <map>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "cutjoint/generic/natural/bushing.hpp"
#include "cutjoint/generic/natural/load.hpp"
#include "cutjoint/generic/natural/wheel.hpp"

namespace cutjoint::generic::natural {

/// A load by the number of its forms.
template <class Real>
std::unique_ptr<Element<Real>> make_load(const Json& json, Expressions<Real>& e, const Forms<Real>& forms, int quantity) {
  switch (json.at("forms").size()) {
    case 1: return std::make_unique<BodyLoad<Real, 1>>(json, e, forms, quantity);
    case 3: return std::make_unique<BodyLoad<Real, 3>>(json, e, forms, quantity);
    default: return std::make_unique<BodyLoad<Real, 4>>(json, e, forms, quantity);
  }
}

template <class Real>
std::unique_ptr<Element<Real>> make_element(const Json& json, Expressions<Real>& e, const Forms<Real>& forms, int quantity) {
  const std::string kind = json.at("kind");
  if (kind == "point_spring") return std::make_unique<PointSpring<Real>>(json, e, forms, quantity);
  if (kind == "along") return std::make_unique<Along<Real>>(json, e, forms, quantity);
  if (kind == "angle") return std::make_unique<AngleForce<Real>>(json, e, forms, quantity);
  if (kind == "course") return std::make_unique<CourseForce<Real>>(json, e, quantity);
  if (kind == "bushing") return std::make_unique<Bushing<Real>>(json, e, forms, quantity);
  if (kind == "load") return make_load(json, e, forms, quantity);
  if (kind == "tyre") return std::make_unique<Wheel<Real>>(json, e, forms, quantity);
  throw std::runtime_error("unknown kind of force '" + kind + "'");
}

/// All force elements and their reported quantities.
template <class Real>
class Forces {
 public:
  Forces(const Json& described, Expressions<Real>& e, const Forms<Real>& forms) {
    for (const Json& json : described) {
      const int first = static_cast<int>(values_.size());
      for (const std::string name : json.at("quantities")) {
        quantities_[json.at("name").get<std::string>() + "." + name] = values_.size();
        values_.push_back(Real(0));
      }
      elements_.push_back(make_element(json, e, forms, first));
    }
  }

  void load(const Expressions<Real>& e, const Forms<Real>& forms) {
    for (const auto& element : elements_) element->load(e, forms);
  }
  void enter(Places& places) const {
    for (const auto& element : elements_) element->enter(places);
  }
  void find_entries(const Pattern& pattern) {
    for (const auto& element : elements_) element->find_entries(pattern);
  }

  /// force_residual -= Q.
  void act(const Setting<Real>& at, Real* force_residual) {
    for (const auto& element : elements_) {
      element->act(at);
      element->subtract_force(force_residual);
    }
  }

  /// Subtract the forces, and values += damping C + stiffness K.
  void linearise(const Setting<Real>& at, Real damping, Real stiffness, Real* force_residual, Real* values) {
    for (const auto& element : elements_) {
      element->linearise(at, damping, stiffness);
      element->subtract_force(force_residual);
      element->add_tangent(values);
    }
  }

  void report(const Setting<Real>& at) {
    for (const auto& element : elements_) {
      element->act(at);
      element->report_tangents(at);
    }
  }

  Real* values() { return values_.data(); }
  const Element<Real>& element(std::size_t i) const { return *elements_.at(i); }

  /// The number of a quantity "force.name".
  std::size_t quantity(const std::string& name) const { return quantities_.at(name); }
  Real value(std::size_t quantity) const { return values_[quantity]; }

 private:
  std::vector<std::unique_ptr<Element<Real>>> elements_;
  std::vector<Real> values_;
  std::map<std::string, std::size_t> quantities_;
};

}  // namespace cutjoint::generic::natural
