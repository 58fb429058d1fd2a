// Derivatives of a motion and of its outputs with respect to independent coordinates, their rates and inputs.
#pragma once

#include "cutjoint/core/derivatives/residual_jacobian.hpp"
#include "cutjoint/core/roads/dual_road.hpp"
#include "cutjoint/core/inputs/input_trajectories.hpp"
#include "cutjoint/core/mechanism/minimal.hpp"

namespace cutjoint {

/// Derivatives about the present state of a `Simulation` by generated code over dual numbers: the mechanism D, and S, which reports outputs; S is
/// D for a method without a system.
///
/// x = (z, z', first-order states) with minimal coordinates z.  Along a seed of x and of inputs u the dependent coordinates keep the loops closed,
/// J_d dz_d = -(J dz + dPhi/du du), and their rates keep the residual's rate zero.  Derivatives of accelerations and multipliers are those of the
/// `ForceResidual`.  Values that controllers hold are constant.
template <class Simulation, Sized D, Sized S, std::size_t dofs, class ForceResidual>
class Derivatives {
 public:
  using M = typename Simulation::Mechanism;
  using Minimal = MinimalCoordinates<M, dofs>;

  static constexpr std::size_t states = 2 * dofs + M::sizes.states, inputs = M::sizes.inputs, columns = S::sizes.columns;

  /// Directional derivatives of x' and outputs y.  The seed has `states` numbers of x, value, rate and acceleration of each input, and parameters; a null
  /// pointer counts as zero.
  Fault along(Simulation& simulation, Minimal& minimal, const double* dx, const double* du, const double* dp, double* dxdot, double* dy) {
    if (const Fault fault = begin(simulation, minimal)) return fault;
    for (std::size_t i = 0; dp && i < parameters_.size(); ++i) parameters_[i].derivative[0] = dp[i];
    if (dp) load_parameters(simulation);
    for (std::size_t i = 0; dx && i < states; ++i) dx_[i].derivative[0] = dx[i];
    for (std::size_t i = 0; du && i < du_.size(); ++i) du_[i].derivative[0] = du[i];
    if (const Fault fault = derive(minimal)) return fault;
    for (std::size_t i = 0; i < states; ++i) dxdot[i] = dxdot_[i].derivative[0];
    for (std::size_t i = 0; i < columns; ++i) dy[i] = columns_[i].derivative[0];
    return {};
  }

  /// x' = A x + B u, y = C x + D u by values of inputs; matrices by rows, a null pointer where one is not wanted.
  Fault linearise(Simulation& simulation, Minimal& minimal, double* A, double* B, double* C, double* D_) {
    return derive_columns(simulation, minimal, 0, {{{A, C, states}, {B, D_, inputs}}});
  }

  /// The terms of input rates and accelerations, x' = B_rate u' + B_acceleration u'' and likewise y, each of the size of B or D.  They are zero
  /// without guides.
  Fault linearise_rates(Simulation& simulation, Minimal& minimal, double* B_rate, double* B_acceleration, double* D_rate, double* D_acceleration) {
    return derive_columns(simulation, minimal, after, {{{B_rate, D_rate, inputs}, {B_acceleration, D_acceleration, inputs}}});
  }

  /// x' = E p, y = F p by parameters.
  Fault linearise_parameters(Simulation& simulation, Minimal& minimal, double* E, double* F) {
    return derive_columns(simulation, minimal, states + inputs, {{{E, F, M::sizes.parameters}, {}}});
  }

 protected:
  static constexpr std::size_t n = M::sizes.speeds, m = M::sizes.equations, joints = M::sizes.joint_speeds();
  static constexpr bool has_system = !std::is_same_v<D, S>;
  static constexpr std::size_t exogenous = numbers_per_input * inputs + M::sizes.discrete;  ///< numbers of inputs, and values that controllers hold, which change only along runs

  struct None {};

  /// Matrices of derivatives of x' and y by so many numbers, a column for each; a null pointer if not wanted.
  struct Columns {
    double *of_rates, *of_outputs;
    std::size_t width;

    bool are_wanted() const { return of_rates || of_outputs; }
  };

  /// Derivatives with respect to numbers of the list from one on: states, inputs, parameters, rates of inputs, accelerations of inputs.
  Fault derive_columns(Simulation& simulation, Minimal& minimal, const std::size_t first, const std::array<Columns, 2>& matrices) {
    if (const Fault fault = begin(simulation, minimal)) return fault;
    const std::size_t middle = first + matrices[0].width, end = middle + (matrices[1].are_wanted() ? matrices[1].width : 0);
    for (std::size_t from = matrices[0].are_wanted() ? first : middle; from < end; from += seeds_at_once) {
      const std::size_t number = std::min(seeds_at_once, end - from);
      dx_.fill(Dual());
      du_.fill(Dual());
      for (Dual& x : parameters_) x.derivative = Tangents{};
      for (std::size_t k = 0, j = from; k < number; ++k, ++j) number_at(j).derivative[k] = 1.0;
      if (from < after && from + number > states + inputs) load_parameters(simulation);
      if (const Fault fault = derive(minimal)) return fault;
      for (std::size_t k = 0, j = from; k < number; ++k, ++j) {
        const Columns& to = matrices[j < middle ? 0 : 1];
        const std::size_t column = j - (j < middle ? first : middle);
        for (std::size_t i = 0; to.of_rates && i < states; ++i) to.of_rates[i * to.width + column] = dxdot_[i].derivative[k];
        for (std::size_t i = 0; to.of_outputs && i < columns; ++i) to.of_outputs[i * to.width + column] = columns_[i].derivative[k];
      }
    }
    for (Dual& x : parameters_) x.derivative = Tangents{};
    return {};
  }

  static constexpr std::size_t after = states + inputs + M::sizes.parameters;  ///< numbers of the list before rates of inputs

  Dual& number_at(std::size_t j) {
    if (j < states) return dx_[j];
    if (j < states + inputs) return du_[numbers_per_input * (j - states)];
    if (j < after) return parameters_[j - states - inputs];
    constexpr std::size_t each = inputs > 0 ? inputs : 1;
    return du_[numbers_per_input * ((j - after) % each) + 1 + (j - after) / each];
  }

  static std::span<const Chart> charts() { return M::charts; }

  /// Prepare at the present state.
  Fault begin(Simulation& simulation, Minimal& minimal) {
    load(simulation, minimal);
    dx_.fill(Dual());
    du_.fill(Dual());
    if (!enter(simulation.mechanism(), simulation.complete_state())) return not_finite();
    return minimal.decompose(simulation.starter(), *state_);
  }

  /// Copy everything but states from a simulation; derivatives of parameters are zero.
  void load(Simulation& simulation, const Minimal& minimal) {
    std::copy(simulation.parameters().begin(), simulation.parameters().end(), parameters_.begin());
    std::copy(simulation.penalties().begin(), simulation.penalties().end(), penalties_.begin());
    ddiscrete_.fill(Dual());
    for (std::size_t i = 0; i < M::sizes.roads; ++i) roads_[i] = Road<Dual>(simulation.roads()[i]);
    force_residual_.load(simulation);
    load_parameters(simulation);
    if constexpr (exogenous > 0) {
      mechanism_.drive_by({&fill, this});
      if constexpr (has_system) system_.drive_by({&fill, this});
      force_residual_.drive_by(plain_inputs());
    }
    std::copy(minimal.choice().reference.begin(), minimal.choice().reference.end(), reference_.begin());
  }

  void load_parameters(Simulation& simulation) {
    load_mechanism(mechanism_, parameters_.data(), roads_.data(), simulation.stabilisation(), penalties_);
    if constexpr (has_system) system_.load(parameters_.data(), roads_.data());
    force_residual_.load_changes(parameters_.data(), roads_.data(), simulation.stabilisation(), penalties_);
  }

  /// Go to a state; the mechanism is at its time. False if an acceleration is not finite.
  bool enter(M& mechanism, const StateOf<M>& state) {
    state_ = &state;
    take_inputs(mechanism);
    violation_.fill(0.0);
    return find_values(mechanism);
  }

  /// Inputs at the mechanism's time, and their derivatives.
  void take_inputs([[maybe_unused]] M& mechanism) {
    if constexpr (exogenous > 0) std::copy_n(mechanism.last_inputs(), u_.size(), u_.begin());
    if constexpr (inputs > 0)
      if (trajectories_ && along_.number > 0) {
        du_ = shift_;
        trajectories_->add_changes(along_.first, along_.number, du_);
      }
  }

  /// From now on add the derivatives of input trajectories along these seeds to the shifts of inputs.
  void change_trajectories(std::size_t first, std::size_t number) {
    along_ = {first, number};
    shift_ = du_;
  }

  Fault not_finite() const { return {.cause = Cause::accelerations_not_finite, .t = state_->t}; }

  static void fill(void* self, Dual t, Dual* input) {
    const Derivatives& x = *static_cast<const Derivatives*>(self);
    for (std::size_t i = 0; i < x.du_.size(); ++i) {
      Tangents by_time{};
      if ((i + 1) % std::size_t{numbers_per_input} != 0) by_time = x.u_[i + 1] * t.derivative;
      else if (const double* const jerk = x.trajectories_ ? x.trajectories_->jerk(i - 2) : nullptr) by_time = *jerk * t.derivative;
      else if (input[i].value == x.u_[i])  // an acceleration by the law of the scene; others are constant
        for (std::size_t k = 0; k < seeds_at_once; ++k) by_time[k] = t.derivative[k] == 0.0 ? 0.0 : input[i].derivative[k];
      input[i] = {x.u_[i], x.du_[i].derivative + by_time};
    }
    for (std::size_t i = 0; i < M::sizes.discrete; ++i) input[x.du_.size() + i] = {x.u_[x.du_.size() + i], x.ddiscrete_[i]};
  }

  /// The source of inputs as they were taken.
  InputSource<double> plain_inputs() {
    return {[](void* self, double, double* input) { std::ranges::copy(static_cast<const Derivatives*>(self)->u_, input); }, this};
  }

  /// Derivatives along the seeds.
  Fault derive(Minimal& minimal) {
    if (!derive_motion(minimal)) return not_finite();
    chart_accelerations<Dual>(charts(), delta_.data(), v_.data(), vdot_.data(), second_.data());
    gather_derivatives(rate_, minimal, dxdot_.data());
    gather_derivatives(second_, minimal, dxdot_.data() + dofs);
    for (std::size_t i = 0; i < M::sizes.states; ++i) dxdot_[2 * dofs + i] = vdot_[joints + i];
    report(state_->t);
    return {};
  }

  /// The stepped subject over dual numbers.
  auto& subject() {
    if constexpr (has_system) return system_;
    else return mechanism_;
  }

  /// Outputs of the state with their derivatives; the mechanism is at its time.
  void report(const Dual& t) {
    if constexpr (has_system) system_.begin_step(t, 1.0);
    subject().report(q_.data(), v_.data(), vdot_.data(), lambda_.data(), columns_.data());
  }

  /// Derivatives of coordinates, velocities and accelerations; false if one is not finite.
  bool derive_motion(Minimal& minimal) {
    set_dual_time(state_->t);
    find_coordinates(minimal);
    find_speeds(minimal);
    return find_accelerations();
  }

  /// Set the time of both mechanisms, and of that over dual numbers.
  void set_time(M& mechanism, const Dual& t) {
    mechanism.begin_step(t.value, 1.0);
    take_inputs(mechanism);
    set_dual_time(t);
  }
  void set_dual_time(const Dual& t) {
    dt_ = t.derivative;
    mechanism_.begin_step(t, 1.0);
  }

  /// Inputs and values that controllers hold, with their derivatives at that time.
  std::span<const Dual> dual_inputs() const {
    if constexpr (exogenous > 0) return {mechanism_.last_inputs(), exogenous};
    return {};
  }

  /// Coordinates with derivatives that keep the loops closed.
  void find_coordinates(Minimal& minimal) {
    displacement<double>(charts(), minimal.choice().reference.data(), state_->q.data(), values_.data());
    scatter_derivatives(dx_.data(), minimal, delta_);
    retract<Dual>(charts(), reference_.data(), delta_.data(), q_.data());
    if constexpr (m > 0) {
      std::copy(state_->v.begin(), state_->v.end(), v_.begin());
      mechanism_.constraint_residual(q_.data(), v_.data(), phi_.data(), phid_.data());
      close_loops_jvp(phi_, minimal, delta_);
      retract<Dual>(charts(), reference_.data(), delta_.data(), q_.data());
    }
  }

  /// Velocities with derivatives that do.
  void find_speeds(Minimal& minimal) {
    for (std::size_t i = 0; i < M::sizes.states; ++i) v_[joints + i] = {state_->v[joints + i], dx_[2 * dofs + i]};
    for (std::size_t i = 0; i < n; ++i) place_[i] = delta_[i].value;
    chart_rates<double>(charts(), place_.data(), state_->v.data(), values_.data());
    scatter_derivatives(dx_.data() + dofs, minimal, rate_);
    chart_speeds<Dual>(charts(), delta_.data(), rate_.data(), v_.data());
    if constexpr (m > 0) {
      mechanism_.constraint_residual(q_.data(), v_.data(), phi_.data(), phid_.data());
      close_loops_jvp(phid_, minimal, rate_);
      chart_speeds<Dual>(charts(), delta_.data(), rate_.data(), v_.data());
    }
  }

  /// Accelerations and multipliers at the fixed point of the augmented update; false if one is not finite.  The update reduces errors by a factor, and magnifies
  /// rounding of multipliers by its inverse.  The relative error of multipliers is the last relative change of accelerations; that of accelerations is smaller by
  /// the factor.  The iteration ends when that is below rounding, or after three updates without a smaller change.
  bool find_values(M& mechanism) {
    constexpr double most = std::numeric_limits<double>::max();
    std::copy(state_->lambda.begin(), state_->lambda.end(), lambda_value_.begin());
    std::copy(state_->vdot.begin(), state_->vdot.end(), vdot_value_.begin());
    double factor = 1.0, share = 0.0, least = std::numeric_limits<double>::infinity();
    const bool is_known = visited > 2 && force_residual_.recall(state_->t, state_->q, state_->v, u_, vdot_value_, lambda_value_);  // by other seeds
    if (is_known) violation_.fill(0.0);
    for (int iteration = 0, stalled = 0; iteration < (is_known ? 0 : m == 0 ? 1 : 200) && stalled < 3; ++iteration) {
      std::copy(vdot_value_.begin(), vdot_value_.end(), vdot_change_.begin());
      for (std::size_t i = 0; i < m; ++i) lambda_value_[i] += violation_[i];
      mechanism.evaluate(state_->q.data(), state_->v.data(), lambda_value_.data(), vdot_value_.data(), violation_.data());
      for (std::size_t i = 0; i < n; ++i) vdot_change_[i] -= vdot_value_[i];
      const double before = share, size = largest(vdot_value_);
      share = largest(vdot_change_);
      if (share > 0.0 && size > 0.0) share /= size;  // accelerations may be zero
      if (before > 0.0 && share < before) factor = factor < 1.0 ? std::max(factor, share / before) : share / before;
      if (share == 0.0 || share * factor <= std::numeric_limits<double>::epsilon() || !(share <= most)) break;
      stalled = share < least ? 0 : stalled + 1;
      least = std::min(least, share);
    }
    for (std::size_t i = 0; i < n; ++i) vdot_[i] = vdot_value_[i];
    for (std::size_t i = 0; i < m; ++i) lambda_[i] = lambda_value_[i], lambda_update_[i] = violation_[i];
    return share <= most;
  }

  /// Their derivatives by the force residual; false if one is not finite or the mass matrix is singular.
  bool find_accelerations() { return solve_force_residual() || force_residual_.without_infinite([this] { return solve_force_residual(); }); }

  bool solve_force_residual() {
    typename ForceResidual::Changes change;
    for (std::size_t i = 0; i < m; ++i) lambda_scratch_[i] = lambda_value_[i] + lambda_update_[i];
    force_residual_.find(state_->t, state_->q, state_->v, vdot_value_, lambda_scratch_, u_);
    if (!force_residual_.solve(q_, v_, dual_inputs(), change, dt_)) return false;
    for (std::size_t i = 0; i < n; ++i) vdot_[i] = {vdot_value_[i], change[i].derivative};
    for (std::size_t i = 0; i < m; ++i) lambda_[i] = {lambda_scratch_[i], change[n + i].derivative};
    return true;
  }

  /// Give these derivatives to independent coordinates, and zero to dependent ones.
  void scatter_derivatives(const Dual* derivatives, Minimal& minimal, Fixed<Dual, n>& numbers) {
    scratch_.fill(Dual());
    minimal.take(derivatives, scratch_);
    for (std::size_t i = 0; i < n; ++i) numbers[i] = {values_[i], scratch_[i]};
  }

  void gather_derivatives(const Fixed<Dual, n>& numbers, Minimal& minimal, Dual* derivatives) {
    for (std::size_t i = 0; i < n; ++i) scratch_[i] = numbers[i];
    minimal.put(scratch_, derivatives);
  }

  /// Derivatives of dependent coordinates such that the constraint violations vanish.
  void close_loops_jvp(const Fixed<Dual, m>& violations, Minimal& minimal, Fixed<Dual, n>& numbers) {
    Fixed<DualPart, m> left;
    Fixed<DualPart, n> step, room;
    for (std::size_t i = 0; i < m; ++i) left[i].derivative = violations[i].derivative;
    minimal.solve(left.data(), step.data(), room.data());
    for (std::size_t i = 0; i < n; ++i) numbers[i].derivative -= step[i].derivative;
  }

  const StateOf<typename Simulation::Subject>* state_ = nullptr;  ///< the present state, with its accelerations and multipliers
  D mechanism_;
  static constexpr std::size_t visited = [] {  ///< states of a step that are kept for other seeds: of an explicit one with few stages all
    if constexpr (requires { typename Simulation::Steps::Method; }) return Simulation::Steps::Method::stages <= 8 ? Simulation::Steps::Method::stages : 2;
    return std::size_t{2};
  }();
  typename ForceResidual::template Keeping<visited> force_residual_;
  Tangents dt_{};  ///< derivatives of the time
  [[no_unique_address]] std::conditional_t<has_system, S, None> system_;
  Fixed<Dual, M::sizes.parameters> parameters_;
  Fixed<Dual, M::sizes.cuts> penalties_;
  Fixed<Road<Dual>, M::sizes.roads> roads_;
  Fixed<Dual, states> dx_, dxdot_;
  Fixed<double, exogenous> u_;
  Fixed<Dual, numbers_per_input * inputs> du_, shift_;
  InputTrajectories<inputs>* trajectories_ = nullptr;
  struct {
    std::size_t first = 0, number = 0;
  } along_;  ///< seeds of trajectories
  Fixed<Dual, M::sizes.discrete> ddiscrete_;
  Fixed<Dual, M::sizes.coordinates> reference_, q_;
  Fixed<Dual, n> delta_, rate_, second_, v_, vdot_;
  Fixed<Dual, m> phi_, phid_, lambda_;
  Fixed<Dual, columns> columns_;
  Fixed<double, n> values_, place_, vdot_value_, vdot_change_;
  Fixed<Dual, n> scratch_, step_;
  Fixed<double, m> violation_, lambda_update_, lambda_value_, lambda_scratch_;
};

}  // namespace cutjoint
