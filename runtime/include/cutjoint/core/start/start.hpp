// A consistent start: closed loops, speeds that keep them closed, accelerations with their multipliers, static equilibrium.
#pragma once

#include <array>

#include "cutjoint/core/simulation/fault.hpp"
#include "cutjoint/core/start/reactions.hpp"
#include "cutjoint/core/mechanism/retraction.hpp"
#include "cutjoint/core/numbers/selection.hpp"

namespace cutjoint {

/// Which elements of a list the user has given.
template <class M>
using SpeedFlags = Speeds<M, unsigned char>;

/// Accelerations and multipliers of a state: augmented Lagrangian updates until they change by rounding only, at most 200; one evaluation without
/// equations. Lanes are independent. `next`, `correction`: scratch.
template <Mechanism M>
void accelerate(M& mechanism, StateOf<M>& state, typename M::real_type motion, Speeds<M>& next, Equations<M>& correction) {
  using Real = typename M::real_type;
  using Instances = Selection<Real>;
  using std::abs;
  mechanism.begin_step(state.t, motion);
  const std::span<const double> nominals = scaled_nominals_of(mechanism);
  typename Instances::Mask open = Instances::all_if(true);
  Real last(0);
  for (Real& x : state.lambda) Instances::take(Instances::without(open, Instances::finite(x)), Real(0), x);  // of infinite accelerations
  for (int iteration = 0; iteration < (correction.empty() ? 1 : 200) && Instances::any(open); ++iteration) {
    mechanism.evaluate(state.q.data(), state.v.data(), state.lambda.data(), next.data(), correction.data());
    for (std::size_t i = 0; i < correction.size(); ++i) Instances::take(open, state.lambda[i] + correction[i], state.lambda[i]);
    Real change(0), size(1);
    for (std::size_t i = 0; i < next.size(); ++i) {
      const Real nominal(size_at(nominals, i, next.size()));
      change = larger(change, abs(next[i] - state.vdot[i]) / nominal);
      size = larger(size, abs(next[i]) / nominal);
    }
    Instances::take_all(open, next, state.vdot);
    if (iteration > 1) open = Instances::without(open, change <= where(change < last, Real(1e-12), Real(1e-6)) * size);
    last = change;
  }
}

/// The fault of loops that stay open in a state, at the equation with the largest violation.
Fault open_loops(Cause cause, const auto& state, const auto& violation) {
  return {.cause = cause, .list = FaultList::equations, .index = static_cast<int>(index_of_largest(violation, violation.size())),
          .t = static_cast<double>(state.t), .value = static_cast<double>(largest(violation))};
}

/// Finds starts of a mechanism. A `prescribed` velocity (given by the user) does not change, nor does its coordinate. The constructor
/// allocates all memory, except neighbouring states of mechanisms that evaluate several at once (`states_at_once`).
/// Displacements and accelerations in private members are relative to the nominal values of rates (m, m/s2), violations and lengths to the arm.
template <Mechanism M>
class Starter {
 public:
  using Real = typename M::real_type;

  /// Accelerations with the proximal closure do not stabilise open loops: `proximal` lets an equilibrium do so.
  explicit Starter(M& mechanism, bool proximal = false)
      : mechanism_(mechanism), sizes_(sizes_of(mechanism)), n_(sizes_.speeds), m_(sizes_.equations), loop_rows_(proximal ? m_ : 0),
        matrix_((n_ + m_) * n_), phi_(m_), phid_(m_), still_(m_), right_(n_ + m_), a_(n_ + m_), next_(n_ + m_), step_(n_),
        displacement_(n_), scratch_(n_), left_(n_), beside_(n_), order_(n_), correction_(m_), other_accelerations_(n_), from_(sizes_.coordinates), probe_(design_state(mechanism)), other_(probe_),
        reactions_(mechanism) {}

  /// Close the loops from the given coordinates (Gauss-Newton, least-norm steps). A fault names the equation that stays open.
  Fault assemble(StateOf<M>& state, const SpeedFlags<M>& prescribed, Real motion) {
    mechanism_.begin_step(state.t, motion);
    find_residual(state);
    for (int iteration = 0; iteration < 50 && largest(phi_) > Real(1e-14) * arm(); ++iteration) {
      find_jacobian(state, prescribed);
      least_norm(m_, phi_.data());
      move(state, step_.data(), -part_of_step(0.5));
      find_residual(state);
    }
    if (!(largest(phi_) <= Real(1e-9) * arm())) return open_loops(Cause::no_assembly, state, phi_);
    return {};
  }

  /// Close the loops as `assemble` does, or along poses between the design position and the given coordinates if the other coordinates then
  /// move less: from far away, least-norm steps may lead to another assembly.
  Fault assemble_from_design(StateOf<M>& state, const SpeedFlags<M>& prescribed, Real motion) {
    constexpr int stages = 16;
    const StateOf<M>& given = other_ = state;
    const Fault fault = assemble(state, prescribed, motion);
    if (std::find(prescribed.begin(), prescribed.end(), true) == prescribed.end() || std::equal(state.q.begin(), state.q.end(), given.q.begin())) return fault;
    probe_.t = state.t;
    std::fill(probe_.q.begin(), probe_.q.end(), Real(0));
    probe_.set_balls(charts_of(mechanism_));
    for (int stage = 0; stage <= stages; ++stage) {
      interpolate_prescribed(given, Real(stage) / stages, prescribed);
      if (assemble(probe_, prescribed, motion)) return fault;
    }
    if (fault || moves_less(probe_, state)) state.q = probe_.q;
    return {};
  }

  /// Change the velocities that are not prescribed, by the least mean square, so that the loops stay closed.
  Fault make_consistent(StateOf<M>& state, const SpeedFlags<M>& prescribed, Real motion) {
    mechanism_.begin_step(state.t, motion);
    find_jacobian(state, prescribed);
    find_residual(state);
    const Real violation = largest(phid_);
    least_norm(m_, phid_.data());
    for (std::size_t i = 0; i < n_; ++i) state.v[i] -= nominal(i) * step_[i];
    find_residual(state);
    if (!(largest(phid_) <= Real(1e-9) * (Real(std::sqrt(arm_of(mechanism_))) + violation))) return open_loops(Cause::speeds_inconsistent, state, phid_);
    return {};
  }

  /// Mark independent velocities that neither the user nor the loops determine, one per remaining degree of freedom.
  void find_undetermined(const StateOf<M>& state, const SpeedFlags<M>& prescribed, SpeedFlags<M>& undetermined) {
    for (std::size_t i = 0; i < n_; ++i) undetermined[i] = !prescribed[i] && i < sizes_.joint_speeds();
    if (n_ == 0 || m_ == 0) return;
    find_jacobian(state, prescribed);
    const auto squares = decomposed(m_);
    for (std::size_t i = 0; i < squares.rank(); ++i) undetermined[squares.column_at(i)] = false;
  }

  /// A fault if an acceleration is not finite.
  Fault require_finite(const StateOf<M>& state) const {
    for (std::size_t i = 0; i < n_; ++i)
      if (!std::isfinite(static_cast<double>(state.vdot[i])))
        return {.cause = Cause::infinite_acceleration, .list = FaultList::speeds, .index = static_cast<int>(i),
                .t = static_cast<double>(state.t), .value = static_cast<double>(state.vdot[i])};
    return {};
  }

  /// Accelerations and multipliers of the state.
  void accelerate(StateOf<M>& state, Real motion) { cutjoint::accelerate(mechanism_, state, motion, other_accelerations_, correction_); }

  /// The equilibrium near the given pose: Newton's method on vdot(q) = 0 with finite differences and least-norm steps, since directions
  /// without stiffness (a car's x, y and yaw) are free. A prescribed coordinate stays, by a force along it if necessary.
  /// States that stick, whose rates are nearly zero at rest whatever they are, then balance little. A fault names what still accelerates.
  Fault equilibrate(StateOf<M>& state, const SpeedFlags<M>& prescribed) {
    const StateOf<M> begun = state;
    const Fault fault = find_rest(state, prescribed);
    if (fault || n_ == sizes_.joint_speeds()) return fault;
    const bool loaded = std::exchange(has_reactions_, false);
    if (!settle(state, prescribed, begun) && (has_reactions_ = loaded)) settle(state, prescribed, begun);
    return {};
  }

  /// Accelerations, multipliers and `forces` along prescribed coordinates in a pose that `equilibrate` has found.
  void find_reactions(StateOf<M>& state, const SpeedFlags<M>& prescribed, Speeds<M>& forces) {
    accelerate(state, Real(0));
    if (has_reactions_) reactions_.find_reactions(state, prescribed, forces.data());
  }
  bool has_reactions() const { return has_reactions_; }

  /// The Jacobian of the constraints with respect to velocities, (equations, speeds), by columns; `begin_step` has been called for the state's time.
  const Real* jacobian(const StateOf<M>& state) {
    find_jacobian(state, SpeedFlags<M>(n_));
    for (std::size_t j = 0; j < n_; ++j)
      for (std::size_t i = 0; i < m_; ++i) matrix_[j * m_ + i] /= nominal(j);
    return matrix_.data();
  }

 private:
  /// An equilibrium with any values of states that stick.
  Fault find_rest(StateOf<M>& state, const SpeedFlags<M>& prescribed) {
    const StateOf<M> begun = state;
    has_reactions_ = false;
    Fault fault = find_equilibrium(state, prescribed);
    if (!fault && !is_loaded(state, prescribed)) return {};
    const bool holds = std::any_of(prescribed.begin(), prescribed.end(), [](unsigned char given) { return given; });
    if constexpr (!Weighable<M>)
      if (holds) return fault ? fault : not_at_rest_in(state);
    if (holds) {
      state = begun;
      sticks_ = n_ > sizes_.joint_speeds();
      const bool is_held = sticks_ && !find_equilibrium(state, prescribed);
      if (sticks_ = false; is_held) return {};
      has_reactions_ = true;
      state = begun;
      fault = find_equilibrium(state, prescribed);
      if (!fault) return {};
    }
    state = begun;
    if (descend(state, prescribed)) fault = find_equilibrium(state, prescribed);
    if (fault) {
      state = begun;
      patient_ = true;
      fault = find_equilibrium(state, prescribed);
      patient_ = false;
    }
    for (difference_ /= 100; fault && difference_ > Real(1e-10); difference_ /= 100) {
      state = begun;
      if (descend(state, prescribed)) fault = find_equilibrium(state, prescribed);
    }
    difference_ = Real(1e-5);
    for (reach_ = Real(10); fault && reach_ < Real(1000); reach_ *= 10) {  // a motor behind a gear turns far, and moves little
      state = begun;
      if (!find_equilibrium(state, prescribed)) fault = {};
    }
    reach_ = Real(1);
    if (!fault && !is_loaded(state, prescribed)) has_reactions_ = false;
    return fault;
  }

  /// From an equilibrium to one nearby: first with the states that stick as they begin, which is the frictionless rest or the pose with the least
  /// accelerations, then with the least of these states that balances the others; false if there is none. A state sticks if no derivative of its
  /// rate exceeds 1e-3 1/s: a tyre at its limit creeps. One with a time constant above 1000 s counts too; the last steps bring it to its own rest.
  bool settle(StateOf<M>& state, const SpeedFlags<M>& prescribed, const StateOf<M>& begun) {
    const StateOf<M> found = state;
    const std::size_t rows = n_ + loop_rows_, joints = sizes_.joint_speeds();
    Real length = arm();
    sticks_ = true;
    std::fill(displacement_.begin(), displacement_.end(), Real(0));
    for (int iteration = 0; iteration < 40 && length > Real(1e-8) * arm(); ++iteration) {
      find_stiffness(state, prescribed);
      for (std::size_t i = joints; i < n_; ++i) {
        right_[i] = Real(1);
        for (std::size_t j = 0; j < n_; ++j)
          if (!(std::abs(matrix_[j * rows + i]) <= Real(1e-3))) right_[i] = Real(0);
      }
      for (std::size_t i = joints; i < n_; ++i)
        if (right_[i] == Real(1)) state.v[i] = begun.v[i], length = Real(0), std::fill_n(matrix_.data() + i * rows, rows, Real(0));
      if (length > Real(0)) break;  // nothing sticks
      accelerate(state, Real(0));
      rest_residual(state, prescribed, right_.data());
      least_norm(rows, right_.data(), Real(1e-5));  // nothing weaker than springs: it would turn a car across a slope
      length = largest(step_);
      const Real fraction = part_of_step(0.1);
      move(state, step_.data(), -fraction);
      for (std::size_t i = 0; i < n_; ++i) displacement_[i] -= fraction * step_[i];
    }
    const bool rests = length <= Real(1e-8) * arm() && iterate_to_rest(state, prescribed) <= rest_tolerance();
    sticks_ = false;
    if (rests && size_of(displacement_.data(), joints) < arm() / 2) return true;
    state = found;
    return false;
  }

  /// Move prescribed coordinates of the probe by a fraction of their displacement from the design position.
  void interpolate_prescribed(const StateOf<M>& given, Real share, const SpeedFlags<M>& prescribed) {
    using std::sqrt;
    for (const Chart& chart : charts_of(mechanism_)) {
      const auto q = static_cast<std::size_t>(chart.q), v = static_cast<std::size_t>(chart.v), scalars = static_cast<std::size_t>(chart.scalars);
      for (std::size_t i = 0; i < scalars; ++i)
        if (prescribed[v + i]) probe_.q[q + i] = share * given.q[q + i];
      if (!chart.ball || !prescribed[v + scalars]) continue;
      Real square(0);
      for (std::size_t i = q + scalars; i < q + scalars + 4; ++i) {
        probe_.q[i] = share * given.q[i];
        if (i == q + scalars) probe_.q[i] += given.q[i] < Real(0) ? share - Real(1) : Real(1) - share;
        square += probe_.q[i] * probe_.q[i];
      }
      for (std::size_t i = q + scalars; i < q + scalars + 4; ++i) probe_.q[i] /= sqrt(square);
    }
  }

  /// Whether coordinates of one state are closer to the design position than those of another, each relative to itself, whatever its unit.
  bool moves_less(const StateOf<M>& one, const StateOf<M>& other) const {
    using std::abs;
    Real more(0);
    for (const Chart& chart : charts_of(mechanism_))
      for (int i = 0; i < chart.scalars + (chart.ball ? 4 : 0); ++i) {
        if (i == chart.scalars) continue;  // the scalar part of a quaternion
        const Real a = abs(one.q[static_cast<std::size_t>(chart.q + i)]), b = abs(other.q[static_cast<std::size_t>(chart.q + i)]);
        if (a + b > Real(1e-7)) more += (a - b) / (a + b);
      }
    return more < Real(-1e-3);
  }

  static constexpr std::size_t n = static_sizes<M>().speeds, m = static_sizes<M>().equations;

  Real arm() const { return Real(arm_of(mechanism_)); }
  /// That of a rate; a first-order state moves by its nominal value as a length by the arm.
  Real nominal(std::size_t speed) const { return Real(size_at(nominals_of(mechanism_), speed, n_)) / (speed < sizes_.joint_speeds() ? Real(1) : arm()); }

  /// The part of step_ that moves joints by a length relative to the arm at most; states may be far from rest, however large they are.
  Real part_of_step(double most) const {
    return std::min(Real(1), Real(most) * reach_ * arm() / std::max(size_of(step_.data(), sizes_.joint_speeds()), Real(1e-30)));
  }

  /// Accelerations (m/s^2) that count as zero: the effect of rounding of coordinates of size 1 with stiff contacts.
  Real rest_tolerance() const { return std::max(Real(1e-6), rounding_); }

  static Real size_of(const Real* x, std::size_t length) { return largest(std::span<const Real>(x, length)); }

  void find_residual(const StateOf<M>& state) { mechanism_.constraint_residual(state.q.data(), state.v.data(), phi_.data(), phid_.data()); }

  /// The Jacobian of the residual with respect to relative velocities, (equations, speeds), zero for prescribed columns; exact, since the rate is linear. phi_ is then the residual.
  void find_jacobian(const StateOf<M>& state, const SpeedFlags<M>& prescribed) {
    if (m_ == 0) return;
    std::fill(step_.begin(), step_.end(), Real(0));
    mechanism_.constraint_residual(state.q.data(), step_.data(), phi_.data(), still_.data());
    for (std::size_t j = 0; j < n_; ++j) {
      step_[j] = nominal(j);
      mechanism_.constraint_residual(state.q.data(), step_.data(), phi_.data(), phid_.data());
      step_[j] = Real(0);
      for (std::size_t i = 0; i < m_; ++i) matrix_[j * m_ + i] = prescribed[j] ? Real(0) : phid_[i] - still_[i];
    }
  }

  dense::LeastSquares<Real> decomposed(std::size_t rows, Real least = Real(1e-7)) {
    dense::LeastSquares<Real> squares({matrix_.data(), rows, n_}, order_.data(), left_.data(), beside_.data());
    squares.decompose(least);
    return squares;
  }

  /// step_: minimum-norm least-squares solution of matrix step_ = b, a matrix with this many rows; both are overwritten.
  void least_norm(std::size_t rows, Real* b, Real least = Real(1e-7)) {
    std::fill(step_.begin(), step_.end(), Real(0));
    if (rows > 0 && n_ > 0) decomposed(rows, least).solve(b, step_.data(), scratch_.data());
  }

  /// y = A x for the derivative of the accelerations at rest.
  void multiply(const Real* A, const Real* x, Real* y) const {
    const std::size_t rows = n_ + loop_rows_;
    std::fill(y, y + rows, Real(0));
    for (std::size_t j = 0; j < n_; ++j)
      for (std::size_t i = 0; i < rows; ++i) y[i] += A[j * rows + i] * x[j];
  }

  void move(StateOf<M>& state, const Real* step, Real factor) {
    for (std::size_t i = 0; i < n_; ++i) scratch_[i] = factor * (nominal(i) * step[i]);
    for (std::size_t i = sizes_.joint_speeds(); i < n_; ++i) state.v[i] += scratch_[i];
    from_ = state.q;
    retract<Real>(charts_of(mechanism_), from_.data(), scratch_.data(), state.q.data());
  }

  /// Accelerations at rest that are not prescribed, then loop violations times (10 1/s)^2 for an arm of 1 m. `same_pose`: the state has the pose of the last call.
  void rest_residual(const StateOf<M>& state, const SpeedFlags<M>& prescribed, Real* a, bool same_pose = false) {
    for (std::size_t i = 0; i < n_; ++i) a[i] = prescribed[i] && !has_reactions_ && !sticks_ ? Real(0) : state.vdot[i];
    if (has_reactions_) reactions_.constrain(state, prescribed, a, same_pose);
    for (std::size_t i = 0; i < n_; ++i) a[i] /= nominal(i);
    if (loop_rows_ > 0) find_residual(state);
    for (std::size_t i = 0; i < loop_rows_; ++i) a[n_ + i] = Real(100) / arm() * phi_[i];
  }

  /// Derivative of the accelerations at rest with respect to q, by central differences, zero for prescribed columns.
  void find_stiffness(const StateOf<M>& state, const SpeedFlags<M>& prescribed) {
    const std::size_t rows = n_ + loop_rows_;
    const Real h = difference_ * arm();
    const auto put = [&](std::size_t j, const StateOf<M>& forward, const StateOf<M>& backward) {
      Real* column = matrix_.data() + j * rows;
      rest_residual(backward, prescribed, next_.data(), j > sizes_.joint_speeds());
      rest_residual(forward, prescribed, column, j >= sizes_.joint_speeds());  // beside each other in first-order states alone
      for (std::size_t i = 0; i < rows; ++i) column[i] = prescribed[j] ? Real(0) : (column[i] - next_[i]) / (2 * h);
    };
    std::fill(step_.begin(), step_.end(), Real(0));
    if constexpr (requires { M::states_at_once; }) {
      constexpr std::size_t columns = M::states_at_once / 2;
      for (std::size_t first = 0; first < n_; first += columns) {
        std::array<StateOf<M>, M::states_at_once> probes;
        probes.fill(state);
        const std::size_t number = std::min(columns, n_ - first);
        for (std::size_t k = 0; k < number; ++k) {
          step_[first + k] = Real(1);
          move(probes[2 * k], step_.data(), h);
          move(probes[2 * k + 1], step_.data(), -h);
          step_[first + k] = Real(0);
        }
        mechanism_.accelerate(probes, Real(0));
        for (std::size_t k = 0; k < number; ++k) put(first + k, probes[2 * k], probes[2 * k + 1]);
      }
    } else {
      for (std::size_t j = 0; j < n_; ++j) {
        probe_ = other_ = state;
        step_[j] = Real(1);
        move(probe_, step_.data(), h);
        move(other_, step_.data(), -h);
        step_[j] = Real(0);
        accelerate(probe_, Real(0));
        accelerate(other_, Real(0));
        put(j, probe_, other_);
      }
    }
    rounding_ = 4 * std::numeric_limits<Real>::epsilon() * arm() * size_of(matrix_.data(), rows * n_);
  }

  Real square_of(const Real* x) const {
    Real sum(0);
    for (std::size_t i = 0; i < n_ + loop_rows_; ++i) sum += x[i] * x[i];
    return sum;
  }

  /// Newton steps, halved while they do not reduce the accelerations, whose largest is returned; adds the displacement to `displacement_`.
  Real iterate_to_rest(StateOf<M>& state, const SpeedFlags<M>& prescribed) {
    const std::size_t rows = n_ + loop_rows_;
    accelerate(state, Real(0));
    rest_residual(state, prescribed, a_.data());
    Real mark = square_of(a_.data());
    for (int iteration = 0; iteration < 60 && size_of(a_.data(), rows) > Real(1e-9); ++iteration) {
      if (!patient_ && iteration > 0 && iteration % 20 == 0) {
        if (square_of(a_.data()) > mark / 2) break;
        mark = square_of(a_.data());
      }
      find_stiffness(state, prescribed);
      std::copy(a_.begin(), a_.end(), right_.begin());
      least_norm(rows, right_.data());
      const StateOf<M>& start = other_ = state;
      Real fraction = part_of_step(0.1);
      for (int halving = 0; halving < 12; ++halving, fraction /= 2) {
        state = start;
        move(state, step_.data(), -fraction);
        accelerate(state, Real(0));
        rest_residual(state, prescribed, next_.data());
        if (square_of(next_.data()) < square_of(a_.data())) break;
      }
      if (!(square_of(next_.data()) < square_of(a_.data()))) {
        state = start;
        break;
      }
      for (std::size_t i = 0; i < n_; ++i) displacement_[i] -= fraction * step_[i];
      std::copy(next_.begin(), next_.end(), a_.begin());
    }
    return size_of(a_.data(), rows);
  }

  /// Pseudo-transient continuation q' = vdot(q), along which the potential falls: at most 100 implicit Euler steps that grow as accelerations
  /// fall (Kelley, Keyes 1998); false if loops cannot close. Newton's method alone stops where wheels lift off, or where directions
  /// without stiffness rotate accelerations far from rest.
  bool descend(StateOf<M>& state, const SpeedFlags<M>& prescribed) {
    const std::size_t rows = n_ + loop_rows_;
    std::fill_n(state.v.begin(), sizes_.joint_speeds(), Real(0));
    accelerate(state, Real(0));
    rest_residual(state, prescribed, a_.data());
    Real size = size_of(a_.data(), rows), length = Real(0.01) * arm() / std::max(size, rest_tolerance());
    for (int iteration = 0; iteration < 100 && size > rest_tolerance() && length < Real(1000) * arm(); ++iteration) {
      find_stiffness(state, prescribed);
      for (std::size_t i = 0; i < n_; ++i)
        if (!prescribed[i]) matrix_[i * rows + i] -= 1 / length;
      std::copy(a_.begin(), a_.end(), right_.begin());
      least_norm(rows, right_.data(), Real(1e-14));  // of full rank, however stiff a contact is beside what swings freely
      find_descent(state, prescribed);
      if (assemble(state, prescribed, Real(0))) return false;
      accelerate(state, Real(0));
      rest_residual(state, prescribed, a_.data());
      const Real before = std::exchange(size, size_of(a_.data(), rows));
      length *= std::clamp(2 * before / size, Real(0.25), Real(4));
    }
    return true;
  }

  /// Move against `step_`, by a tenth of the arm at most. If a contact then pushes back harder than the step was driven, stop where the force along it has
  /// fallen to a tenth, located by secants and bisection.
  void find_descent(StateOf<M>& state, const SpeedFlags<M>& prescribed) {
    using std::abs;
    Real fraction = part_of_step(0.1), low(0), high = fraction;
    const StateOf<M> start = state;
    const Real begun = driven_by(a_.data());
    Real at_low = begun, at_high(0);
    for (int iteration = 0; iteration < 60; ++iteration) {
      state = start;
      move(state, step_.data(), -fraction);
      accelerate(state, Real(0));
      rest_residual(state, prescribed, next_.data());
      const Real drive = driven_by(next_.data());
      if (iteration == 0 && !(drive < 0 && square_of(next_.data()) > square_of(a_.data()))) return;
      if (abs(drive) <= begun / 10) return;
      (drive > 0 ? low : high) = fraction;
      (drive > 0 ? at_low : at_high) = drive;
      fraction = iteration % 3 == 0 ? (low + high) / 2 : (low * at_high - high * at_low) / (at_high - at_low);
    }
  }

  Real driven_by(const Real* a) const {
    Real sum(0);
    for (std::size_t i = 0; i < n_; ++i) sum -= a[i] * step_[i];
    return sum;
  }

  /// The search for the equilibrium; displacements along directions without stiffness are undone.
  Fault find_equilibrium(StateOf<M>& state, const SpeedFlags<M>& prescribed) {
    std::fill_n(state.v.begin(), sizes_.joint_speeds(), Real(0));
    std::fill(displacement_.begin(), displacement_.end(), Real(0));
    if (!(iterate_to_rest(state, prescribed) <= Real(1))) return not_at_rest(a_.data(), n_ + loop_rows_);
    // Finite differences give free directions to a few digits, so the steps have drifted along them.
    find_stiffness(state, prescribed);
    multiply(matrix_.data(), displacement_.data(), right_.data());
    least_norm(n_ + loop_rows_, right_.data());
    for (std::size_t i = 0; i < n_; ++i) step_[i] = displacement_[i] - step_[i];
    move(state, step_.data(), Real(-1));
    return iterate_to_rest(state, prescribed) <= rest_tolerance() ? Fault{} : not_at_rest(a_.data(), n_ + loop_rows_);
  }

  /// Whether a prescribed coordinate would accelerate if it were released.
  bool is_loaded(const StateOf<M>& state, const SpeedFlags<M>& prescribed) const {
    using std::abs;
    for (std::size_t i = 0; i < n_; ++i)
      if (prescribed[i] && !(abs(state.vdot[i]) <= rest_tolerance() * nominal(i))) return true;
    return false;
  }

  Fault not_at_rest_in(const StateOf<M>& state) {
    for (std::size_t i = 0; i < n_; ++i) a_[i] = state.vdot[i] / nominal(i);
    return not_at_rest(a_.data(), n_);
  }

  Fault not_at_rest(const Real* a, std::size_t length) const {
    const std::size_t worst = index_of_largest(a, length);
    const bool open = worst >= n_;
    const Real unit = open ? Real(1) : nominal(worst);
    return {.cause = Cause::no_equilibrium, .list = open ? FaultList::equations : worst < sizes_.joint_speeds() ? FaultList::speeds : FaultList::states,
            .index = static_cast<int>(open ? worst - n_ : worst), .t = 0, .value = static_cast<double>(unit * size_of(a, length))};
  }

  M& mechanism_;
  Sizes sizes_;
  std::size_t n_, m_, loop_rows_;
  Array<M, (n + m) * n> matrix_;
  Equations<M> phi_, phid_, still_;
  Array<M, n + m> right_, a_, next_;
  Speeds<M> step_, displacement_, scratch_, left_, beside_;
  Speeds<M, std::size_t> order_;
  Equations<M> correction_;
  Speeds<M> other_accelerations_;
  Coordinates<M> from_;
  StateOf<M> probe_, other_;
  RestReactions<M> reactions_;
  bool has_reactions_ = false, sticks_ = false;  ///< whether forces hold prescribed coordinates, or states that stick do
  Real rounding_{0};  ///< of accelerations, by their derivatives
  Real difference_{1e-5};      ///< length of differences relative to the arm: shorter than the deflection of a stiff contact
  Real reach_{1};  ///< factor of the largest step of the search
  bool patient_ = false;  ///< whether the search continues while its residual does not fall
};

}  // namespace cutjoint
