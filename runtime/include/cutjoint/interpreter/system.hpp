// A system with a tangent whose program is data.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "cutjoint/core/newton/system.hpp"
#include "cutjoint/interpreter/factorisation.hpp"
#include "cutjoint/interpreter/mechanism.hpp"
#include "cutjoint/lagrangian/any_system.hpp"
#include "cutjoint/lagrangian/system.hpp"
#include "cutjoint/read_json.hpp"

namespace cutjoint::interpreter {

/// Compressed columns in which every row is there.
inline Pattern read_pattern(const Json& p) {
  Pattern pattern{.size = p.at("size").get<int>(), .symmetric = p.at("symmetric").get<bool>(),
                  .first = p.at("first").get<std::vector<int>>(), .row = p.at("row").get<std::vector<int>>()};
  const auto entries = static_cast<int>(pattern.row.size());
  if (pattern.size < 0 || pattern.first.size() != static_cast<std::size_t>(pattern.size) + 1 || pattern.first.front() != 0 ||
      pattern.first.back() != entries || !std::is_sorted(pattern.first.begin(), pattern.first.end()))
    refuse("its pattern has wrong columns");
  for (const int row : pattern.row)
    if (row < 0 || row >= pattern.size) refuse("its pattern has no row " + std::to_string(row));
  return pattern;
}

/// The description of a system; the texts stand in the document.
inline SystemDescription read_system_description(const Json& d) {
  using Name = std::pair<std::string_view, Lagrangian>;
  constexpr std::array methods{Name{"augmented", Lagrangian::augmented}, Name{"classical", Lagrangian::classical},
                               Name{"recursive-newton", Lagrangian::recursive_newton}};
  SystemDescription found{read_description(d), read_word(d, "method", methods), read_pattern(d.at("pattern")),
                          read_index(d.at("factors"), 0, std::size_t(1) << 26)};
  const std::size_t rows = found.unknowns().size() + (found.method == Lagrangian::classical ? found.equations.size() : 0);
  if (static_cast<std::size_t>(found.pattern.size) != rows || found.pattern.symmetric != (found.method == Lagrangian::augmented))
    refuse("its pattern is of another method");
  return found;
}

/// A system; its factorisation is a loop over index data.
class InterpretedSystem final : public Interpreted<AnySystem<double>, SystemDescription> {
 public:
  /// `start` is what the mechanism that finds where runs begin says of itself.
  InterpretedSystem(const Json& document, const Description& start) : InterpretedSystem(document, start, read_system_description(document.at("description"))) {}

  void load(const double* parameters, const Road<double>* roads) override {
    program_.use_roads(roads);
    if (fits_.size() > 0) return program_.call(load_, {parameters, fits_.find(program_, parameters)}, {});
    program_.call(load_, {parameters}, {});
  }

  void initial_coordinates(const double* relative_q, const double* relative_v, double* q, double* v) const override {
    program_.call(initial_coordinates_, {relative_q, relative_v}, {q, v});
  }

  void dynamic_residual(const double* q, const double* v, const double* vdot, const double* lambda, double penalty, double* force_residual,
                        double* residual) const override {
    program_.call(dynamic_residual_, {q, v, vdot, lambda, &penalty}, {force_residual, residual});
  }

  void linearise(const double* q, const double* v, const double* vdot, const double* lambda, double penalty, const Weights<double>& weights,
                 double* force_residual, double* residual, double* tangent) const override {
    const double terms[] = {weights.damping, weights.stiffness, weights.constraint};
    program_.call(linearise_, {q, v, vdot, lambda, &penalty, terms, weights.ball_tangents}, {force_residual, residual, tangent});
  }

  void constraint_residual(const double* q, const double* v, const double* vdot, double* residual, double* rate,
                           double* curvature) const override {
    program_.call(constraint_residual_, {q, v, vdot}, {residual, rate, curvature});
  }

  void apply_jacobian_transposed(const double* q, const double* w, double* force) const override {
    program_.call(apply_jacobian_transposed_, {q, w}, {force});
  }

  void apply_jacobian(const double* q, const double* x, double* change) const override { program_.call(apply_jacobian_, {q, x}, {change}); }

  int factor(const double* tangent, double* factors) const override { return factorisation_.factor(tangent, factors); }
  void solve(const double* factors, double* x) const override { factorisation_.solve(factors, x); }

 private:
  InterpretedSystem(const Json& document, const Description& start, const SystemDescription& description)
      : Interpreted(document, description, description.unknowns().size()),
        factorisation_(document.at("tables"), description.pattern.symmetric, description.pattern.size, static_cast<int>(description.pattern.row.size()), description.factors) {
    const std::size_t n = v_.length, m = lambda_.length;
    const Argument penalty{"penalty", 1}, force_residual{"force_residual", n}, residual{"residual", m}, parameters{"parameters", description_.parameters.size()};
    load_ = program_.read("load", {parameters}, {});
    if (fits_.size() > 0) load_ = program_.read("load", {parameters, {"series", fits_.size()}}, {});
    initial_coordinates_ = program_.read("initial_coordinates", {{"relative_q", start.coordinates.size()}, {"relative_v", start.speeds.size()}}, {q_, v_});
    dynamic_residual_ = program_.read("dynamic_residual", {q_, v_, vdot_, lambda_, penalty}, {force_residual, residual});
    linearise_ = program_.read("linearise", {q_, v_, vdot_, lambda_, penalty, {"weights", 3}, {"weights.ball_tangents", size_of_ball_tangents(description_.charts)}},
                               {force_residual, residual, {"tangent", description_.pattern.row.size()}});
    constraint_residual_ = program_.read("constraint_residual", {q_, v_, vdot_}, {residual, {"rate", m}, {"curvature", m}});
    apply_jacobian_transposed_ = program_.read("apply_jacobian_transposed", {q_, {"w", m}}, {{"force", n}});
    apply_jacobian_ = program_.read("apply_jacobian", {q_, vdot_}, {{"change", m}});
  }

  Factorisation factorisation_;
  Function initial_coordinates_, dynamic_residual_, linearise_, constraint_residual_, apply_jacobian_transposed_, apply_jacobian_;
};

}  // namespace cutjoint::interpreter
