// Minimal coordinates of a mechanism, one for each degree of freedom.
#pragma once

#include <optional>

#include "cutjoint/core/roads/road.hpp"
#include "cutjoint/core/start/start.hpp"

namespace cutjoint {

/// Independent coordinates z of a mechanism, their rates and first-order states, x = (z, z', states); the loops determine all others.
///
/// Coordinates are the delta of `retract` from a reference in which scalars are 0: a scalar is itself, a ball has its rotation
/// vector.  Of these, one for each velocity, `dofs` are independent; Newton's method finds the others from the loops, and their rates from the
/// loops' rates.  If the set of independent coordinates becomes ill-conditioned, another one is chosen.
template <Sized M, std::size_t dofs>
class MinimalCoordinates {
 public:
  using Real = typename M::real_type;

  /// The choice of independent velocities, the gain (largest rate of a dependent one for a unit rate of an independent one), and a nearby pose
  /// with the rates there.
  struct Choice {
    Coordinates<M> reference, pose;
    Speeds<M> rate;
    Speeds<M, unsigned char> independent;
    bool is_made = false;
    Real gain{0};
  };

  const Choice& choice() const { return choice_; }
  void restore(const Choice& choice) { choice_ = choice; }

  /// Choose in the pose of a state; `begin_step` has been called for its time.
  Fault choose(Starter<M>& starter, const StateOf<M>& state) {
    Speeds<M, unsigned char> independent;
    std::fill_n(independent.begin(), joints, 1);
    if constexpr (m > 0) {
      find_jacobian(starter, state, reference_at(state), matrix_);
      for (std::size_t j = 0; j < joints; ++j) scale_column(j, j);
      const auto squares = decomposed();
      if (squares.rank() != joints - dofs) return singular(state);
      for (std::size_t k = 0; k < squares.rank(); ++k) independent[squares.column_at(k)] = 0;
    }
    return choose(starter, state, independent);
  }

  /// Take the caller's choice of `independent` velocities.
  Fault choose(Starter<M>& starter, const StateOf<M>& state, const Speeds<M, unsigned char>& independent) {
    const Choice before = choice_;
    choice_ = {.reference = reference_at(state), .pose = state.q, .rate = {}, .independent = independent, .is_made = true};
    if (const Fault fault = find_gain(starter, state, choice_.gain)) {
      choice_ = before;
      return fault;
    }
    settle(state);
    return {};
  }

  /// From now on states are near this pose, or along its velocities.
  void settle(const StateOf<M>& state) {
    choice_.pose = state.q;
    displacement<Real>(charts(), choice_.reference.data(), state.q.data(), delta_.data());
    chart_rates<Real>(charts(), delta_.data(), state.v.data(), choice_.rate.data());
  }

  /// Whether the choice is ill-conditioned in the pose of a state, or a ball has rotated far.
  bool is_ill_conditioned(Starter<M>& starter, const StateOf<M>& state) {
    displacement<Real>(charts(), choice_.reference.data(), state.q.data(), delta_.data());
    for (const Chart& chart : charts())
      for (int i = chart.scalars; i < chart.scalars + (chart.ball ? 3 : 0); ++i)
        if (!(magnitude(delta_[static_cast<std::size_t>(chart.v + i)]) < Real(1))) return true;
    Real gain(0);
    return find_gain(starter, state, gain) || !(gain <= 4 * std::max(Real(1), choice_.gain));
  }

  /// The x of a state.
  void read(const StateOf<M>& state, Real* x) {
    displacement<Real>(charts(), choice_.reference.data(), state.q.data(), delta_.data());
    chart_rates<Real>(charts(), delta_.data(), state.v.data(), rate_.data());
    put(delta_, x);
    put(rate_, x + dofs);
    std::copy(state.v.begin() + joints, state.v.end(), x + 2 * dofs);
  }

  /// Its derivative, for a state with accelerations.
  void derive(const StateOf<M>& state, Real* x) {
    displacement<Real>(charts(), choice_.reference.data(), state.q.data(), delta_.data());
    chart_rates<Real>(charts(), delta_.data(), state.v.data(), rate_.data());
    put(rate_, x);
    chart_accelerations<Real>(charts(), delta_.data(), state.v.data(), state.vdot.data(), rate_.data());
    put(rate_, x + dofs);
    std::copy(state.vdot.begin() + joints, state.vdot.end(), x + 2 * dofs);
  }

  /// Scatter numbers of independent coordinates into an array with one for each velocity; `put` gathers them.
  template <class Number>
  void put(const Speeds<M, Number>& values, Number* x) const {
    for (std::size_t i = 0; i < n; ++i)
      if (choice_.independent[i]) *x++ = values[i];
  }

  template <class Number>
  void take(const Number* x, Speeds<M, Number>& values) const {
    for (std::size_t i = 0; i < n; ++i)
      if (choice_.independent[i]) values[i] = *x++;
  }

  /// Decompose the Jacobian of loops with respect to dependent coordinates in the pose of a state, for the next calls of `solve`.
  Fault decompose(Starter<M>& starter, const StateOf<M>& state) {
    if constexpr (m > 0) {
      find_jacobian(starter, state, choice_.reference, matrix_);
      squares_.emplace(decomposed_by_dependent());
      if (squares_->rank() != joints - dofs) return singular(state);
    }
    return {};
  }

  /// Displacements of dependent coordinates that remove constraint violations b, one number for each velocity; b and `room` are overwritten.
  template <class Number>
  void solve(Number* b, Number* step, Number* room) const { solve(*squares_, b, step, room); }

  /// All velocities for a unit rate of each independent coordinate, one column for each, in the pose of a state.
  Fault directions(Starter<M>& starter, const StateOf<M>& state, Real* columns) {
    displacement<Real>(charts(), choice_.reference.data(), state.q.data(), delta_.data());
    if constexpr (m > 0) {
      if (const Fault fault = decompose(starter, state)) return fault;
      find_jacobian(starter, state, choice_.reference, all_);
    }
    for (std::size_t j = 0; j < joints; ++j) {
      if (!choice_.independent[j]) continue;
      rate_.fill(Real(0));
      if constexpr (m > 0) {
        solve(all_.data() + j * m, rate_.data(), scratch_.data());
        for (Real& rate : rate_) rate = -rate;
      }
      rate_[j] = Real(1);
      chart_speeds<Real>(charts(), delta_.data(), rate_.data(), columns);
      columns += n;
    }
    return {};
  }

  /// The state of x that continues the nearby pose; unchanged if loops do not close.
  Fault close(M& mechanism, Starter<M>& starter, const Real* x, StateOf<M>& state) {
    StateOf<M> found = state;
    std::copy_n(x + 2 * dofs, n - joints, found.v.begin() + joints);
    displacement<Real>(charts(), choice_.reference.data(), choice_.pose.data(), delta_.data());
    extrapolate(x);
    take(x, delta_);
    if (const Fault fault = close_positions(mechanism, starter, found)) return fault;
    rate_.fill(Real(0));
    take(x + dofs, rate_);
    if (const Fault fault = close_speeds(mechanism, found)) return fault;
    state = found;
    return {};
  }

 private:
  static constexpr std::size_t n = M::sizes.speeds, m = M::sizes.equations, joints = M::sizes.joint_speeds();
  static_assert(dofs <= joints);

  static std::span<const Chart> charts() { return M::charts; }
  static Real magnitude(Real x) { return x < Real(0) ? -x : x; }

  /// Nominal values, as `scaled_nominals_of` and `arm_of`, and that of a velocity's coordinate.
  static std::span<const double> nominals() {
    if constexpr (requires { M::arm; }) return M::arm == 1.0 ? std::span<const double>{} : std::span<const double>(M::nominals);
    else return {};
  }
  static Real arm() {
    if constexpr (requires { M::arm; }) return Real(M::arm);
    else return Real(1);
  }
  static Real nominal(std::size_t j) { return Real(size_at(nominals(), j, n)); }

  /// The effect of a displacement of a metre, or of the angle by which the arm's end moves as far: ranks do not depend on units.
  void scale_column(std::size_t column, std::size_t j) {
    if (nominals().empty()) return;
    for (std::size_t i = 0; i < m; ++i) matrix_[column * m + i] *= nominal(j);
  }

  /// The origin of the delta: 0 for scalars, for balls their attitude in a state.
  static Coordinates<M> reference_at(const StateOf<M>& state) {
    Coordinates<M> reference = state.q;
    for (const Chart& chart : charts())
      for (int i = 0; i < chart.scalars; ++i) reference[static_cast<std::size_t>(chart.q + i)] = Real(0);
    return reference;
  }

  /// Extrapolate dependent coordinates along the velocities of the pose to the new independent ones: this selects the branch
  /// beyond a singular pose.
  void extrapolate(const Real* x) {
    Real along(0), square(0);
    for (std::size_t i = 0; i < n; ++i) {
      if (!choice_.independent[i]) continue;
      along += (*x++ - delta_[i]) * choice_.rate[i] / (nominal(i) * nominal(i));
      square += choice_.rate[i] * choice_.rate[i] / (nominal(i) * nominal(i));
    }
    if (!(square > Real(1e-12) * arm())) return;  // at rest
    for (std::size_t i = 0; i < n; ++i)
      if (!choice_.independent[i]) delta_[i] += along / square * choice_.rate[i];
  }

  /// The Jacobian of loops with respect to the delta from a reference.
  void find_jacobian(Starter<M>& starter, const StateOf<M>& state, const Coordinates<M>& reference, Array<M, n * m>& matrix) {
    std::copy_n(starter.jacobian(state), m * n, matrix.begin());
    displacement<Real>(charts(), reference.data(), state.q.data(), scratch_.data());
    ball_tangents<Real>(charts(), scratch_.data(), ball_tangents_.data());
    const Real* T = ball_tangents_.data();
    for (const Chart& chart : charts()) {
      if (!chart.ball) continue;
      Real* columns = matrix.data() + static_cast<std::size_t>(chart.v + chart.scalars) * m;
      for (std::size_t i = 0; i < m; ++i) {
        const Real row[3] = {columns[i], columns[m + i], columns[2 * m + i]};
        for (std::size_t j = 0; j < 3; ++j) columns[j * m + i] = row[0] * T[j] + row[1] * T[3 + j] + row[2] * T[6 + j];
      }
      T += 9;
    }
  }

  /// The Jacobian with respect to dependent coordinates, decomposed.
  dense::LeastSquares<Real> decomposed_by_dependent() {
    std::size_t width = 0;
    for (std::size_t j = 0; j < joints; ++j) {
      if (choice_.independent[j]) continue;
      if (width < j) std::copy_n(matrix_.begin() + j * m, m, matrix_.begin() + width * m);
      scale_column(width, j);
      ++width;
    }
    return decomposed(width);
  }

  dense::LeastSquares<Real> decomposed(std::size_t width = joints) {
    dense::LeastSquares<Real> squares({matrix_.data(), m, width}, order_.data(), left_.data(), beside_.data());
    squares.decompose(Real(1e-7));
    return squares;
  }

  /// The solution of J x = b for dependent coordinates, with independent ones 0.
  template <class Number>
  void solve(const dense::LeastSquares<Real>& squares, Number* b, Number* step, Number* room) const {
    squares.solve(b, step, room);
    std::size_t left = joints - dofs;
    for (std::size_t j = n; j-- > 0;) step[j] = j < joints && !choice_.independent[j] ? Number(step[--left] * nominal(j)) : Number{};
  }

  void solve(const dense::LeastSquares<Real>& squares, Equations<M>& b) { solve(squares, b.data(), step_.data(), scratch_.data()); }

  Fault find_gain(Starter<M>& starter, const StateOf<M>& state, Real& gain) {
    gain = Real(0);
    if constexpr (m > 0) {
      find_jacobian(starter, state, choice_.reference, matrix_);
      all_ = matrix_;
      const auto squares = decomposed_by_dependent();
      if (squares.rank() != joints - dofs) return singular(state);
      for (std::size_t j = 0; j < n; ++j) {
        if (!choice_.independent[j]) continue;
        std::copy_n(all_.begin() + j * m, m, phi_.begin());
        solve(squares, phi_);
        gain = std::max(gain, nominal(j) * Real(largest(step_, nominals())));
      }
    }
    return {};
  }

  Fault close_positions(M& mechanism, Starter<M>& starter, StateOf<M>& state) {
    Real before = std::numeric_limits<Real>::infinity();
    for (int iteration = 0;; ++iteration) {
      retract<Real>(charts(), choice_.reference.data(), delta_.data(), state.q.data());
      if constexpr (m == 0) return {};
      mechanism.constraint_residual(state.q.data(), state.v.data(), phi_.data(), phid_.data());
      const Real violation = largest(phi_);
      find_jacobian(starter, state, choice_.reference, matrix_);
      if (violation <= Real(1e-14) * arm() || (violation <= Real(1e-9) * arm() && !(violation < before / 2))) return {};
      if (iteration == 50 || !(violation < std::numeric_limits<Real>::infinity())) return open_loops(Cause::no_assembly, state, phi_);
      before = violation;
      const auto squares = decomposed_by_dependent();
      if (squares.rank() != joints - dofs) return singular(state);
      solve(squares, phi_);
      const Real share = std::min(Real(1), Real(0.5) * arm() / std::max(Real(largest(step_, nominals())), Real(1e-30)));
      for (std::size_t i = 0; i < n; ++i)
        if (!choice_.independent[i]) delta_[i] -= share * step_[i];
    }
  }

  /// Velocities from the rates of independent coordinates, zero for dependent ones at first; the matrix is that of the pose.
  Fault close_speeds(M& mechanism, StateOf<M>& state) {
    using std::sqrt;
    chart_speeds<Real>(charts(), delta_.data(), rate_.data(), state.v.data());
    if constexpr (m > 0) {
      const auto squares = decomposed_by_dependent();
      if (squares.rank() != joints - dofs) return singular(state);
      mechanism.constraint_residual(state.q.data(), state.v.data(), phi_.data(), phid_.data());
      const Real violation = largest(phid_);
      solve(squares, phid_);
      for (std::size_t i = 0; i < n; ++i)
        if (!choice_.independent[i]) rate_[i] -= step_[i];
      chart_speeds<Real>(charts(), delta_.data(), rate_.data(), state.v.data());
      mechanism.constraint_residual(state.q.data(), state.v.data(), phi_.data(), phid_.data());
      if (!(largest(phid_) <= Real(1e-9) * (sqrt(arm()) + violation))) return open_loops(Cause::speeds_not_found, state, phid_);
    }
    return {};
  }

  static Fault singular(const StateOf<M>& state) { return {.cause = Cause::pose_singular, .t = static_cast<double>(state.t)}; }

  Choice choice_;
  Array<M, n * m> matrix_, all_;
  Array<M, 3 * n> ball_tangents_;
  Speeds<M> delta_, rate_, step_, scratch_, left_, beside_;
  Speeds<M, std::size_t> order_;
  Equations<M> phi_, phid_;
  std::optional<dense::LeastSquares<Real>> squares_;
};

/// Event indicators, which change sign where a mechanism changes mode; for a position along a road the distance to the nearest
/// break, with alternating sign.
template <Sized M>
void event_indicators(M& mechanism, const StateOf<M>& state, const Road<typename M::real_type>* roads, typename M::real_type* values) {
  if constexpr (M::sizes.indicators > 0) {
    mechanism.events(state.q.data(), state.v.data(), values);
    const auto places = indicators_of(mechanism);
    Array<M, M::sizes.indicators> known;
    std::copy_n(values, places.size(), known.begin());
    for (std::size_t i = 0; i < places.size(); ++i) {
      if (places[i].road < 0) continue;
      using Real = typename M::real_type;
      const auto breaks = roads[places[i].road].breaks(places[i].across >= 0 ? known[static_cast<std::size_t>(places[i].across)] : Real(0));
      const auto next = std::upper_bound(breaks.begin(), breaks.end(), known[i]);
      Real way = breaks.empty() ? Real(1) : std::numeric_limits<Real>::max();
      if (next != breaks.end()) way = std::min(way, *next - known[i]);
      if (next != breaks.begin()) way = std::min(way, known[i] - *(next - 1));
      values[i] = (next - breaks.begin()) % 2 ? -way : way;
    }
  }
}

}  // namespace cutjoint
