// Projects disturbed states of a generated mechanism; prints for each of positions and speeds iterations and gap before and after, then
// the share of the change of the speeds that is no answer to multipliers.
#include "cutjoint/core/constraints/projection.hpp"

#include <Eigen/Dense>
#include <cstdio>
#include <cstdlib>
#include <utility>
#include <vector>

#include "cutjoint/core/roads/road.hpp"
#include "cutjoint/core/start/start.hpp"
#include "cutjoint/state.hpp"
#include "cutjoint/generated.hpp"
#include MECHANISM_HEADER

namespace cutjoint::generated {
const Description& description();
}

using Mechanism = cutjoint::GeneratedMechanism<cutjoint::generated::MECHANISM<double>>;
using State = cutjoint::State<double>;
using Vector = Eigen::VectorXd;

namespace {

double largest(const Vector& x) { return x.size() ? x.cwiseAbs().maxCoeff() : 0.0; }

/// The residual of the loops and its rate.
std::pair<Vector, Vector> closure(const Mechanism& mechanism, const State& state) {
  Vector residual(static_cast<Eigen::Index>(state.lambda.size())), rate(residual);
  mechanism.constraint_residual(state.q.data(), state.v.data(), residual.data(), rate.data());
  return {residual, rate};
}

/// What accelerations answer to a multiplier of the size of the penalty on each equation, by columns: those that move the masses least.
Eigen::MatrixXd answers(Mechanism& mechanism, const State& state, std::size_t equations, double penalty) {
  std::vector<double> still(state.v.size(), 0.0), lambda(equations, 0.0), vdot(state.v.size()), correction(equations);
  mechanism.evaluate(state.q.data(), still.data(), lambda.data(), vdot.data(), correction.data());
  const Vector rest = Eigen::Map<Vector>(vdot.data(), static_cast<Eigen::Index>(vdot.size()));
  Eigen::MatrixXd result(rest.size(), static_cast<Eigen::Index>(equations));
  for (std::size_t i = 0; i < equations; ++i) {
    lambda[i] = penalty;
    mechanism.evaluate(state.q.data(), still.data(), lambda.data(), vdot.data(), correction.data());
    result.col(static_cast<Eigen::Index>(i)) = Eigen::Map<Vector>(vdot.data(), rest.size()) - rest;
    lambda[i] = 0.0;
  }
  return result;
}

/// The share of a change that is no answer to multipliers.
double stray(const Eigen::MatrixXd& answers, const Vector& change) {
  Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> solver;
  solver.setThreshold(1e-9);
  solver.compute(answers);
  return (answers * solver.solve(change) - change).norm() / change.norm();
}

}  // namespace

int main(int, char** argv) {
  Mechanism mechanism(cutjoint::generated::description());
  const cutjoint::Description& d = mechanism.description();
  std::vector<double> parameters;
  for (const auto& p : d.parameters) parameters.push_back(p.value);
  const std::vector<cutjoint::Road<double>> roads(d.roads.size());
  const double penalty = std::atof(argv[1]);
  mechanism.load(parameters.data(), {penalty, 1.0, 10.0}, roads.data());
  mechanism.begin_step(0.0, 1.0);
  State state(d);
  cutjoint::Starter<Mechanism> starter(mechanism);
  if (starter.assemble(state, std::vector<unsigned char>(state.v.size()), 1.0)) return 1;
  std::srand(1);
  const auto disturb = [](double size) { return size * (2.0 * std::rand() / RAND_MAX - 1.0); };
  std::vector<double> step(state.v.size());
  for (double& x : step) x = disturb(1e-3);
  const State closed = state;
  cutjoint::retract<double>(d.charts, closed.q.data(), step.data(), state.q.data());
  for (double& v : state.v) v = disturb(1.0);
  cutjoint::Projection<Mechanism> projection(mechanism);

  const double violation = largest(closure(mechanism, state).first);
  if (projection.positions(state)) return 1;
  std::printf("%d %.17g %.17g ", projection.iterations(), violation, largest(closure(mechanism, state).first));
  const State before = state;
  const double rate = largest(closure(mechanism, state).second);
  if (projection.velocities(state)) return 1;
  const Vector change = Eigen::Map<Vector>(state.v.data(), static_cast<Eigen::Index>(state.v.size())) -
                        Eigen::Map<const Vector>(before.v.data(), static_cast<Eigen::Index>(state.v.size()));
  std::printf("%d %.17g %.17g %.17g\n", projection.iterations(), rate, largest(closure(mechanism, state).second), stray(answers(mechanism, state, d.equations.size(), penalty), change));
}
