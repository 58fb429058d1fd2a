// Evaluation of a mechanism for tests: its functions at given states, and the Jacobians of its accelerations.
#pragma once

#include "cutjoint/core/mechanism/retraction.hpp"
#include "cutjoint/run_file.hpp"

namespace cutjoint {

/// One evaluation at given t, q, v, lambda: the mechanism as a function, for comparison with other implementations.
template <Mechanism M>
Json evaluate_mechanism(M& mechanism, const Json& at) {
  using Real = typename M::real_type;
  const Description& d = mechanism.description();
  const auto q = read_array<Real>(at, "q"), v = read_array<Real>(at, "v"), lambda = read_array<Real>(at, "lambda");
  std::vector<Real> vdot(d.speeds.size()), dz(vdot), correction(d.equations.size()), residual(correction), rate(correction), columns(d.columns.size());
  mechanism.begin_step(read_number<Real>(at, "t"), Real(1));
  mechanism.evaluate(q.data(), v.data(), lambda.data(), vdot.data(), correction.data());
  mechanism.constraint_residual(q.data(), v.data(), residual.data(), rate.data());
  mechanism.project(q.data(), residual.data(), dz.data());
  mechanism.report(q.data(), v.data(), vdot.data(), lambda.data(), columns.data());
  return Json{{"vdot", vdot}, {"correction", correction}, {"residual", residual}, {"rate", rate}, {"dz", dz}, {"columns", columns}};
}

/// The Jacobians of the accelerations with respect to coordinates (increments of `retract`) and velocities at a state, by columns, by central
/// differences of `evaluate` with constant multipliers.
template <Mechanism M>
Json differentiate(M& mechanism, const State<typename M::real_type>& state) {
  using Real = typename M::real_type;
  const std::size_t n = state.v.size();
  const Real h(1e-5);
  std::vector<Real> stiffness, damping, delta(n), forward(n), backward(n), correction(state.lambda.size());
  State<Real> probe = state;
  const auto evaluate_at = [&](std::vector<Real>& vdot) {
    mechanism.evaluate(probe.q.data(), probe.v.data(), state.lambda.data(), vdot.data(), correction.data());
  };
  const auto append = [&](std::vector<Real>& columns) {
    for (std::size_t i = 0; i < n; ++i) columns.push_back((forward[i] - backward[i]) / (2 * h));
  };
  for (std::size_t j = 0; j < n; ++j) {
    for (const Real move : {h, -h}) {
      delta[j] = move;
      retract<Real>(mechanism.description().charts, state.q.data(), delta.data(), probe.q.data());
      evaluate_at(move > Real(0) ? forward : backward);
    }
    delta[j] = Real(0);
    append(stiffness);
  }
  probe.q = state.q;
  for (std::size_t j = 0; j < n; ++j) {
    for (const Real move : {h, -h}) {
      probe.v[j] = state.v[j] + move;
      evaluate_at(move > Real(0) ? forward : backward);
    }
    probe.v[j] = state.v[j];
    append(damping);
  }
  return Json{{"t", state.t}, {"stiffness", stiffness}, {"damping", damping}};
}

}  // namespace cutjoint
