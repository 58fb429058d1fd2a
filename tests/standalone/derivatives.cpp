// Derivatives of a folder's interface beside differences of its equations in 113 bits; prints the largest errors of A, B, C, D and of derivatives and
// outputs along a direction, which has rates of inputs too, as shares of the largest entries; those of E and F, by parameters; then those of a step's derivatives by
// states, inputs and parameters, beside differences of the integrator in 113 bits.  Columns by parameters are by shares of these.  Arguments: the difference, how many
// steps are taken first, then speeds that are independent, unless the folder chooses.  With `*100` in place of steps the errors are the largest of a hundred states
// behind steps at random, of parameters at random near those of the scene, `*100/4` along four columns of each kind, drawn anew at each.
#include <cstdio>
#include <cstdlib>
#include <cmath>
#include <cstring>
#include <algorithm>
#include <numeric>
#include <random>
#include <vector>

#include "quads.hpp"

using Reference = InQuad<code::Mechanism>::type;

using Numbers = std::vector<Quad>;

static Quad largest(const Numbers& numbers) {
  Quad most = 0;
  for (const Quad& x : numbers) most = abs(x) > most ? abs(x) : most;
  return most;
}

/// Accelerations, and multipliers from near ones, to the end of their iteration.
static void find_accelerations(Reference& mechanism, const Quad* q, const Quad* v, Numbers& lambda, Numbers& vdot) {
  Numbers correction(lambda.size());
  Quad before = 0;
  for (int iteration = 0; iteration < (lambda.empty() ? 1 : 400); ++iteration) {
    mechanism.evaluate(q, v, lambda.data(), vdot.data(), correction.data());
    for (std::size_t i = 0; i < lambda.size(); ++i) lambda[i] += correction[i];
    const Quad size = largest(correction), all = largest(lambda);
    if (size <= Quad(1e-29) * all || (size <= Quad(1e-22) * all && !(size < before))) break;
    before = size;
  }
}

/// A step by the trapezoidal rule, or by the explicit method of a folder.
template <class Steps>
struct StepInQuad {
  static core::Fault go(Reference& mechanism, const core::SimulationSettings& settings, core::StateOf<Reference>& state, Quad h) {
    core::Trapezoidal<Reference> steps(mechanism, h, settings.fixed_point);
    steps.projection().close_fully(true);
    return steps.step(state, 1);
  }
};
template <template <class, class> class Steps, class Mechanism, class Method>
struct StepInQuad<Steps<Mechanism, Method>> {
  static core::Fault go(Reference& mechanism, const core::SimulationSettings&, core::StateOf<Reference>& state, Quad h) {
    constexpr int last = Method::stages - 1;
    const Numbers q(state.q.begin(), state.q.end()), v(state.v.begin(), state.v.end());
    const Quad begin = state.t;
    Numbers rates[last], accelerations[last], lambda(state.lambda.begin(), state.lambda.end());
    for (int stage = 0; stage <= last; ++stage) {
      std::copy(q.begin(), q.end(), state.q.begin());
      std::copy(v.begin(), v.end(), state.v.begin());
      for (int k = 0; k < stage; ++k) {
        const Quad weight = h * Method::weights[stage][k].template as<Quad>();
        for (std::size_t i = 0; i < q.size(); ++i) state.q[i] += weight * rates[k][i];
        for (std::size_t i = 0; i < v.size(); ++i) state.v[i] += weight * accelerations[k][i];
      }
      state.t = begin + Method::nodes[stage].template as<Quad>() * h;
      mechanism.begin_step(state.t, Quad(1));
      if (stage == last) break;
      rates[stage].resize(q.size()), accelerations[stage].resize(v.size());
      find_accelerations(mechanism, state.q.data(), state.v.data(), lambda, accelerations[stage]);
      core::coordinate_rates<Quad>(Reference::charts, state.q.data(), state.v.data(), rates[stage].data());
    }
    core::normalise<Quad>(Reference::charts, state.q.data());
    core::Projection<Reference> projection(mechanism);
    projection.close_fully(true);
    return projection.close(state);
  }
};

constexpr int n = COUNT(SPEEDS), m = COUNT(EQUATIONS), f = COUNT(DEGREES_OF_FREEDOM), states = COUNT(STATES), inputs = COUNT(INPUTS), outputs = COUNT(OUTPUTS);
constexpr int joints = n - (states - 2 * f);            ///< speeds of joints; first-order states are behind them
constexpr int given = 3 * inputs + Reference::sizes.discrete;  ///< numbers of inputs, and what controllers hold

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
      if (largest(step) < Quad(1e-18)) break;  // the next one would be the square of that
    }
    core::retract<Quad>(Reference::charts, reference.data(), delta.data(), q.data());
    Numbers rate(n), second(n), result(states + outputs);
    for (int i = 0; i < f; ++i) rate[independent[i]] = x[f + i];
    if (!dependent.empty()) {
      const Numbers step = solve(residual(speeds(rate), true));
      for (std::size_t i = 0; i < step.size(); ++i) rate[dependent[i]] -= step[i];
    }
    v = speeds(rate);
    for (int i = 2 * f; i < states; ++i) v[joints - 2 * f + i] = x[i];
    find_accelerations(mechanism, q.data(), v.data(), lambda, vdot);
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

constexpr int kinds = 12;
static double errors[kinds];
static std::mt19937 draw(1);

/// Columns that are compared, at most so many of each kind; 0 is all.
static int most_columns = 0;
static std::vector<int> columns_of(int number) {
  std::vector<int> columns(number);
  std::iota(columns.begin(), columns.end(), 0);
  if (most_columns > 0 && number > most_columns) {
    std::shuffle(columns.begin(), columns.end(), draw);
    columns.resize(most_columns);
  }
  return columns;
}

static int printed = 0;

/// The error as a share of the largest entry, the largest until now.
static void print_error(const std::vector<double>& found, const std::vector<double>& exact) {
  double error = 0.0, size = 0.0;
  for (std::size_t i = 0; i < found.size(); ++i) {
    const double off = std::fabs(found[i] - exact[i]);
    error = std::isfinite(off) ? std::fmax(error, off) : INFINITY;
    size = std::fmax(size, std::fabs(exact[i]));
  }
  double& largest = errors[printed++ % kinds];
  largest = std::fmax(largest, error > 0.0 ? error / std::fmax(size, 1e-12) : 0.0);  // what stays has differences of rounding
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

/// At a state behind so many steps; 2 where the next one has no derivative, since it ends at an event.
template <class Sim>
int compare(Sim* sim, const Quad& h, long steps, const std::vector<int>& chosen) {
  printed = 0;
  int status = OF(start)(sim);
  if (!status) status = OF(run)(sim, steps, nullptr);
  if (!status) status = chosen.empty() ? OF(choose_independent)(sim) : OF(choose_independent_speeds)(sim, chosen.data());
  std::vector<double> A(states * states), B(states * inputs), C(outputs * states), D(outputs * inputs), x(states + 1);
  if (!status) status = OF(get_minimal_state)(sim, x.data());
  if (!status) status = OF(set_minimal_state)(sim, OF(time)(sim), x.data());  // runs leave loops open by what their closure lets them
  if (!status) status = OF(linearise)(sim, A.data(), B.data(), C.data(), D.data());
  if (status) return std::printf("%s\n", OF(status_text)(status)), 1;

  Motion motion;
  const auto& choice = sim->minimal.choice();
  Numbers parameters, penalties;
  for (std::size_t i = 0; i < COUNT(PARAMETERS); ++i) parameters.push_back(sim->sim.parameters()[i]);
  for (const double penalty : sim->sim.penalties()) penalties.push_back(penalty);
  static const core::Road<Quad> roads[Reference::sizes.roads + 1];
  const auto load = [&] { core::load_mechanism(motion.mechanism, parameters.data(), roads, sim->sim.stabilisation(), penalties); };
  load();
  take_inputs(sim->sim, motion);
  motion.t = sim->sim.state().t;
  motion.q.assign(sim->sim.state().q.begin(), sim->sim.state().q.end());
  motion.reference.assign(choice.reference.begin(), choice.reference.end());
  motion.lambda.assign(m, Quad(0));
  std::vector<double> delta(n + 1);
  core::displacement<double>(Reference::charts, choice.reference.data(), sim->sim.state().q.data(), delta.data());
  motion.guess.assign(delta.begin(), delta.begin() + n);
  for (int i = 0; i < joints; ++i) (choice.independent[static_cast<std::size_t>(i)] ? motion.independent : motion.dependent).push_back(i);

  const int p = COUNT(PARAMETERS);
  std::vector<double> E(states * p), F(outputs * p), exact[9];
  if ((status = OF(linearise_parameters)(sim, E.data(), F.data()))) return std::printf("%s\n", OF(status_text)(status)), 1;
  Numbers moved(x.begin(), x.begin() + states), by[2];
  /// Columns of two matrices, the second below the first, by numbers that change; those that are not drawn stay as they were found.
  const auto differ = [&](std::vector<double>& upper, std::vector<double>& lower, int width, auto change, auto find) {
    const int rows = states, rows_below = width > 0 ? static_cast<int>(lower.size()) / width : 0;
    for (const int j : columns_of(width)) {
      for (int side = 0; side < 2; ++side) {
        change(j, side ? h : -h);
        by[side] = find();
        change(j, side ? -h : h);
      }
      for (int i = 0; i < rows + rows_below; ++i)
        (i < rows ? upper : lower)[(i < rows ? i : i - rows) * width + j] = static_cast<double>((by[1][i] - by[0][i]) / (2 * h));
    }
  };
  const auto derive = [&] { return motion.derive(moved); };
  const auto by_state = [&](int j, Quad by) { moved[j] += by; };
  const auto by_input = [&](int j, Quad by) { motion.u[3 * j] += by, motion.later[0][3 * j] += by, motion.later[1][3 * j] += by; };
  const auto by_parameter = [&](int j, Quad by) { parameters[j] += by, load(); };
  differ(exact[0] = A, exact[2] = C, states, by_state, derive);
  differ(exact[1] = B, exact[3] = D, inputs, by_input, derive);
  differ(exact[4] = E, exact[5] = F, p, by_parameter, derive);
  std::vector<double> dx(states + 1), du(3 * inputs + 1), dxdot(states + 1), dy(outputs + 1), exact_dxdot(states + 1), exact_dy(outputs + 1);
  for (int i = 0; i < states; ++i) dx[i] = std::cos(1.0 + i);
  for (int i = 0; i < 3 * inputs; ++i) du[i] = std::sin(2.0 + i);
  if ((status = OF(directional_derivative)(sim, dx.data(), du.data(), dxdot.data(), dy.data()))) return std::printf("%s\n", OF(status_text)(status)), 1;
  const Numbers u = motion.u;
  for (int side = 0; side < 2; ++side) {
    Numbers at = moved;
    for (int i = 0; i < states; ++i) at[i] += (side ? h : -h) * Quad(dx[i]);
    for (int i = 0; i < 3 * inputs; ++i) motion.u[i] = u[i] + (side ? h : -h) * Quad(du[i]);
    by[side] = motion.derive(at);
  }
  for (int i = 0; i < states + outputs; ++i)
    (i < states ? exact_dxdot[i] : exact_dy[i - states]) = static_cast<double>((by[1][i] - by[0][i]) / (2 * h));
  print_error(dxdot, exact_dxdot), print_error(dy, exact_dy);
  motion.u = u;
  print_error(A, exact[0]), print_error(B, exact[1]), print_error(C, exact[2]), print_error(D, exact[3]);
  const auto by_share = [&](std::vector<double>& matrix) {
    for (std::size_t i = 0; i < matrix.size(); ++i)
      if (const double size = std::fabs(static_cast<double>(parameters[i % p])); size > 0.0) matrix[i] *= size;
  };
  by_share(E), by_share(F), by_share(exact[4]), by_share(exact[5]);
  print_error(E, exact[4]), print_error(F, exact[5]);

  motion.h = Quad(sim->sim.settings().dt);
  take_later_inputs(sim->sim, motion);
  const auto step = [&] { return motion.step(moved, sim->sim.settings()); };
  const Numbers first = step();
  std::vector<double> X(states * states), U(states * inputs), P(states * p), none;
  sim->sim.settings().fixed_point.tolerance = 1e-11;  // as the other step: a derivative has the errors of what it is of
  const std::vector<double> q(sim->sim.state().q.begin(), sim->sim.state().q.end()), v(sim->sim.state().v.begin(), sim->sim.state().v.end());
  if (!status) status = OF(set_state)(sim, OF(time)(sim), q.data(), v.data());
  if ((status = OF(step_derivatives)(sim, X.data(), U.data(), P.data())) == COUNT(STEP_SUBDIVIDED)) return 2;
  if (status) return std::printf("%s\n", OF(status_text)(status)), 1;
  differ(exact[6] = X, none, states, by_state, step);
  differ(exact[7] = U, none, inputs, by_input, step);
  differ(exact[8] = P, none, p, by_parameter, step);
  by_share(P), by_share(exact[8]);
  std::vector<double> end(states), exact_end(states);
  OF(get_minimal_state)(sim, end.data());
  for (int i = 0; i < states; ++i) exact_end[i] = static_cast<double>(first[i]);
  print_error(X, exact[6]), print_error(U, exact[7]), print_error(P, exact[8]), print_error(end, exact_end);
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
    if (const char* most = std::strchr(arguments[2], '/')) most_columns = std::atoi(most + 1);
    std::vector<double> scene(COUNT(PARAMETERS));
    for (int i = 0; i < COUNT(PARAMETERS); ++i) scene[i] = OF(parameters)(sim)[i];
    const auto settings = sim->sim.settings();
    int events = 0;
    for (int left = std::atoi(arguments[2] + 1); left > 0; --left) {
      for (int i = 0; i < COUNT(PARAMETERS); ++i) OF(set_parameter)(sim, i, scene[i] * (0.95 + 0.1 * (draw() / 4294967296.0)));
      sim->sim.settings() = settings;
      const int failed = compare(sim, h, 1 + static_cast<long>(draw() % 150), chosen);
      if (failed == 1 || (failed && ++events > 50)) return 1;
      left += failed == 2;
    }
  }
  for (const double error : errors) std::printf("%g ", error);
}
