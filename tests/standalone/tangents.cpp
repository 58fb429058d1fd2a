// The tangent of a folder's system beside differences of its balance in 113 bits, at the state after some steps, displaced.  Prints the numbers of rows, of
// unknowns and of equations, then the tangent's lower and upper half, the differences and the Jacobian of loops, by rows.  Argument: how many steps.
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <span>
#include <vector>

#include "quads.hpp"

using Reference = InQuad<code::System>::type;
using Numbers = std::vector<Quad>;

constexpr int n = Reference::sizes.speeds, m = Reference::sizes.equations, given = 3 * Reference::sizes.inputs + Reference::sizes.discrete;
static const std::span<const core::Chart> charts = Reference::charts;
constexpr double damping = 0.3, stiffness = 0.2;

static double memory[COUNT(SIZE) / sizeof(double)], inputs[given + 1];

static void fill(void*, Quad, Quad* input) {
  for (int i = 0; i < given; ++i) input[i] = inputs[i];
}

static Numbers displaced(const Numbers& q, const Numbers& delta) {
  Numbers pose(q.size());
  if (charts.empty())
    for (std::size_t i = 0; i < q.size(); ++i) pose[i] = q[i] + delta[i];
  else
    core::retract<Quad>(charts, q.data(), delta.data(), pose.data());
  return pose;
}

template <class Subject>
void drive(Subject& subject) {
  if constexpr (given > 0) subject.drive_by({&fill, nullptr});
}

int main(int, char** arguments) {
  auto* sim = OF(create)(memory, sizeof memory);
  int status = OF(start)(sim);
  if (!status) status = OF(run)(sim, std::atol(arguments[1]), nullptr);
  if (status) return std::printf("%s\n", OF(status_text)(status)), 1;
  const auto& state = sim->sim.complete_state();
  for (int i = 0; i < given; ++i) inputs[i] = 0.3 + std::sin(1.0 + i);

  Reference system;
  Numbers parameters, delta(n), v(state.v.begin(), state.v.end()), vdot(state.vdot.begin(), state.vdot.end()), lambda(m);
  for (std::size_t i = 0; i < COUNT(PARAMETERS); ++i) parameters.push_back(sim->sim.parameters()[i]);
  static const core::Road<Quad> roads[Reference::sizes.roads + 1];
  system.load(parameters.data(), roads);
  drive(system);
  system.begin_step(Quad(sim->sim.state().t), Quad(1));
  const Numbers q(state.q.begin(), state.q.end());
  for (int i = 0; i < n; ++i) delta[i] = 0.1 * std::cos(1.0 + i), v[i] += 0.2 * std::sin(1.0 + i);
  for (int i = 0; i < m; ++i) lambda[i] = charts.empty() ? Quad(0) : Quad(state.lambda[i]);

  const auto pose = displaced(q, delta);
  Numbers ball_tangents(core::size_of_ball_tangents(charts) + 1), f(n), phi(m), entries(Reference::pattern.row.size());
  core::ball_tangents<Quad>(charts, delta.data(), ball_tangents.data());
  system.linearise(pose.data(), v.data(), vdot.data(), lambda.data(), Quad(0), {Quad(damping), Quad(stiffness), Quad(1), ball_tangents.data()}, f.data(), phi.data(),
                   entries.data());
  const int rows = Reference::pattern.size;
  std::vector<double> tangent(rows * rows), differences(n * n), jacobian(m * n);
  for (int j = 0; j < rows; ++j)
    for (int k = Reference::pattern.first[j]; k < Reference::pattern.first[j + 1]; ++k) {
      const int i = Reference::pattern.row[k];
      tangent[i * rows + j] = static_cast<double>(entries[k]);
      if (Reference::pattern.symmetric) tangent[j * rows + i] = tangent[i * rows + j];
    }

  const Quad h(1e-14);
  for (int j = 0; j < n; ++j) {
    Numbers by[2] = {Numbers(n), Numbers(n)};
    for (int side = 0; side < 2; ++side) {
      Numbers there = delta, faster = v, later = vdot;
      const Quad x = side ? h : -h;
      there[j] += Quad(stiffness) * x, faster[j] += Quad(damping) * x, later[j] += x;
      const Numbers at = displaced(q, there);
      system.dynamic_residual(at.data(), faster.data(), later.data(), lambda.data(), Quad(0), by[side].data(), phi.data());
    }
    for (int i = 0; i < n; ++i) differences[i * n + j] = static_cast<double>((by[1][i] - by[0][i]) / (2 * h));
  }
  for (int i = 0; i < m; ++i) {
    Numbers unit(m), force(n);
    unit[i] = 1;
    system.apply_jacobian_transposed(pose.data(), unit.data(), force.data());
    for (int j = 0; j < n; ++j) jacobian[i * n + j] = static_cast<double>(force[j]);
  }
  std::printf("%d %d %d ", rows, n, m);
  for (const auto* matrix : {&tangent, &differences, &jacobian})
    for (const double x : *matrix) std::printf("%.17g ", x);
}
