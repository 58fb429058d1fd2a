// Derivatives of a folder's interface beside differences of its equations in 113 bits; prints the largest errors of A, B, C, D and of derivatives and
// outputs along a direction, which has rates of inputs too, as shares of the largest entries.  Arguments: how many steps are taken first, then speeds that are independent, unless the folder chooses.
// MODEL and TITLE are the name of the model, in capitals too, SOURCE is its file.
#include <cstdio>
#include <cstdlib>
#include <cmath>

#include <vector>

#define JOIN_(a, b) a##b
#define JOIN(a, b) JOIN_(a, b)
#define OF(name) JOIN(MODEL, _##name)
#define COUNT(name) JOIN(TITLE, _##name)

#define cutjoint quads  // the folder has a namespace of that name in its own
#include "cutjoint/quad.hpp"
#undef cutjoint

using quads::Quad;

#include SOURCE

namespace core = OF(code)::cutjoint;
namespace code = OF(code);

template <class Mechanism>
struct InQuad;
template <template <class> class Mechanism>
struct InQuad<Mechanism<double>> {
  using type = Mechanism<Quad>;
};
using Reference = InQuad<code::Mechanism>::type;
using Numbers = std::vector<Quad>;

constexpr int n = COUNT(SPEEDS), m = COUNT(EQUATIONS), f = COUNT(FREEDOMS), states = COUNT(STATES), inputs = COUNT(INPUTS), outputs = COUNT(OUTPUTS);

struct Motion {
  Reference mechanism;
  Quad t;
  Numbers u = Numbers(3 * inputs + 1), q, reference, delta = Numbers(n), lambda, guess;
  std::vector<int> independent, dependent;

  static void fill(void* self, Quad, Quad* input) {
    for (int i = 0; i < 3 * inputs; ++i) input[i] = static_cast<Motion*>(self)->u[i];
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
    Numbers rate(n), vdot(n), correction(m), second(n), result(states + outputs);
    for (int i = 0; i < f; ++i) rate[independent[i]] = x[f + i];
    if (!dependent.empty()) {
      const Numbers step = solve(residual(speeds(rate), true));
      for (std::size_t i = 0; i < step.size(); ++i) rate[dependent[i]] -= step[i];
    }
    const Numbers v = speeds(rate);
    for (int iteration = 0; iteration < 400; ++iteration) {
      mechanism.evaluate(q.data(), v.data(), lambda.data(), vdot.data(), correction.data());
      for (int i = 0; i < m; ++i) lambda[i] += correction[i];
    }
    core::chart_accelerations<Quad>(Reference::charts, delta.data(), v.data(), vdot.data(), second.data());
    for (int i = 0; i < f; ++i) result[i] = rate[independent[i]], result[f + i] = second[independent[i]];
    mechanism.report(q.data(), v.data(), vdot.data(), lambda.data(), result.data() + states);
    return result;
  }
};

static double memory[COUNT(SIZE) / sizeof(double)];

static void print_error(const std::vector<double>& found, const std::vector<double>& exact) {
  double error = 0.0, size = 0.0;
  for (std::size_t i = 0; i < found.size(); ++i) {
    error = std::isfinite(found[i]) ? std::fmax(error, std::fabs(found[i] - exact[i])) : INFINITY;
    size = std::fmax(size, std::fabs(exact[i]));
  }
  std::printf("%g ", error > 0.0 ? error / std::fmax(size, 1e-300) : 0.0);
}

int main(int count, char** arguments) {
  auto* sim = OF(create)(memory, sizeof memory);
  int status = OF(start)(sim);
  if (!status) status = OF(play)(sim, std::atol(arguments[1]), nullptr);
  std::vector<int> chosen;
  for (int i = 2; i < count; ++i) chosen.push_back(std::atoi(arguments[i]));
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
#if JOIN(TITLE, _INPUTS) > 0
  sim->sim.starter();
  std::copy_n(sim->sim.mechanism().last_inputs(), 3 * inputs, motion.u.begin());
  motion.mechanism.drive_by({&Motion::fill, &motion});
#endif
  motion.t = sim->sim.state().t;
  motion.q.assign(sim->sim.state().q.begin(), sim->sim.state().q.end());
  motion.reference.assign(choice.reference.begin(), choice.reference.end());
  motion.lambda.assign(m, Quad(0));
  std::vector<double> delta(n + 1);
  core::displacement<double>(Reference::charts, choice.reference.data(), sim->sim.state().q.data(), delta.data());
  motion.guess.assign(delta.begin(), delta.begin() + n);
  for (int i = 0; i < n; ++i) (choice.independent[static_cast<std::size_t>(i)] ? motion.independent : motion.dependent).push_back(i);

  const Quad h(1e-9);
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
}
