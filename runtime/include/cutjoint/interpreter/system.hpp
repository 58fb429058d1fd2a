// A system with a tangent whose program is data.
#pragma once

#include "cutjoint/core/newton/static_factor.hpp"
#include "cutjoint/core/newton/system.hpp"
#include "cutjoint/interpreter/mechanism.hpp"
#include "cutjoint/lagrangian/any_system.hpp"
#include "cutjoint/read_json.hpp"

namespace cutjoint::interpreter {

/// The data of a factorisation (core/newton/static_factor.hpp).
class Factorisation {
 public:
  /// Of a matrix, with an array of `factors` numbers.
  Factorisation(const Json& tables, bool symmetric, int factors) : symmetric_(symmetric), factors_(factors) {
    for (const auto& [pivots, diagonal, reciprocals, uppers, lowers, sweeps] : read<6>(tables.at("steps")))
      steps_.push_back({pivots, diagonal, reciprocals, uppers, lowers, sweeps});
    for (const auto& [columns, source, multipliers, blocks] : read<4>(tables.at("sweeps")))
      sweeps_.push_back({columns, source, multipliers, blocks});
    for (const auto& [value, place] : read<2>(tables.at("entries"))) entries_.push_back({value, place});
    for (const auto& [row, column, place] : read<3>(tables.at("pivots"))) pivots_.push_back({row, column, place});
    targets_ = tables.at("targets").get<std::vector<int>>();
    others_ = tables.at("others").get<std::vector<int>>();
    room_.resize(4 * steps_.size());
  }

  int factor(const double* tangent, double* factors) const;  ///< as AnySystem has it
  void solve(const double* factors, double* x) const;

 private:
  template <std::size_t n>
  static std::vector<std::array<int, n>> read(const Json& list) { return list.get<std::vector<std::array<int, n>>>(); }

  bool symmetric_;
  int factors_;
  std::vector<static_factor::Step> steps_;
  std::vector<static_factor::Sweep> sweeps_;
  std::vector<static_factor::Entry> entries_;
  std::vector<static_factor::Pivot> pivots_;
  std::vector<int> targets_, others_;
  mutable std::vector<double> room_;  ///< four numbers a tile
};

/// The description of a system; the texts stand in the document.
inline SystemDescription read_system_description(const Json& d) {
  const auto method = read_word<Lagrangian>(d, "method", {{"augmented", Lagrangian::augmented}, {"classical", Lagrangian::classical},
                                                          {"recursive-newton", Lagrangian::recursive_newton}});
  const Json& p = d.at("pattern");
  return {read_description(d), method,
          {.size = p.at("size"), .symmetric = p.at("symmetric"), .first = p.at("first").get<std::vector<int>>(), .row = p.at("row").get<std::vector<int>>()}, d.at("factors")};
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
        factorisation_(document.at("tables"), description.pattern.symmetric, description.factors) {
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
