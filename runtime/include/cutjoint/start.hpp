// A consistent start: closed loops, speeds that keep them closed, accelerations with their multipliers, static equilibrium.
#pragma once

#include <Eigen/Dense>
#include <cmath>
#include <string>
#include <vector>

#include "cutjoint/mechanism.hpp"
#include "cutjoint/retraction.hpp"
#include "cutjoint/state.hpp"

namespace cutjoint {

/// Finds starts of a mechanism; a speed that is `held` (given by the user) is not changed, nor is its coordinate.
template <Mechanism M>
class Starter {
 public:
  using Real = typename M::real_type;
  using Vector = Eigen::Matrix<Real, Eigen::Dynamic, 1>;
  using Matrix = Eigen::Matrix<Real, Eigen::Dynamic, Eigen::Dynamic>;

  /// Accelerations of a mechanism of the proximal closure do not draw open loops together: `proximal` lets an equilibrium do so.
  explicit Starter(M& mechanism, bool proximal = false)
      : mechanism_(mechanism), d_(mechanism.description()), n_(static_cast<Eigen::Index>(d_.speeds.size())),
        m_(static_cast<Eigen::Index>(d_.equations.size())), drawn_(proximal ? m_ : 0) {}

  /// Close the loops by the shortest way from the given coordinates (Gauss-Newton with least-norm steps).
  /// Throws Failure naming the equation that stays open.
  void assemble(State<Real>& state, const std::vector<bool>& held, Real motion) const {
    mechanism_.begin_step(state.t, motion);
    Vector gap = residual(state);
    for (int iteration = 0; iteration < 50 && largest(gap) > closed(); ++iteration) {
      const Vector step = least_norm(held_out(jacobian(state), held), gap);
      move(state, step, -std::min(Real(1), Real(0.5) / std::max(largest(step), Real(1e-30))));
      gap = residual(state);
    }
    if (!(largest(gap) <= Real(1e-9))) open_loop("the loop cannot close from the given coordinates", state, gap);
  }

  /// Change the speeds that are not held, least in the mean square, so that the loops stay closed.
  void make_consistent(State<Real>& state, const std::vector<bool>& held, Real motion) const {
    mechanism_.begin_step(state.t, motion);
    const Vector gap = rate(state);
    const Vector step = least_norm(held_out(jacobian(state), held), gap);
    for (Eigen::Index i = 0; i < n_; ++i) state.v[static_cast<std::size_t>(i)] -= step[i];
    const Vector left = rate(state);
    if (!(largest(left) <= Real(1e-9) * (Real(1) + largest(gap)))) open_loop("the given speeds contradict the loops", state, left);
  }

  /// Names of independent speeds that neither the user nor the loops determine; as many as degrees of freedom are left.
  std::vector<std::string_view> undetermined(const State<Real>& state, const std::vector<bool>& held) const {
    std::vector<std::string_view> names;
    if (n_ == 0) return names;
    Eigen::ColPivHouseholderQR<Matrix> qr;
    qr.setThreshold(Real(1e-7));
    if (m_ > 0) qr.compute(held_out(jacobian(state), held));
    std::vector<bool> dependent(static_cast<std::size_t>(n_), false);
    for (Eigen::Index i = 0; m_ > 0 && i < qr.rank(); ++i) dependent[static_cast<std::size_t>(qr.colsPermutation().indices()[i])] = true;
    for (std::size_t i = 0; i < dependent.size(); ++i)
      if (!dependent[i] && !held[i]) names.push_back(d_.speeds[i]);
    return names;
  }

  /// Throws Failure when an acceleration is not a finite number.
  void require_finite(const State<Real>& state) const {
    for (std::size_t i = 0; i < state.vdot.size(); ++i)
      if (!std::isfinite(static_cast<double>(state.vdot[i])))
        throw Failure("an acceleration has no finite value at the start", static_cast<double>(state.t), 0, std::string(d_.speeds[i]),
                      static_cast<double>(state.vdot[i]),
                      "it may move no mass in this pose, as of massless links in line");
  }

  /// Accelerations and multipliers of the state: the augmented update, repeated until the accelerations stay or only rounding is left to
  /// change, 200 times at most.
  void accelerate(State<Real>& state, Real motion) const {
    mechanism_.begin_step(state.t, motion);
    std::vector<Real> before, correction(state.lambda.size());
    Real last(0);
    for (int iteration = 0; iteration < 200; ++iteration) {
      before = state.vdot;
      mechanism_.evaluate(state.q.data(), state.v.data(), state.lambda.data(), state.vdot.data(), correction.data());
      for (std::size_t i = 0; i < correction.size(); ++i) state.lambda[i] += correction[i];
      Real change(0), size(1);
      for (std::size_t i = 0; i < before.size(); ++i) {
        change = std::max(change, std::abs(state.vdot[i] - before[i]));
        size = std::max(size, std::abs(state.vdot[i]));
      }
      if (iteration > 1 && change <= (change < last ? Real(1e-12) : Real(1e-6)) * size) return;
      last = change;
    }
  }

  /// The same of several states at one time, side by side where the mechanism can.
  void accelerate(std::vector<State<Real>>& states, Real motion) const {
    if constexpr (requires { mechanism_.accelerate(states, motion); }) {
      mechanism_.accelerate(states, motion);
    } else {
      for (State<Real>& state : states) accelerate(state, motion);
    }
  }

  /// The pose near the given one in which nothing accelerates at rest: Newton's method on vdot(q) = 0 with differences and least-norm
  /// steps, since directions without stiffness (a car's x, y and yaw) are free.  A held coordinate stays and may carry a force.
  /// Throws Failure naming what still accelerates.
  void equilibrate(State<Real>& state, const std::vector<bool>& held) const {
    std::fill(state.v.begin(), state.v.end(), Real(0));
    Vector travel = Vector::Zero(n_);
    seek_rest(state, held, travel);
    // Differences tell the free directions to some digits only, so the steps have drifted along them.
    const Matrix K = held_out(stiffness(state, held), held);
    const Vector drift = travel - least_norm(K, K * travel);
    move(state, drift, Real(-1));
    const Vector a = seek_rest(state, held, travel);
    if (!(largest(a) <= Real(1e-6))) {
      const auto worst = static_cast<std::size_t>(index_of_largest(a));
      const bool open = static_cast<Eigen::Index>(worst) >= n_;
      const std::string_view name = open ? d_.equations[worst - static_cast<std::size_t>(n_)] : d_.speeds[worst];
      throw Failure("no static equilibrium was found near the given pose", 0, 0, std::string(name),
                    static_cast<double>(largest(a)), "check that every free direction has a spring or is held");
    }
  }

  /// The Jacobian of the residual by the speeds, (equations, speeds); exact, since the rate is linear in the speeds.
  Matrix jacobian(const State<Real>& state) const {
    State<Real> probe = state;
    std::fill(probe.v.begin(), probe.v.end(), Real(0));
    const Vector still = rate(probe);
    Matrix J(m_, n_);
    for (Eigen::Index i = 0; i < n_; ++i) {
      probe.v[static_cast<std::size_t>(i)] = Real(1);
      J.col(i) = rate(probe) - still;
      probe.v[static_cast<std::size_t>(i)] = Real(0);
    }
    return J;
  }

  Vector residual(const State<Real>& state) const { return closure(state).first; }
  Vector rate(const State<Real>& state) const { return closure(state).second; }

 private:
  static constexpr Real closed() { return Real(1e-14); }

  std::pair<Vector, Vector> closure(const State<Real>& state) const {
    Vector phi(m_), phid(m_);
    mechanism_.constraint_residual(state.q.data(), state.v.data(), phi.data(), phid.data());
    return {phi, phid};
  }

  void move(State<Real>& state, const Vector& step, Real factor) const {
    const Vector delta = factor * step;
    const std::vector<Real> from = state.q;
    retract<Real>(d_.charts, from.data(), delta.data(), state.q.data());
  }

  /// The accelerations at rest of what is not held; below them what would draw open loops together at 10 1/s.
  Vector rest_acceleration(State<Real>& state, const std::vector<bool>& held) const {
    accelerate(state, Real(0));
    return left_at_rest(state, held);
  }

  Vector left_at_rest(const State<Real>& state, const std::vector<bool>& held) const {
    Vector a(n_ + drawn_);
    a.head(n_) = Eigen::Map<const Vector>(state.vdot.data(), n_);
    if (drawn_ > 0) a.tail(drawn_) = Real(100) * residual(state);
    for (std::size_t i = 0; i < held.size(); ++i)
      if (held[i]) a[static_cast<Eigen::Index>(i)] = Real(0);
    return a;
  }

  /// The derivative of rest_acceleration by q, by central differences.
  Matrix stiffness(const State<Real>& state, const std::vector<bool>& held) const {
    const Real h(1e-5);
    Matrix K(n_ + drawn_, n_);
    Vector unit = Vector::Zero(n_);
    std::vector<State<Real>> probes;
    for (Eigen::Index i = 0; i < n_; ++i) {
      unit[i] = Real(1);
      for (const Real side : {h, -h}) move(probes.emplace_back(state), unit, side);
      unit[i] = Real(0);
    }
    accelerate(probes, Real(0));
    for (Eigen::Index i = 0; i < n_; ++i) {
      const auto forward = static_cast<std::size_t>(2 * i);
      K.col(i) = (left_at_rest(probes[forward], held) - left_at_rest(probes[forward + 1], held)) / (2 * h);
    }
    return K;
  }

  /// Newton's steps with halving while they lower the accelerations, which are returned; adds what it moves to `travel`.
  Vector seek_rest(State<Real>& state, const std::vector<bool>& held, Vector& travel) const {
    Vector a = rest_acceleration(state, held);
    for (int iteration = 0; iteration < 60 && largest(a) > Real(1e-9); ++iteration) {
      const Vector step = least_norm(held_out(stiffness(state, held), held), a);
      const State<Real> from = state;
      Real fraction = std::min(Real(1), Real(0.1) / std::max(largest(step), Real(1e-30)));
      Vector next;
      for (int halving = 0; halving < 12; ++halving, fraction /= 2) {
        state = from;
        move(state, step, -fraction);
        next = rest_acceleration(state, held);
        if (next.norm() < a.norm()) break;
      }
      if (!(next.norm() < a.norm())) {
        state = from;
        break;
      }
      travel -= fraction * step;
      a = next;
    }
    return a;
  }

  static Matrix held_out(Matrix matrix, const std::vector<bool>& held) {
    for (std::size_t i = 0; i < held.size(); ++i)
      if (held[i]) matrix.col(static_cast<Eigen::Index>(i)).setZero();
    return matrix;
  }

  static Vector least_norm(const Matrix& matrix, const Vector& right) {
    if (matrix.size() == 0) return Vector::Zero(matrix.cols());
    Eigen::CompleteOrthogonalDecomposition<Matrix> solver;
    solver.setThreshold(Real(1e-7));
    solver.compute(matrix);
    return solver.solve(right);
  }

  static Real largest(const Vector& x) { return x.size() ? x.cwiseAbs().maxCoeff() : Real(0); }

  static Eigen::Index index_of_largest(const Vector& x) {
    Eigen::Index i = 0;
    x.cwiseAbs().maxCoeff(&i);
    return i;
  }

  [[noreturn]] void open_loop(const char* what, const State<Real>& state, const Vector& gap) const {
    const auto worst = static_cast<std::size_t>(index_of_largest(gap));
    throw Failure(what, static_cast<double>(state.t), 0, std::string(d_.equations[worst]), static_cast<double>(largest(gap)),
                  "check the joints' points, guides, and the given coordinates and speeds of this loop");
  }

  M& mechanism_;
  const Description& d_;
  Eigen::Index n_, m_, drawn_;
};

}  // namespace cutjoint
