// Derivatives of a folder's interface beside differences of its equations in 113 bits; prints the largest errors of A, B, C, D and of derivatives and
// outputs along a direction, which has rates of inputs too, as shares of the largest entries; then those of a step's derivatives by states, inputs and parameters, beside
// differences of the integrator in 113 bits.  Arguments: the difference, how many steps are taken first, then speeds that are independent, unless the folder chooses.
// With `*100` in place of steps the errors are the largest of a hundred states behind steps at random, of parameters at random near those of the scene.
#include <cstdio>
#include <cstdlib>
#include <cmath>
#include <random>

#include <vector>

#include "quads.hpp"

using Reference = InQuad<code::Mechanism>::type;

/// A step by the trapezoidal rule, or by the explicit method of a folder.
template <class Steps>
struct StepInQuad {
  static core::Fault go(Reference& mechanism, const core::SimulationSettings& settings, core::StateOf<Reference>& state, Quad h) {
    return core::Trapezoidal<Reference>(mechanism, h, settings.fixed_point).step(state, 1);
  }
};
template <template <class, class> class Steps, class Mechanism, class Method>
struct StepInQuad<Steps<Mechanism, Method>> {
  static core::Fault go(Reference& mechanism, const core::SimulationSettings& settings, core::StateOf<Reference>& state, Quad h) {
    Steps<Reference, Method> steps(mechanism, settings, nullptr);
    steps.begin(state);
    return steps.step(state, settings, h, state.t + h, 1);
  }
};
using Numbers = std::vector<Quad>;

constexpr int n = COUNT(SPEEDS), m = COUNT(EQUATIONS), f = COUNT(FREEDOMS), states = COUNT(STATES), inputs = COUNT(INPUTS), outputs = COUNT(OUTPUTS);
constexpr int joints = n - (states - 2 * f);            ///< speeds of joints; first-order states are behind them
constexpr int given = 3 * inputs + Reference::sizes.held;  ///< numbers of inputs, and what controllers hold

struct Motion {
  Reference mechanism;
  Quad t, h = 1;  ///< the present time, and the length of a step
  Numbers u = Numbers(given + 1), later[2] = {u, u}, q, v = Numbers(n), vdot = Numbers(n), reference, delta = Numbers(n), lambda, guess;
  std::vector<int> independent, dependent;

  /// Inputs of the present time, or of the middle or the end of a step.
  static void fill(void* self, Quad time, Quad* input) {
    const Motion& x = *static_cast<Motion*>(self);
    const Quad share = (time - x.t) / x.h;
    for (int i = 0; i < given; ++i) input[i] = share < Quad(0.25) ? x.u[i] : x.later[share > Quad(0.75)][i];
  }

  std::vector<Quad> residual(const Numbers& v, bool rates) {
    Numbers phi(m), phid(m);
    mechanism.constraint_residual(q.data(), v.data(), phi.data(), phid.data());
    return rates ? phid : phi;
  }

  Numbers speeds(const Numbers& rate) {
    Numbers v(n);
    core::chart_speeds<Quad>(Reference::charts, delta.data(), rate.data(), v.data());
    return v;
  }

  /// The least squares of J_d x = b by the normal equations and Gauss's elimination.
  Numbers solve(const Numbers& b) {
    const int k = static_cast<int>(dependent.size());
    std::vector<Numbers> J;
    const Numbers still = residual(Numbers(n), true);
    for (int j : dependent) {
      Numbers unit(n);
      unit[j] = 1;
      Numbers column = residual(speeds(unit), true);
      for (int i = 0; i < m; ++i) column[i] -= still[i];
      J.push_back(column);
    }
    std::vector<Numbers> A(k, Numbers(k + 1));
    for (int i = 0; i < k; ++i) {
      for (int j = 0; j < k; ++j)
        for (int l = 0; l < m; ++l) A[i][j] += J[i][l] * J[j][l];
      for (int l = 0; l < m; ++l) A[i][k] += J[i][l] * b[l];
    }
    for (int c = 0; c < k; ++c) {
      int best = c;
      for (int i = c + 1; i < k; ++i)
        if (abs(A[i][c]) > abs(A[best][c])) best = i;
      std::swap(A[c], A[best]);
      for (int i = c + 1; i < k; ++i) {
        const Quad share = A[i][c] / A[c][c];
        for (int j = c; j <= k; ++j) A[i][j] -= share * A[c][j];
      }
    }
    Numbers x(k);
    for (int i = k; i-- > 0;) {
      x[i] = A[i][k];
      for (int j = i + 1; j < k; ++j) x[i] -= A[i][j] * x[j];
      x[i] /= A[i][i];
    }
    return x;
  }

  /// x' and y of x and inputs.
  Numbers derive(const Numbers& x) {
    mechanism.begin_step(t, Quad(1));
    delta = guess;
    for (int i = 0; i < f; ++i) delta[independent[i]] = x[i];
    for (int iteration = 0; iteration < 12; ++iteration) {
      core::retract<Quad>(Reference::charts, reference.data(), delta.data(), q.data());
      if (dependent.empty()) break;
      const Numbers step = solve(residual(Numbers(n), false));
      for (std::size_t i = 0; i < step.size(); ++i) delta[dependent[i]] -= step[i];
    }
    core::retract<Quad>(Reference::charts, reference.data(), delta.data(), q.data());
    Numbers rate(n), correction(m), second(n), result(states + outputs);
    for (int i = 0; i < f; ++i) rate[independent[i]] = x[f + i];
    if (!dependent.empty()) {
      const Numbers step = solve(residual(speeds(rate), true));
      for (std::size_t i = 0; i < step.size(); ++i) rate[dependent[i]] -= step[i];
    }
    v = speeds(rate);
    for (int i = 2 * f; i < states; ++i) v[joints - 2 * f + i] = x[i];
    for (int iteration = 0; iteration < (m > 0 ? 400 : 1); ++iteration) {
      mechanism.evaluate(q.data(), v.data(), lambda.data(), vdot.data(), correction.data());
      for (int i = 0; i < m; ++i) lambda[i] += correction[i];
    }
    core::chart_accelerations<Quad>(Reference::charts, delta.data(), v.data(), vdot.data(), second.data());
    for (int i = 0; i < f; ++i) result[i] = rate[independent[i]], result[f + i] = second[independent[i]];
    for (int i = 2 * f; i < states; ++i) result[i] = vdot[joints - 2 * f + i];
    mechanism.report(q.data(), v.data(), vdot.data(), lambda.data(), result.data() + states);
    return result;
  }

  /// x at the end of a step from x.
  Numbers step(const Numbers& x, core::SimulationSettings settings) {
    derive(x);
    settings.fixed_point.tolerance = 1e-28;
    settings.fixed_point.iterations = settings.fixed_point.multiplier_updates = 1000;
    core::StateOf<Reference> state(q.size(), n, m);
    state.t = t;
    std::copy(q.begin(), q.end(), state.q.begin());
    std::copy(v.begin(), v.end(), state.v.begin());
    std::copy(vdot.begin(), vdot.end(), state.vdot.begin());
    std::copy_n(lambda.begin(), m, state.lambda.begin());
    if (StepInQuad<code::Sim::Steps>::go(mechanism, settings, state, h)) std::printf("the step fails ");
    Numbers end(n), rate(n), result(states);
    core::displacement<Quad>(Reference::charts, reference.data(), state.q.data(), end.data());
    core::chart_rates<Quad>(Reference::charts, end.data(), state.v.data(), rate.data());
    for (int i = 0; i < f; ++i) result[i] = end[independent[i]], result[f + i] = rate[independent[i]];
    for (int i = 2 * f; i < states; ++i) result[i] = state.v[joints - 2 * f + i];
    return result;
  }
};

static double memory[COUNT(SIZE) / sizeof(double)];

static double errors[10];
static int printed = 0;

/// The error as a share of the largest entry, the largest until now.
static void print_error(const std::vector<double>& found, const std::vector<double>& exact) {
  double error = 0.0, size = 0.0;
  for (std::size_t i = 0; i < found.size(); ++i) {
    error = std::isfinite(found[i]) ? std::fmax(error, std::fabs(found[i] - exact[i])) : INFINITY;
    size = std::fmax(size, std::fabs(exact[i]));
  }
  double& largest = errors[printed++ % 10];
  largest = std::fmax(largest, error > 0.0 ? error / std::fmax(size, 1e-300) : 0.0);
}

/// Inputs and what controllers hold, of the present time.
template <class Sim, class Driven>
void take_inputs(Sim& sim, Driven& motion) {
  if constexpr (given > 0) {
    sim.starter();
    std::copy_n(sim.mechanism().last_inputs(), given, motion.u.begin());
    motion.mechanism.drive_by({&Driven::fill, &motion});
  }
}

/// The same of the middle and the end of a step.
template <class Sim, class Driven>
void take_later_inputs(Sim& sim, Driven& motion) {
  if constexpr (given > 0)
    for (int i = 0; i < 2; ++i) {
      sim.mechanism().begin_step(sim.state().t + (i + 1) * sim.settings().dt / 2, 1.0);
      std::copy_n(sim.mechanism().last_inputs(), given, motion.later[i].begin());
    }
}

/// At a state behind so many steps.
template <class Sim>
int compare(Sim* sim, const Quad& h, long steps, const std::vector<int>& chosen) {
  int status = OF(start)(sim);
  if (!status) status = OF(play)(sim, steps, nullptr);
  if (!status) status = chosen.empty() ? OF(choose)(sim) : OF(choose_speeds)(sim, chosen.data());
  std::vector<double> A(states * states), B(states * inputs), C(outputs * states), D(outputs * inputs), x(states + 1);
  if (!status) status = OF(linearise)(sim, A.data(), B.data(), C.data(), D.data());
  if (!status) status = OF(get_minimal)(sim, x.data());
  if (status) return std::printf("%s\n", OF(status_text)(status)), 1;

  Motion motion;
  const auto& choice = sim->minimal.choice();
  Numbers parameters, penalties;
  for (std::size_t i = 0; i < COUNT(PARAMETERS); ++i) parameters.push_back(sim->sim.parameters()[i]);
  for (const double penalty : sim->sim.penalties()) penalties.push_back(penalty);
  static const core::Road<Quad> roads[Reference::sizes.roads + 1];
  core::load_mechanism(motion.mechanism, parameters.data(), roads, sim->sim.stabilisation(), penalties);
  take_inputs(sim->sim, motion);
  motion.t = sim->sim.state().t;
  motion.q.assign(sim->sim.state().q.begin(), sim->sim.state().q.end());
  motion.reference.assign(choice.reference.begin(), choice.reference.end());
  motion.lambda.assign(m, Quad(0));
  std::vector<double> delta(n + 1);
  core::displacement<double>(Reference::charts, choice.reference.data(), sim->sim.state().q.data(), delta.data());
  motion.guess.assign(delta.begin(), delta.begin() + n);
  for (int i = 0; i < joints; ++i) (choice.independent[static_cast<std::size_t>(i)] ? motion.independent : motion.dependent).push_back(i);

  std::vector<double> exact_A(A.size()), exact_B(B.size()), exact_C(C.size()), exact_D(D.size());
  for (int j = 0; j < states + inputs; ++j) {
    Numbers at(x.begin(), x.begin() + states), by[2];
    Quad& changed = j < states ? at[j] : motion.u[3 * (j - states)];
    const Quad was = changed;
    for (int side = 0; side < 2; ++side) {
      changed = was + (side ? h : -h);
      by[side] = motion.derive(at);
    }
    changed = was;
    const int width = j < states ? states : inputs, column = j < states ? j : j - states;
    for (int i = 0; i < states + outputs; ++i) {
      const double slope = static_cast<double>((by[1][i] - by[0][i]) / (2 * h));
      if (i < states) (j < states ? exact_A : exact_B)[i * width + column] = slope;
      else (j < states ? exact_C : exact_D)[(i - states) * width + column] = slope;
    }
  }
  std::vector<double> dx(states + 1), du(3 * inputs + 1), dxdot(states + 1), dy(outputs + 1), exact_dxdot(states + 1), exact_dy(outputs + 1);
  for (int i = 0; i < states; ++i) dx[i] = std::cos(1.0 + i);
  for (int i = 0; i < 3 * inputs; ++i) du[i] = std::sin(2.0 + i);
  if ((status = OF(directional)(sim, dx.data(), du.data(), dxdot.data(), dy.data()))) return std::printf("%s\n", OF(status_text)(status)), 1;
  Numbers by[2];
  const Numbers u = motion.u;
  for (int side = 0; side < 2; ++side) {
    Numbers at(x.begin(), x.begin() + states);
    for (int i = 0; i < states; ++i) at[i] += (side ? h : -h) * Quad(dx[i]);
    for (int i = 0; i < 3 * inputs; ++i) motion.u[i] = u[i] + (side ? h : -h) * Quad(du[i]);
    by[side] = motion.derive(at);
  }
  for (int i = 0; i < states + outputs; ++i)
    (i < states ? exact_dxdot[i] : exact_dy[i - states]) = static_cast<double>((by[1][i] - by[0][i]) / (2 * h));
  print_error(dxdot, exact_dxdot), print_error(dy, exact_dy);
  print_error(A, exact_A), print_error(B, exact_B), print_error(C, exact_C), print_error(D, exact_D);

  motion.u = u;
  motion.h = Quad(sim->sim.settings().dt);
  take_later_inputs(sim->sim, motion);
  Numbers moved(x.begin(), x.begin() + states);
  const Numbers first = motion.step(moved, sim->sim.settings());
  const int p = COUNT(PARAMETERS);
  std::vector<double> X(states * states), U(states * inputs), P(states * p), exact_X(X.size()), exact_U(U.size()), exact_P(P.size());
  sim->sim.settings().fixed_point.tolerance = 1e-11;  // as the other step: a derivative has the errors of what it is of
  const std::vector<double> q(sim->sim.state().q.begin(), sim->sim.state().q.end()), v(sim->sim.state().v.begin(), sim->sim.state().v.end());
  if (!status) status = OF(set_state)(sim, OF(time)(sim), q.data(), v.data());
  if ((status = OF(step_derivative)(sim, X.data(), U.data(), P.data()))) return std::printf("%s\n", OF(status_text)(status)), 1;
  const auto put = [&](std::vector<double>& matrix, int width, int column, auto at) {
    at(h);
    by[0] = motion.step(moved, sim->sim.settings());
    at(-h);
    by[1] = motion.step(moved, sim->sim.settings());
    at(Quad(0));
    for (int i = 0; i < states; ++i) matrix[i * width + column] = static_cast<double>((by[0][i] - by[1][i]) / (2 * h));
  };
    for (int j = 0; j < states; ++j) put(exact_X, states, j, [&, was = moved[j]](Quad by) { moved[j] = was + by; });
  for (int j = 0; j < inputs; ++j)
    put(exact_U, inputs, j, [&, was = motion.u[3 * j], middle = motion.later[0][3 * j], end = motion.later[1][3 * j]](Quad by) {
      motion.u[3 * j] = was + by, motion.later[0][3 * j] = middle + by, motion.later[1][3 * j] = end + by;
    });
  for (int j = 0; j < p; ++j)
    put(exact_P, p, j, [&, was = parameters[j]](Quad by) {
      parameters[j] = was + by;
      core::load_mechanism(motion.mechanism, parameters.data(), roads, sim->sim.stabilisation(), penalties);
    });
  std::vector<double> end(states), exact_end(states);
  OF(get_minimal)(sim, end.data());
  for (int i = 0; i < states; ++i) exact_end[i] = static_cast<double>(first[i]);
  print_error(X, exact_X), print_error(U, exact_U), print_error(P, exact_P), print_error(end, exact_end);
  return 0;
}

int main(int count, char** arguments) {
  auto* sim = OF(create)(memory, sizeof memory);
  const Quad h(std::atof(arguments[1]));
  std::vector<int> chosen;
  for (int i = 3; i < count; ++i) chosen.push_back(std::atoi(arguments[i]));
  if (arguments[2][0] != '*') {
    if (compare(sim, h, std::atol(arguments[2]), chosen)) return 1;
  } else {
    std::mt19937 draw(1);
    std::vector<double> scene(COUNT(PARAMETERS));
    for (int i = 0; i < COUNT(PARAMETERS); ++i) scene[i] = OF(parameters)(sim)[i];
    const auto settings = sim->sim.settings();
    for (int left = std::atoi(arguments[2] + 1); left > 0; --left) {
      for (int i = 0; i < COUNT(PARAMETERS); ++i) OF(set_parameter)(sim, i, scene[i] * (0.95 + 0.1 * (draw() / 4294967296.0)));
      sim->sim.settings() = settings;
      if (compare(sim, h, 1 + static_cast<long>(draw() % 150), chosen)) return 1;
    }
  }
  for (const double error : errors) std::printf("%g ", error);
}
