// Evaluation of a system for tests: its functions at given states, and the times of the parts of an iteration.
#pragma once

#include <chrono>

#include "cutjoint/lagrangian/choose_solver.hpp"
#include "cutjoint/run_file.hpp"

namespace cutjoint {

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
  system.apply_jacobian_transposed(x.q.data(), read_array<Real>(at, "w").data(), f.data());
  result["force"] = f;
  system.apply_jacobian(x.q.data(), x.vdot.data(), phi.data());
  result["change"] = phi;
  std::vector<Real> columns(d.columns.size());
  system.report(x.q.data(), x.v.data(), x.vdot.data(), x.lambda.data(), columns.data());
  result["columns"] = columns;
  if (at.contains("relative")) {
    const Json& relative = at.at("relative");
    std::vector<Real> q(d.coordinates.size()), v(f.size());
    system.initial_coordinates(read_array<Real>(relative, "q").data(), read_array<Real>(relative, "v").data(), q.data(), v.data());
    result["placed"] = Json{{"q", q}, {"v", v}};
  }
  if (at.contains("right")) {
    std::vector<Real> right = read_array<Real>(at, "right");
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

/// Seconds of each part of an iteration alone: analysis (with its allocation), assembly of residual and tangent, numerical
/// factorisation, and solution of one right-hand side.  The run file may have `repetitions` and `batches`.
template <class S>
Json time_parts(S& system, std::string_view name, const State<typename S::real_type>& x, const Weights<typename S::real_type>& weights,
                typename S::real_type penalty, const Json& file) {
  using Real = typename S::real_type;
  const SystemDescription& d = system.description();
  const int batches = file.contains("batches") ? read_integer(file, "batches", 1) : 9;
  const int repetitions = file.contains("repetitions") ? read_integer(file, "repetitions", 1) : 100;
  const auto solver = choose_solver(system, name);
  std::vector<Real> f(d.unknowns().size()), phi(d.equations.size()), tangent(d.pattern.row.size());
  std::vector<Real> right(static_cast<std::size_t>(d.pattern.size));
  const auto assemble = [&] {
    system.linearise(x.q.data(), x.v.data(), x.vdot.data(), x.lambda.data(), penalty, weights, f.data(), phi.data(), tangent.data());
  };
  const auto factor = [&] { return solver->factor(tangent.data()); };
  const auto solve = [&] {
    std::fill(right.begin(), right.end(), weights.stiffness);
    return solver->solve(right.data());
  };
  system.begin_step(x.t, Real(1));
  assemble();
  if (factor() || solve()) throw std::runtime_error("the tangent has no factors to time");
  return Json{{"solver", name}, {"size", d.pattern.size}, {"entries", d.pattern.row.size()},
              {"analyse", seconds_of(batches, 1, [&] { return choose_solver(system, name); })}, {"assemble", seconds_of(batches, repetitions, assemble)},
              {"factor", seconds_of(batches, repetitions, factor)}, {"solve", seconds_of(batches, repetitions, solve)}};
}

}  // namespace cutjoint
