// A mechanism whose program is data.
#pragma once

#include <utility>

#include "cutjoint/interpreter/program.hpp"
#include "cutjoint/any_mechanism.hpp"

namespace cutjoint::interpreter {

/// A text in a document, which must outlive its use.
inline const char* text(const Json& list, std::size_t i) { return list.at(i).get_ref<const std::string&>().c_str(); }

/// What `read` makes of each item.
auto read_list(const Json& list, auto read) {
  std::vector<decltype(read(list))> found;
  for (const Json& item : list) found.push_back(read(item));
  return found;
}

inline auto read_names(const Json& list) {
  return read_list(list, [](const Json& name) { return name.get_ref<const std::string&>().c_str(); });
}

/// Names with units and, of parameters and inputs, values.
inline auto read_named(const Json& list) {
  return read_list(list, [](const Json& item) { return Named{text(item, 0), text(item, 1), item.size() > 2 ? item.at(2).get<double>() : 0.0}; });
}

/// The description of a model; the texts stand in the document.
inline Description read_description(const Json& d) {
  Description found;
  found.name = d.at("name").get_ref<const std::string&>().c_str();
  found.charts = read_list(d.at("charts"), [](const Json& c) { return Chart{.q = c.at(0), .v = c.at(1), .scalars = c.at(2), .ball = c.at(3), .reversed = c.at(4)}; });
  found.coordinates = read_names(d.at("coordinates"));
  found.speeds = read_names(d.at("speeds"));
  found.equations = read_names(d.at("equations"));
  found.cuts = d.at("cuts").get<std::vector<int>>();
  found.parameters = read_named(d.at("parameters"));
  found.inputs = read_named(d.at("inputs"));
  found.roads = read_names(d.at("roads"));
  found.columns = read_named(d.at("columns"));
  found.guards = read_list(d.at("guards"), [](const Json& g) { return Guard{text(g, 0), text(g, 1), g.size() == 3, g.size() > 3}; });
  found.domains = read_list(d.at("domains"), [](const Json& x) { return Domain{text(x, 0), text(x, 1), text(x, 2), x.at(3), x.size() > 4 ? x.at(4).get<int>() : -1}; });
  found.indicators = read_list(d.at("indicators"), [](const Json& s) { return EventIndicator{text(s, 0), text(s, 1), s.at(2), s.at(3)}; });
  found.controllers = read_list(d.at("controllers"), [](const Json& c) {
    return Controller{text(c, 0), text(c, 1), {.every = c.at(2), .offset = c.at(3), .discrete = c.at(4), .affects = text(c, 5), .accelerated = c.at(6)}};
  });
  found.states = d.at("states");
  found.nominals = d.at("nominals").get<std::vector<double>>();
  found.arm = d.at("arm");
  found.driven = d.at("driven").get<bool>();
  found.guides_jump = d.at("guides_jump").get<bool>();
  return found;
}

/// Runs a description by the compiler (emit/interpreted.py) like generated code of the same program, but without contraction of products and sums.  The document must
/// outlive it.
template <class Any, class D>
class Interpreted : public Any {
 public:
  const D& description() const override { return description_; }
  void drive_by(const InputSource<double>& source) override { inputs_.drive_by(source); }
  void begin_step(double t, double motion) override { inputs_.begin_step(program_, t, motion); }

  void report(const double* q, const double* v, const double* vdot, const double* lambda, double* column) const override {
    program_.call(report_, {q, v, vdot, lambda}, {column});
  }

  void energy(const double* q, const double* v, const double* vdot, const double* lambda, double* energy) const override {
    if (!energy_.results.empty()) program_.call(energy_, {q, v, vdot, lambda}, {energy});
  }

  void sample(const double* q, const double* v, const double* vdot, const double* lambda, double* next) const override {
    program_.call(sample_, {q, v, vdot, lambda}, {next});
  }

  void guard(const double* q, const double* v, double* margin) const override { program_.call(guard_, {q, v}, {margin}); }
  void events(const double* q, const double* v, double* value) const override { program_.call(events_, {q, v}, {value}); }
  void domains(const double* q, const double* v, const double* lambda, double* inside) const override {
    program_.call(domains_, {q, v, lambda}, {inside});
  }

 protected:
  /// For a description with this number of velocities.
  Interpreted(const Json& document, D description, std::size_t n)
      : description_(std::move(description)), q_{"q", description_.coordinates.size()}, v_{"v", n}, vdot_{"vdot", n}, lambda_{"lambda", description_.equations.size()},
        program_(document), inputs_(program_, document),
        fits_(program_, document, description_.parameters.size()) {
    report_ = program_.read("report", {q_, v_, vdot_, lambda_}, {{"column", description_.columns.size()}});
    if (program_.has("energy")) energy_ = program_.read("energy", {q_, v_, vdot_, lambda_}, {{"energy", 2}});
    if (program_.has("sample")) sample_ = program_.read("sample", {q_, v_, vdot_, lambda_}, {{"next_discrete", description_.discrete()}});
    guard_ = program_.read_if_any("guard", {q_, v_}, {"margin", description_.guards.size()});
    events_ = program_.read_if_any("events", {q_, v_}, {"value", description_.indicators.size()});
    domains_ = program_.read_if_any("domains", {q_, v_, lambda_}, {"inside", description_.domains.size()});
  }

  D description_;
  Argument q_, v_, vdot_, lambda_;
  mutable Program program_;  ///< its memory has the values of the last call
  StepBeginning inputs_;
  LoopFitsOfProgram fits_;
  Function load_;

 private:
  Function report_, energy_, sample_, guard_, events_, domains_;
};

/// A mechanism (`describe_mechanism`).
class InterpretedMechanism final : public Interpreted<AnyMechanism<double>, Description> {
 public:
  explicit InterpretedMechanism(const Json& document) : InterpretedMechanism(document, read_description(document.at("description"))) {}

  void load(const double* parameters, const Stabilisation<double>& stabilisation, const Road<double>* roads) override {
    const double numbers[] = {stabilisation.penalty, stabilisation.damping_ratio, stabilisation.frequency};
    program_.use_roads(roads);
    if (fits_.size() > 0) return program_.call(load_, {parameters, numbers, stabilisation.penalties, fits_.find(program_, parameters)}, {});
    program_.call(load_, {parameters, numbers, stabilisation.penalties}, {});
  }

  void evaluate(const double* q, const double* v, const double* lambda, double* vdot, double* correction) const override {
    program_.call(evaluate_, {q, v, lambda}, {vdot, correction});
  }

  void constraint_residual(const double* q, const double* v, double* residual, double* rate) const override {
    program_.call(constraint_residual_, {q, v}, {residual, rate});
  }

  void project(const double* q, const double* violation, double* dz) const override {
    if (project_.results.empty()) throw_no_projection();
    program_.call(project_, {q, violation}, {dz});
  }

 private:
  InterpretedMechanism(const Json& document, const Description& description) : Interpreted(document, description, description.speeds.size()) {
    const std::size_t m = lambda_.length;
    const Argument parameters{"parameters", description_.parameters.size()}, stabilisation{"stabilisation", 3}, penalties{"penalties", description_.cuts.size()};
    load_ = program_.read("load", {parameters, stabilisation, penalties}, {});
    if (fits_.size() > 0) load_ = program_.read("load", {parameters, stabilisation, penalties, {"series", fits_.size()}}, {});
    evaluate_ = program_.read("evaluate", {q_, v_, lambda_}, {vdot_, {"correction", m}});
    constraint_residual_ = program_.read("constraint_residual", {q_, v_}, {{"residual", m}, {"rate", m}});
    if (program_.has("project")) project_ = program_.read("project", {q_, {"violation", m}}, {{"dz", v_.length}});
  }

  Function evaluate_, constraint_residual_, project_;
};

}  // namespace cutjoint::interpreter
