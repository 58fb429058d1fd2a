// Functions of a mechanism or system at given states, and the times of the parts of an iteration: programs of tests and measurements.
#pragma once

#include <chrono>

#include "cutjoint/initial_state.hpp"
#include "cutjoint/lagrangian/choose_solver.hpp"
#include "cutjoint/program.hpp"
#include "cutjoint/read_settings.hpp"

namespace cutjoint::examine {

/// A state with the keys t, q, v, vdot and lambda.
template <class Real>
State<Real> read_state(const Json& at) {
  State<Real> state(0, 0, 0);
  state.t = read_number<Real>(at, "t");
  state.q = read_numbers<Real>(at, "q");
  state.v = read_numbers<Real>(at, "v");
  state.vdot = read_numbers<Real>(at, "vdot");
  state.lambda = read_numbers<Real>(at, "lambda");
  return state;
}

/// One evaluation at given t, q, v, lambda: the mechanism as a function, for comparison with other implementations.
template <Mechanism M>
Json evaluate_mechanism(M& mechanism, const Json& at) {
  using Real = typename M::real_type;
  const Description& d = mechanism.description();
  const auto q = read_numbers<Real>(at, "q"), v = read_numbers<Real>(at, "v"), lambda = read_numbers<Real>(at, "lambda");
  std::vector<Real> vdot(d.speeds.size()), dz(vdot), correction(d.equations.size()), residual(correction), rate(correction), columns(d.columns.size());
  mechanism.begin_step(read_number<Real>(at, "t"), Real(1));
  mechanism.evaluate(q.data(), v.data(), lambda.data(), vdot.data(), correction.data());
  mechanism.constraint_residual(q.data(), v.data(), residual.data(), rate.data());
  mechanism.project(q.data(), residual.data(), dz.data());
  mechanism.report(q.data(), v.data(), vdot.data(), lambda.data(), columns.data());
  return Json{{"vdot", vdot}, {"correction", correction}, {"residual", residual}, {"rate", rate}, {"dz", dz}, {"columns", columns}};
}

/// The functions of a system at a state with `penalty`, `weights` and weights `w` of the equations.  Optionally: natural
/// coordinates of `relative` q and v, and the solution for a right-hand side `right` with the row of a failed pivot, else -1.
/// The mechanism is in motion unless `motion` is 0.
template <class S>
Json evaluate_system(S& system, LinearSolver<typename S::real_type>& solver, const Json& at) {
  using Real = typename S::real_type;
  const SystemDescription& d = system.description();
  const State<Real> x = read_state<Real>(at);
  const Json& weights = at.at("weights");
  const Real penalty = read_number<Real>(at, "penalty");
  std::vector<Real> ball_tangents = unit_ball_tangents(system);
  std::vector<Real> f(d.unknowns().size()), phi(d.equations.size()), phid(phi.size()), phidd(phi.size()), tangent(d.pattern.row.size());
  Json result;
  system.begin_step(x.t, at.contains("motion") ? read_number<Real>(at, "motion") : Real(1));
  system.dynamic_residual(x.q.data(), x.v.data(), x.vdot.data(), x.lambda.data(), penalty, f.data(), phi.data());
  result["force_residual"] = f;
  result["residual"] = phi;
  const Weights<Real> by{read_number<Real>(weights, "damping"), read_number<Real>(weights, "stiffness"), read_number<Real>(weights, "constraint"), ball_tangents.data()};
  system.linearise(x.q.data(), x.v.data(), x.vdot.data(), x.lambda.data(), penalty, by, f.data(), phi.data(), tangent.data());
  result["linearised_force_residual"] = f;
  result["linearised_residual"] = phi;
  result["tangent"] = tangent;
  system.constraint_residual(x.q.data(), x.v.data(), x.vdot.data(), phi.data(), phid.data(), phidd.data());
  result["closed_residual"] = phi;
  result["rate"] = phid;
  result["curvature"] = phidd;
  system.apply_jacobian_transposed(x.q.data(), read_numbers<Real>(at, "w").data(), f.data());
  result["force"] = f;
  system.apply_jacobian(x.q.data(), x.vdot.data(), phi.data());
  result["change"] = phi;
  std::vector<Real> columns(d.columns.size());
  system.report(x.q.data(), x.v.data(), x.vdot.data(), x.lambda.data(), columns.data());
  result["columns"] = columns;
  if (at.contains("relative")) {
    const Json& relative = at.at("relative");
    std::vector<Real> q(d.coordinates.size()), v(f.size());
    system.initial_coordinates(read_numbers<Real>(relative, "q").data(), read_numbers<Real>(relative, "v").data(), q.data(), v.data());
    result["placed"] = Json{{"q", q}, {"v", v}};
  }
  if (at.contains("right")) {
    std::vector<Real> right = read_numbers<Real>(at, "right");
    Breakdown broken = solver.factor(tangent.data());
    if (!broken) broken = solver.solve(right.data());
    result["solution"] = right;
    result["breakdown"] = broken.row;
  }
  return result;
}

/// The median over batches of the seconds of a call.
double seconds_of(int batches, int repetitions, auto call) {
  std::vector<double> seconds;
  for (int batch = 0; batch < batches; ++batch) {
    const auto begin = std::chrono::steady_clock::now();
    for (int i = 0; i < repetitions; ++i) call();
    seconds.push_back(std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count() / repetitions);
  }
  const auto middle = seconds.begin() + static_cast<std::ptrdiff_t>(seconds.size() / 2);
  std::nth_element(seconds.begin(), middle, seconds.end());
  return *middle;
}

/// The task "evaluate": the functions at the run file's states.
template <class Subject>
Json evaluate(const Json& file, Subject& subject, const RunSettings& settings) {
  using Real = typename Subject::real_type;
  ModelData<Real> data(subject.description(), file);
  Json results = Json::array();
  if constexpr (Mechanism<Subject>) {
    data.load_mechanism(subject, settings.stabilisation,
                        std::vector<Real>(subject.description().cuts.size(), Real(settings.stabilisation.penalty.value_or(1.0))));
    for (const Json& at : file.at("states")) results.push_back(evaluate_mechanism(subject, at));
  } else {
    data.drive(subject);
    subject.load(data.parameters().data(), data.roads().data());
    const auto solver = choose_solver(subject, *settings.solver);
    for (const Json& at : file.at("states")) results.push_back(evaluate_system(subject, *solver, at));
  }
  return Json{{"results", results}, {"status", "done"}};
}

/// The task "factor": seconds of each part of an iteration alone at the start of the run, which has no accelerations yet: analysis (with its
/// allocation), assembly of residual and tangent, numerical factorisation, and solution of one right-hand side.  The run file may have
/// `repetitions` and `batches`.
template <class M, class S>
Json time_parts(const Json& file, M& mechanism, S& system, const RunSettings& settings) {
  using Real = typename S::real_type;
  const SystemDescription& d = system.description();
  const int batches = file.contains("batches") ? file.at("batches").get<int>() : 9;
  const int repetitions = file.contains("repetitions") ? file.at("repetitions").get<int>() : 100;
  InitialState<M> start(mechanism, settings, file);
  const State<Real> relative(start.in_motion());
  ModelData<Real> data(d, file);
  data.drive(system);
  system.load(data.parameters().data(), data.roads().data());
  std::vector<Real> q(d.coordinates.size()), f(d.unknowns().size()), v(f), vdot(f), phi(d.equations.size()), lambda(phi), tangent(d.pattern.row.size());
  system.begin_step(relative.t, Real(1));
  system.initial_coordinates(relative.q.data(), relative.v.data(), q.data(), v.data());
  std::vector<Real> ball_tangents = unit_ball_tangents(system), right(static_cast<std::size_t>(d.pattern.size));
  const Real half(settings.dt / 2), penalty(d.method == Lagrangian::classical ? 1.0 : settings.penalty.value_or(1e9));
  const Weights<Real> weights{half, half * half, half * half * penalty, ball_tangents.data()};
  const auto solver = choose_solver(system, *settings.solver);
  const auto assemble = [&] { system.linearise(q.data(), v.data(), vdot.data(), lambda.data(), penalty, weights, f.data(), phi.data(), tangent.data()); };
  const auto factor = [&] { return solver->factor(tangent.data()); };
  const auto solve = [&] {
    std::fill(right.begin(), right.end(), weights.stiffness);
    return solver->solve(right.data());
  };
  assemble();
  if (factor() || solve()) throw std::runtime_error("the tangent has no factors to time");
  return Json{{"solver", *settings.solver}, {"size", d.pattern.size}, {"entries", d.pattern.row.size()},
              {"analyse", seconds_of(batches, 1, [&] { return choose_solver(system, *settings.solver); })},
              {"assemble", seconds_of(batches, repetitions, assemble)}, {"factor", seconds_of(batches, repetitions, factor)},
              {"solve", seconds_of(batches, repetitions, solve)}, {"status", "done"}};
}

/// Whether a run file has one of these tasks.
inline bool is_asked(const Json& file) { return file.at("task") == "evaluate" || file.at("task") == "factor"; }

/// The result of one of them; `integrators` are those of the program that would run the file.
template <class M, class Subject>
Json perform(const Json& file, M& start, Subject& subject, bool IntegratorRow::*integrators) {
  Json plain = file;
  plain["task"] = "simulate";
  const RunSettings settings = read_settings(plain, {.integrators = integrators});
  if constexpr (!Mechanism<Subject>)
    if (file.at("task") == "factor") return time_parts(file, start, subject, settings);
  return evaluate(file, subject, settings);
}

template <class Subject>
Json perform(const Json& file, AnyMechanism<double>& start, Subject& subject) {
  return perform(file, start, subject, Mechanism<Subject> ? &IntegratorRow::recursive : &IntegratorRow::lagrangian);
}

/// In place of a driver's `run_main`.
template <class Subject>
int run_main(int argc, char** argv, AnyMechanism<double>& start, Subject& subject) {
  return run_program(argc, argv, "examine", [&](const Json& file) { return perform(file, start, subject); });
}

}  // namespace cutjoint::examine
