// A mechanism whose program is data.
#pragma once

#include <utility>

#include "cutjoint/interpreter/program.hpp"
#include "cutjoint/mechanism.hpp"

namespace cutjoint::interpreter {

inline std::vector<std::string_view> read_names(const Json& list) {
  std::vector<std::string_view> names;
  for (const Json& name : list) names.push_back(name.get_ref<const std::string&>());
  return names;
}

/// A text in a document, which must outlive its use.
inline const char* text(const Json& list, std::size_t i) { return list.at(i).get_ref<const std::string&>().c_str(); }

/// Names with units and, of parameters and inputs, values.
inline std::vector<Named> read_named(const Json& list) {
  std::vector<Named> named;
  for (const Json& item : list) named.push_back({text(item, 0), text(item, 1), item.size() > 2 ? item.at(2).get<double>() : 0.0});
  return named;
}

/// An integer from `least` to below `end`.
inline int read_index(const Json& value, int least, std::size_t end) {
  const auto number = value.get<std::int64_t>();
  if (number < least || number >= static_cast<std::int64_t>(end)) refuse("its description has no place " + value.dump());
  return static_cast<int>(number);
}

inline std::vector<Chart> read_charts(const Json& list, std::size_t coordinates, std::size_t speeds) {
  std::vector<Chart> charts;
  for (const Json& c : list) {
    const bool ball = c.at(3).get<bool>();
    const int q = read_index(c.at(0), 0, coordinates), v = read_index(c.at(1), 0, speeds), scalars = read_index(c.at(2), 0, speeds + 1);
    if (static_cast<std::size_t>(q + scalars + 4 * ball) > coordinates || static_cast<std::size_t>(v + scalars + 3 * ball) > speeds)
      refuse("a joint has coordinates beyond the last");
    charts.push_back({.q = q, .v = v, .scalars = scalars, .ball = ball, .reversed = c.at(4).get<bool>()});
  }
  return charts;
}

/// The description of a model; the texts stand in the document.
inline Description read_description(const Json& d) {
  Description found;
  found.name = d.at("name").get_ref<const std::string&>();
  found.coordinates = read_names(d.at("coordinates"));
  found.speeds = read_names(d.at("speeds"));
  found.equations = read_names(d.at("equations"));
  found.charts = read_charts(d.at("charts"), found.coordinates.size(), found.speeds.size());
  int first = 0;
  for (const Json& cut : d.at("cuts")) found.cuts.push_back(first = read_index(cut, first, found.equations.size()));
  found.parameters = read_named(d.at("parameters"));
  found.inputs = read_named(d.at("inputs"));
  found.roads = read_names(d.at("roads"));
  found.columns = read_named(d.at("columns"));
  for (const Json& g : d.at("guards")) found.guards.push_back({text(g, 0), text(g, 1), g.size() == 3, g.size() > 3});
  for (const Json& x : d.at("domains")) found.domains.push_back({text(x, 0), text(x, 1), text(x, 2), x.at(3).get<bool>(), x.size() > 4 ? read_index(x.at(4), 0, d.at("domains").size()) : -1});
  const Json& indicators = d.at("indicators");
  for (const Json& s : indicators)
    found.indicators.push_back({.element = text(s, 0), .place = text(s, 1), .road = read_index(s.at(2), -1, found.roads.size()),
                              .across = read_index(s.at(3), -1, indicators.size())});
  for (const Json& c : d.at("controllers")) {
    const std::string& affects = c.at(5).get_ref<const std::string&>();
    const int discrete = read_index(c.at(4), 0, 1000000);
    if (affects.size() != static_cast<std::size_t>(discrete)) refuse("a controller has other discrete states than it says to affect motion or not");
    found.controllers.push_back({text(c, 0), text(c, 1), {c.at(2).get<double>(), c.at(3).get<double>(), discrete, affects.c_str(), c.at(6).get<bool>()}});
  }
  found.states = static_cast<std::size_t>(read_index(d.at("states"), 0, found.speeds.size() + 1));
  for (const Json& size : d.at("nominals")) found.nominals.push_back(size.get<double>());
  found.arm = d.at("arm").get<double>();
  if (!found.nominals.empty() && found.nominals.size() != (found.arm == 1.0 ? found.states : found.speeds.empty() ? found.coordinates.size() : found.speeds.size()))
    refuse("its description has a nominal for some states alone");
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
        program_(document, description_.roads.size()), inputs_(program_, document, description_.inputs.size(), description_.discrete()),
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
