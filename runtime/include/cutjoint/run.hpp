// The driver: a run file (JSON) in, a table (CSV) and a summary (JSON) out.
#pragma once

#include <charconv>
#include <chrono>
#include <cmath>
#include <fstream>
#include <iostream>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "cutjoint/mechanism.hpp"
#include "cutjoint/road.hpp"
#include "cutjoint/start.hpp"
#include "cutjoint/state.hpp"
#include "cutjoint/trapezoidal.hpp"

namespace cutjoint {

using Json = nlohmann::ordered_json;

/// A double that JSON can hold: null where it is not finite.
inline Json number_or_null(double x) { return std::isfinite(x) ? Json(x) : Json(nullptr); }

/// Writes rows of numbers, shortest round trip.
class Table {
 public:
  explicit Table(const std::string& path) : out_(path, std::ios::binary) {
    if (!out_) throw std::runtime_error("cannot write " + path);
  }

  void header(const std::vector<Named>& columns) {
    line_ = "t";
    for (const Named& column : columns) line_.append(",").append(column.name);
    end();
  }

  template <class Real>
  void row(Real t, const std::vector<Real>& values) {
    append(static_cast<double>(t));
    for (const Real value : values) {
      line_ += ',';
      append(static_cast<double>(value));
    }
    end();
  }

 private:
  void append(double value) {
    char text[32];
    line_.append(text, std::to_chars(text, text + sizeof text, value + 0.0).ptr);
  }

  void end() {
    line_ += '\n';
    out_ << line_;
    line_.clear();
  }

  std::ofstream out_;
  std::string line_;
};

/// Runs one mechanism as a run file asks.
template <Mechanism M>
class Run {
 public:
  using Real = typename M::real_type;

  Run(M& mechanism, Json file) : mechanism_(mechanism), d_(mechanism.description()), file_(std::move(file)), state_(d_) {
    for (const auto& name : d_.roads) roads_.push_back(read_road(name));
    for (const Named& p : d_.parameters) parameters_.push_back(Real(file_.at("parameters").at(std::string(p.name)).template get<double>()));
    const Json& numerics = file_.at("numerics");
    stabilisation_ = {Real(numerics.at("penalty").template get<double>()), Real(numerics.at("damping_ratio").template get<double>()),
                      Real(numerics.at("frequency").template get<double>())};
    mechanism_.load(parameters_.data(), stabilisation_, roads_.data());
  }

  /// Do the run's task and return its summary; a Failure ends in the summary, what was computed stays in the table.
  Json perform() {
    Json summary;
    try {
      const std::string task = file_.at("task");
      if (task == "evaluate") return evaluate();
      start();
      if (task == "equilibrium") summary = columns();
      else summary = simulate();
      summary["status"] = "done";
    } catch (const Failure& failure) {
      summary = counts();
      summary["status"] = "failed";
      summary["message"] = failure.what();
      summary["time"] = number_or_null(failure.time);
      summary["step"] = failure.step;
      summary["element"] = failure.element;
      summary["residual"] = number_or_null(failure.residual);
      summary["advice"] = failure.advice;
    }
    return summary;
  }

 private:
  Road<Real> read_road(std::string_view name) const {
    const Json& road = file_.at("roads").at(std::string(name));
    return Road<Real>(read_pieces(road.at("left")), read_pieces(road.at("right")), road.at("disc").template get<bool>());
  }

  static std::vector<Piece<Real>> read_pieces(const Json& list) {
    std::vector<Piece<Real>> pieces;
    for (const Json& p : list) {
      const std::string kind = p.at("kind");
      pieces.push_back({kind == "arc" ? PieceKind::arc : kind == "cosine" ? PieceKind::cosine : PieceKind::line,
                        Real(p.at("begin").template get<double>()), Real(p.at("a").template get<double>()), Real(p.at("b").template get<double>()),
                        Real(p.at("c").template get<double>())});
    }
    return pieces;
  }

  /// Values by name into an array; true where one was given.
  std::vector<bool> assign(const char* key, const std::vector<std::string_view>& names, std::vector<Real>& values) const {
    std::vector<bool> given(names.size(), false);
    for (std::size_t i = 0; i < names.size(); ++i) {
      const auto found = file_.at(key).find(std::string(names[i]));
      if (found == file_.at(key).end()) continue;
      values[i] = Real(found->template get<double>());
      given[i] = true;
    }
    return given;
  }

  /// Which speeds belong to given coordinates.
  std::vector<bool> speeds_of(const std::vector<bool>& coordinates) const {
    std::vector<bool> speeds(d_.speeds.size(), false);
    for (const Chart& chart : d_.charts)
      for (int i = 0; i < chart.scalars; ++i)
        speeds[static_cast<std::size_t>(chart.v + i)] = coordinates[static_cast<std::size_t>(chart.q + i)];
    return speeds;
  }

  void start() {
    Starter<M> starter(mechanism_);
    const std::vector<bool> placed = speeds_of(assign("positions", d_.coordinates, state_.q));
    starter.assemble(state_, placed, Real(0));
    if (file_.at("pose") == "equilibrium") starter.equilibrate(state_, placed);
    starter.assemble(state_, placed, Real(0));
    if (file_.at("task") == "equilibrium") {
      starter.accelerate(state_, Real(0));
      return;
    }
    const std::vector<bool> moving = assign("rates", d_.speeds, state_.v);
    starter.make_consistent(state_, moving, Real(1));
    for (const std::string_view name : starter.undetermined(state_, moving)) undetermined_.push_back(std::string(name));
    starter.accelerate(state_, Real(1));
    starter.require_finite(state_);
  }

  Json columns() {
    std::vector<Real> values(d_.columns.size());
    mechanism_.report(state_.q.data(), state_.v.data(), state_.vdot.data(), state_.lambda.data(), values.data());
    Json table = Json::object();
    for (std::size_t i = 0; i < values.size(); ++i) table[std::string(d_.columns[i].name)] = number_or_null(static_cast<double>(values[i]));
    return Json{{"columns", table}};
  }

  /// One evaluation at given q, v, lambda: the generated code as a function, for comparison with other implementations.
  Json evaluate() {
    Json results = Json::array();
    for (const Json& at : file_.at("states")) {
      state_.q = at.at("q").template get<std::vector<Real>>();
      state_.v = at.at("v").template get<std::vector<Real>>();
      state_.lambda = at.at("lambda").template get<std::vector<Real>>();
      std::vector<Real> correction(d_.equations.size()), residual(d_.equations.size()), rate(d_.equations.size()), values(d_.columns.size());
      mechanism_.begin_step(Real(at.at("t").template get<double>()), Real(1));
      mechanism_.evaluate(state_.q.data(), state_.v.data(), state_.lambda.data(), state_.vdot.data(), correction.data());
      mechanism_.close(state_.q.data(), state_.v.data(), residual.data(), rate.data());
      mechanism_.report(state_.q.data(), state_.v.data(), state_.vdot.data(), state_.lambda.data(), values.data());
      results.push_back(Json{{"vdot", state_.vdot}, {"correction", correction}, {"residual", residual}, {"rate", rate}, {"columns", values}});
    }
    return Json{{"status", "done"}, {"results", results}};
  }

  Json simulate() {
    const Json& numerics = file_.at("numerics");
    const double dt = numerics.at("dt"), end = file_.at("end"), every = file_.at("output_step");
    const FixedPoint fixed_point{numerics.at("tolerance").template get<double>(), numerics.at("iterations").template get<int>(),
                                 numerics.at("multiplier_updates").template get<int>()};
    Trapezoidal<M> integrator(mechanism_, Real(dt), fixed_point);
    Table table(file_.at("out"));
    table.header(d_.columns);
    const long steps = std::lround(std::ceil(end / dt - 1e-9)), stride = std::max(1L, std::lround(every / dt));
    std::vector<Real> values(d_.columns.size());
    const auto write = [&] {
      mechanism_.report(state_.q.data(), state_.v.data(), state_.vdot.data(), state_.lambda.data(), values.data());
      table.row(state_.t, values);
    };
    write();
    const Real origin = state_.t;
    double seconds = 0.0;
    for (long first = 0; first < steps; first += stride) {
      const long last = std::min(first + stride, steps);
      const auto begin = std::chrono::steady_clock::now();
      try {
        for (long n = first; n < last; ++n) {
          count(n, integrator.evaluations(), seconds);
          integrator.step(state_, n + 1);
          state_.t = origin + Real(n + 1) * Real(dt);
        }
      } catch (const Failure&) {
        if (steps_ > first) write();  // the last state that converged
        throw;
      }
      seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
      count(last, integrator.evaluations(), seconds);
      write();
      progress(last, steps);
    }
    return counts();
  }

  Json counts() const { return Json{{"steps", steps_}, {"evaluations", evaluations_}, {"seconds", seconds_}, {"undetermined", undetermined_}}; }

  void count(long steps, long evaluations, double seconds) {
    steps_ = steps;
    evaluations_ = evaluations;
    seconds_ = seconds;
  }

  /// A line of JSON on standard output each twentieth of the run, for whoever watches.
  void progress(long step, long steps) {
    const long mark = 20 * step / steps;
    if (mark == mark_) return;
    mark_ = mark;
    std::cout << Json{{"progress", static_cast<double>(step) / static_cast<double>(steps)}} << std::endl;
  }

  M& mechanism_;
  const Description& d_;
  Json file_;
  State<Real> state_;
  std::vector<Road<Real>> roads_;
  std::vector<Real> parameters_;
  Stabilisation<Real> stabilisation_;
  long steps_ = 0, evaluations_ = 0, mark_ = -1;
  double seconds_ = 0.0;
  std::vector<std::string> undetermined_;
};

/// A JSON file's content.
inline Json read_json(const std::string& path) {
  std::ifstream in(path);
  if (!in) throw std::runtime_error("cannot read " + path);
  return Json::parse(in);
}

/// Print a summary; the exit status that goes with it.
inline int conclude(const Json& summary) {
  std::cout << summary << std::endl;
  return summary.at("status") == "done" ? 0 : 1;
}

}  // namespace cutjoint
