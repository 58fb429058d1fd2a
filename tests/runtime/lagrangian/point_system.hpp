// A system of mass points, written by hand: what a run file says under "system".
#pragma once

#include <array>
#include <string>
#include <vector>

#include "cutjoint/json.hpp"
#include "cutjoint/lagrangian/any_system.hpp"

namespace points {

using cutjoint::Json;
using Vector = std::array<double, 3>;

/// Where one end of an equation or force is: a point, or a pivot that swings, at + swing sin(rate t).
struct End {
  int point = -1;
  Vector at{}, swing{};
  double rate = 0.0;
};

/// An equation: (|a - b|^2 - length^2)/2, or normal . (a - b) where a normal is given.
struct Equation {
  End a, b;
  double length = 0.0;
  bool plane = false;
  Vector normal{};
};

/// A spring and damper from a to b without a length of its own; with `root`, the root of a's height pulls downwards as well.  Unless it is
/// `known`, the tangent leaves it out.
struct Spring {
  End a, b;
  double stiffness = 0.0, damping = 0.0;
  bool root = false, known = true;
};

/// Points with masses under gravity, held by equations and pulled by springs.  Factors without pivoting, as emitted code does.
class PointSystem final : public cutjoint::AnySystem<double> {
 public:
  explicit PointSystem(const Json& definition);
  PointSystem(const PointSystem&) = delete;

  const cutjoint::SystemDescription& description() const override { return d_; }
  void load(const double*, const cutjoint::Road<double>*) override {}
  void begin_step(double t, double motion) override;
  void initial_coordinates(const double* relative_q, const double* relative_v, double* q, double* v) const override;
  void dynamic_residual(const double* q, const double* v, const double* vdot, const double* lambda, double penalty, double* force_residual,
               double* residual) const override;
  void linearise(const double* q, const double* v, const double* vdot, const double* lambda, double penalty,
                 const cutjoint::Weights<double>& weights, double* force_residual, double* residual, double* tangent) const override;
  void constraint_residual(const double* q, const double* v, const double* vdot, double* residual, double* rate, double* curvature) const override;
  void apply_jacobian_transposed(const double* q, const double* w, double* force) const override;
  void apply_jacobian(const double* q, const double* x, double* change) const override;
  void report(const double* q, const double* v, const double* vdot, const double* lambda, double* column) const override;
  int factor(const double* tangent, double* factors) const override;
  void solve(const double* factors, double* x) const override;

 private:
  void read(const Json& definition);
  void name();
  void lay_out();
  double& dense(int row, int column) const { return matrix_[static_cast<std::size_t>(row * d_.pattern.size + column)]; }
  void differentiate(const Equation& equation, const double* q, int index) const;
  void add_spring(const Spring& spring, const double* q, const double* v, double* force_residual) const;
  void add_tangent(const Spring& spring, const double* q, const cutjoint::Weights<double>& weights) const;

  cutjoint::SystemDescription d_{};
  std::vector<std::string> names_;
  std::vector<double> mass_, at_, rate_;
  std::vector<Equation> equations_;
  std::vector<Spring> springs_;
  double t_ = 0.0, motion_ = 1.0;
  mutable std::vector<double> jacobian_, matrix_;
};

}  // namespace points
