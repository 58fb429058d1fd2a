// The generic solver of generated systems in natural coordinates: the same mechanics, with the model read and interpreted at run time.
#pragma once

#include <algorithm>
#include <stdexcept>
#include <string>
#include <vector>

#include "cutjoint/generic/description.hpp"
#include "cutjoint/generic/natural/mass.hpp"
#include "cutjoint/generic/natural/report.hpp"
#include "cutjoint/generic/natural/start.hpp"
#include "cutjoint/lagrangian/any_system.hpp"

namespace cutjoint::generic::natural {

/// Interprets a system that the compiler has described (generic/system.py).  It has the functions of AnySystem but `factor` and
/// `solve`: its tangent is for a library solver.  The pattern follows from the structure that it reads.  Nothing allocates after
/// construction.
template <class Real>
class GenericSystem {
 public:
  using real_type = Real;

  explicit GenericSystem(const Json& document)
      : names_(read_names(document)), e_(names_.parameters.size(), document.at("inputs")), forms_(document, e_), masses_(document, e_, forms_),
        rows_(document.at("equations"), e_, forms_), forces_(document.at("forces"), e_, forms_),
        reporter_(document.at("outputs"), e_, forms_, rows_, forces_), start_(document) {
    describe(document.at("method") == "augmented" ? Lagrangian::augmented : Lagrangian::classical);
    find_pattern();
  }

  GenericSystem(const GenericSystem&) = delete;
  GenericSystem& operator=(const GenericSystem&) = delete;

  const SystemDescription& description() const { return description_; }

  /// `roads` must outlive the system.
  void load(const Real* parameters, const Road<Real>* roads) {
    roads_ = roads;
    e_.load(parameters);
    forms_.load(e_);
    masses_.load(e_);
    rows_.load(e_);
    forces_.load(e_, forms_);
    start_.load(parameters);
  }

  void drive_by(const InputSource<Real>& source) {
    e_.drive_by(source);
    start_.drive_by(source);
  }

  void begin_step(Real t, Real motion) {
    e_.begin_step(t, motion);
    rows_.begin_step(e_);
    start_.begin_step(t, motion);
  }

  void sample(const Real*, const Real*, const Real*, const Real*, Real*) const {}  ///< of q, v, vdot, lambda; generic solvers have no controllers

  void initial_coordinates(const Real* relative_q, const Real* relative_v, Real* q, Real* v) { start_.initial_coordinates(relative_q, relative_v, q, v); }

  void dynamic_residual(const Real* q, const Real* v, const Real* vdot, const Real* lambda, Real penalty, Real* force_residual, Real* residual) {
    forms_.update(q, v);
    masses_.add_inertial_forces(vdot, force_residual);
    forces_.act(setting(q, v), force_residual);
    add_constraints(q, lambda, penalty, force_residual, residual);
  }

  void linearise(const Real* q, const Real* v, const Real* vdot, const Real* lambda, Real penalty, const Weights<Real>& weights,
                 Real* force_residual, Real* residual, Real* tangent) {
    forms_.update(q, v);
    masses_.add_inertial_forces(vdot, force_residual);
    std::copy(masses_.tangent().begin(), masses_.tangent().end(), tangent);
    forces_.linearise(setting(q, v), weights.damping, weights.stiffness, force_residual, tangent);
    add_constraints(q, lambda, penalty, force_residual, residual);
    if (is_augmented()) rows_.add_squares(weights.constraint, tangent);
    else rows_.add_borders(weights.constraint, tangent);
  }

  void constraint_residual(const Real* q, const Real* v, const Real* vdot, Real* residual, Real* rate, Real* curvature) {
    forms_.update(q, v);
    rows_.update(q);
    for (std::size_t i = 0; i < rows_.size(); ++i) {
      residual[i] = rows_.residual(i);
      rate[i] = rows_.rate(i, v);
      curvature[i] = rows_.curvature(i, v, vdot);
    }
  }

  void apply_jacobian_transposed(const Real* q, const Real* w, Real* force) {
    forms_.update(q, q);  // the rates do not matter
    rows_.update(q);
    std::fill_n(force, description_.coordinates.size(), Real(0));
    for (std::size_t i = 0; i < rows_.size(); ++i) rows_.add_gradient(i, w[i], force);
  }

  void apply_jacobian(const Real* q, const Real* x, Real* change) {
    forms_.update(q, q);  // the rates do not matter
    rows_.update(q);
    for (std::size_t i = 0; i < rows_.size(); ++i) change[i] = rows_.directional_derivative(i, x);
  }

  void report(const Real* q, const Real* v, const Real* vdot, const Real* lambda, Real* column) {
    forms_.update_all(q, v);
    forms_.accelerate(vdot);
    rows_.update(q);
    forces_.report(setting(q, v));
    reporter_.report(q, v, lambda, masses_.gravity(e_), column);
  }

  /// The compiler does not describe models with guards to this generic solver.
  void guard(const Real*, const Real*, Real*) const {}

 private:
  static Names read_names(const Json& document) {
    if (document.at("format") != "cutjoint-generic-natural-1")
      throw std::runtime_error("not a description of a system in natural coordinates for the generic solver");
    Names names;
    names.model = document.at("name");
    names.parameters = read_parameter_names(document);
    names.inputs = read_parameter_names(document, "inputs");
    names.roads = document.at("roads").template get<std::vector<std::string>>();
    names.coordinates = document.at("coordinates").template get<std::vector<std::string>>();
    for (const Json& equation : document.at("equations")) names.equations.push_back(equation.at("name"));
    for (const Json& output : document.at("outputs")) names.columns.push_back({output.at("name"), output.at("unit")});
    return names;
  }

  void describe(Lagrangian method) {
    description_.name = names_.model.c_str();
    description_.method = method;
    description_.coordinates = views_of(names_.coordinates);
    description_.equations = views_of(names_.equations);
    description_.parameters = views_of(names_.parameters);
    description_.inputs = views_of(names_.inputs);
    description_.roads = views_of(names_.roads);
    description_.columns = views_of(names_.columns);
    description_.factors = 0;
  }

  bool is_augmented() const { return description_.method == Lagrangian::augmented; }

  /// Entries that masses, forces and equations may have; of a symmetric tangent the diagonal too.
  void find_pattern() {
    const int n = static_cast<int>(names_.coordinates.size()), m = static_cast<int>(names_.equations.size());
    Places places(is_augmented() ? n : n + m, is_augmented());
    for (int i = 0; is_augmented() && i < n; ++i) places.add(i, i);
    masses_.enter(places);
    forces_.enter(places);
    rows_.enter(places, is_augmented(), n);
    description_.pattern = places.pattern();
    masses_.find_entries(description_.pattern);
    forces_.find_entries(description_.pattern);
    rows_.find_entries(description_.pattern, is_augmented(), n);
  }

  Setting<Real> setting(const Real* q, const Real* v) { return {forms_, e_, roads_, q, v, forces_.values()}; }

  /// Phi, and force_residual += Phi_q^T (penalty Phi + lambda).
  void add_constraints(const Real* q, const Real* lambda, Real penalty, Real* force_residual, Real* residual) {
    rows_.update(q);
    for (std::size_t i = 0; i < rows_.size(); ++i) {
      residual[i] = rows_.residual(i);
      rows_.add_gradient(i, penalty * residual[i] + lambda[i], force_residual);
    }
  }

  Names names_;
  SystemDescription description_;
  const Road<Real>* roads_ = nullptr;
  Expressions<Real> e_;
  Forms<Real> forms_;
  Masses<Real> masses_;
  Rows<Real> rows_;
  Forces<Real> forces_;
  Reporter<Real> reporter_;
  Start<Real> start_;
};

}  // namespace cutjoint::generic::natural
