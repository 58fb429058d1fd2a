// Force elements: what they push, and their share of the tangent.
#pragma once

#include <iterator>
#include <set>
#include <vector>

#include "cutjoint/generic/natural/forms.hpp"
#include "cutjoint/generic/natural/places.hpp"
#include "cutjoint/core/roads/road.hpp"

namespace cutjoint::generic::natural {

/// The variables of a force element.
template <class Real>
struct Setting {
  const Forms<Real>& forms;
  Expressions<Real>& expressions;
  const Road<Real>* roads;  ///< of all tyres
  const Real *q, *v;
  Real* quantities;  ///< of all elements
};

/// A force element.  `act` finds its force, `linearise` also its tangent damping C + stiffness K with K = -dQ/dq, C = -dQ/dv; of a
/// symmetric tangent the symmetric part.
template <class Real>
class Element {
 public:
  virtual ~Element() = default;
  virtual void load(const Expressions<Real>&, const Forms<Real>&) {}
  virtual void enter(Places&) const {}
  virtual void find_entries(const Pattern&) {}

  virtual void act(const Setting<Real>& at) = 0;
  virtual void linearise(const Setting<Real>& at, Real damping, Real stiffness) = 0;

  /// Reports the derivatives of its law, after `act`.
  virtual void report_tangents(const Setting<Real>&) {}

  /// force_residual -= Q.
  virtual void subtract_force(Real*) const {}
  virtual void add_tangent(Real*) {}

  /// The force on one of its forms.
  virtual Vector3<Real> on_form(std::size_t) const { return Vector3<Real>::Zero(); }
};

/// A force element over forms: its force is one vector a form, its matrix has three rows and columns for each.
template <class Real>
class FormElement : public Element<Real> {
 public:
  FormElement(const Json& json, const Forms<Real>& forms) : forms_(json.at("forms").get<std::vector<int>>()) {
    std::set<int> coordinates;
    for (const int form : forms_)
      for (const Term<Real>& t : forms.terms(form)) coordinates.insert(t.at);
    for (const int at : coordinates)
      for (int i = 0; i < 3; ++i) scalars_.push_back(at + i);
    for (std::size_t f = 0; f < forms_.size(); ++f)
      for (const Term<Real>& t : forms.terms(forms_[f])) {
        const auto place = std::distance(coordinates.begin(), coordinates.find(t.at));
        terms_.push_back({3 * static_cast<Eigen::Index>(f), 3 * static_cast<Eigen::Index>(place), t.at, Real(0)});
      }
    const auto k = 3 * static_cast<Eigen::Index>(forms_.size()), n = 3 * static_cast<Eigen::Index>(coordinates.size());
    force_ = Eigen::Matrix<Real, 3, Eigen::Dynamic>::Zero(3, k / 3);
    local_ = Dense::Zero(k, k);
    half_ = Dense::Zero(k, n);
    matrix_ = Dense::Zero(n, n);
  }

  void load(const Expressions<Real>& e, const Forms<Real>& forms) override {
    auto own = terms_.begin();
    for (const int form : forms_)
      for (const Term<Real>& t : forms.terms(form)) (own++)->coefficient = t.coefficient;
    load_values(e);
  }

  void enter(Places& places) const override { Scatter::enter(places, scalars_); }

  void find_entries(const Pattern& pattern) override {
    symmetric_ = pattern.symmetric;
    scatter_.find_entries(pattern, scalars_);
  }

  void subtract_force(Real* force_residual) const override {
    for (const LocalTerm& t : terms_) Eigen::Map<Vector3<Real>>(force_residual + t.at) -= t.coefficient * force_.col(t.form / 3);
  }

  /// The local matrix over the coordinates, first its columns, then its rows.
  void add_tangent(Real* values) override {
    if (symmetric_) symmetrise();
    half_.setZero();
    for (const LocalTerm& t : terms_) half_.template middleCols<3>(t.place) += t.coefficient * local_.template middleCols<3>(t.form);
    matrix_.setZero();
    for (Eigen::Index j = 0; j < matrix_.cols(); ++j)
      for (const LocalTerm& t : terms_)
        matrix_.col(j).template segment<3>(t.place) += t.coefficient * half_.col(j).template segment<3>(t.form);
    scatter_.add(matrix_.data(), values);
  }

  Vector3<Real> on_form(std::size_t i) const override { return force_.col(static_cast<Eigen::Index>(i)); }

 protected:
  using Dense = Eigen::Matrix<Real, Eigen::Dynamic, Eigen::Dynamic>;

  virtual void load_values(const Expressions<Real>&) {}

  const Vector3<Real>& x(const Setting<Real>& at, std::size_t i) const { return at.forms.x(forms_[i]); }
  const Vector3<Real>& v(const Setting<Real>& at, std::size_t i) const { return at.forms.v(forms_[i]); }
  auto on(std::size_t i) { return force_.col(static_cast<Eigen::Index>(i)); }

  std::vector<int> forms_;
  Eigen::Matrix<Real, 3, Eigen::Dynamic> force_;  ///< on each form
  Dense local_;                                   ///< damping C + stiffness K over the forms

 private:
  /// A form's part of a coordinate: the first rows of both in the local matrix and among the element's scalars.
  struct LocalTerm {
    Eigen::Index form, place;
    int at;
    Real coefficient;
  };

  void symmetrise() {
    for (Eigen::Index j = 0; j < local_.cols(); ++j)
      for (Eigen::Index i = 0; i < j; ++i) local_(i, j) = local_(j, i) = (local_(i, j) + local_(j, i)) / 2;
  }

  std::vector<int> scalars_;
  std::vector<LocalTerm> terms_;
  Dense half_, matrix_;
  Scatter scatter_;
  bool symmetric_ = false;
};

}  // namespace cutjoint::generic::natural
