// Derivatives of a motion and of its outputs by independent coordinates, their rates and inputs.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>
#include <type_traits>

#include "cutjoint/core/arrays.hpp"
#include "cutjoint/core/dual.hpp"
#include "cutjoint/core/fault.hpp"
#include "cutjoint/core/inputs.hpp"
#include "cutjoint/core/mechanism.hpp"
#include "cutjoint/core/minimal.hpp"
#include "cutjoint/core/retraction.hpp"
#include "cutjoint/core/stabilisation.hpp"
#include "cutjoint/core/start.hpp"
#include "cutjoint/core/state.hpp"

namespace cutjoint {

/// Derivatives about the present state of a `Simulation` by generated code over dual numbers: the mechanism D, and S, which reports, of a method
/// without a system the same.
///
/// x = (z, z') are minimal coordinates, behind them first-order states.  Along a direction of x and of inputs u the dependent coordinates
/// change so that loops stay closed, J_d dz_d = -(J dz + dPhi/du du).  Their rates follow from the residual's rate, which stays zero,
/// accelerations and multipliers from the fixed point of the augmented update, taken for their derivatives.  What controllers hold stays.
template <class Simulation, Sized D, Sized S, std::size_t freedoms>
class Derivatives {
 public:
  using M = typename Simulation::Mechanism;
  using Minimal = MinimalCoordinates<M, freedoms>;

  static constexpr std::size_t states = 2 * freedoms + M::sizes.states, inputs = M::sizes.inputs, columns = S::sizes.columns;

  /// Derivatives x' and outputs y along a direction: `states` numbers of x, and of each input its value, rate and acceleration.
  Fault along(Simulation& simulation, Minimal& minimal, const double* dx, const double* du, double* dxdot, double* dy) {
    if (const Fault fault = begin(simulation, minimal)) return fault;
    std::copy_n(dx, states, dx_.begin());
    std::copy_n(du, du_.size(), du_.begin());
    if (const Fault fault = derive(minimal)) return fault;
    std::copy_n(dxdot_.begin(), states, dxdot);
    for (std::size_t i = 0; i < columns; ++i) dy[i] = columns_[i].slope;
    return {};
  }

  /// x' = A x + B u, y = C x + D u by values of inputs; matrices by rows.
  Fault linearise(Simulation& simulation, Minimal& minimal, double* A, double* B, double* C, double* D_) {
    if (const Fault fault = begin(simulation, minimal)) return fault;
    for (std::size_t j = 0; j < states + inputs; ++j) {
      dx_.fill(0.0);
      du_.fill(0.0);
      const bool by_state = j < states;
      const std::size_t column = by_state ? j : j - states, width = by_state ? states : inputs;
      (by_state ? dx_[column] : du_[numbers_per_input * column]) = 1.0;
      if (const Fault fault = derive(minimal)) return fault;
      for (std::size_t i = 0; i < states; ++i) (by_state ? A : B)[i * width + column] = dxdot_[i];
      for (std::size_t i = 0; i < columns; ++i) (by_state ? C : D_)[i * width + column] = columns_[i].slope;
    }
    return {};
  }

 private:
  static constexpr std::size_t n = M::sizes.speeds, m = M::sizes.equations, joints = M::sizes.joint_speeds();
  static constexpr bool has_system = !std::is_same_v<D, S>;
  static constexpr std::size_t given = numbers_per_input * inputs + M::sizes.held;  ///< numbers of inputs, and what controllers hold, which stays

  struct None {};

  static std::span<const Chart> charts() { return M::charts; }

  /// Get ready at the present state.
  Fault begin(Simulation& simulation, Minimal& minimal) {
    Starter<M>& starter = simulation.starter();
    state_ = &simulation.complete_state();
    if constexpr (given > 0) std::copy_n(simulation.mechanism().last_inputs(), u_.size(), u_.begin());
    std::copy(simulation.parameters().begin(), simulation.parameters().end(), parameters_.begin());
    std::copy(simulation.penalties().begin(), simulation.penalties().end(), penalties_.begin());
    for (std::size_t i = 0; i < M::sizes.roads; ++i) roads_[i] = Road<Dual>(simulation.roads()[i]);
    load_mechanism(mechanism_, parameters_.data(), roads_.data(), simulation.stabilisation(), penalties_);
    if constexpr (has_system) system_.load(parameters_.data(), roads_.data());
    if constexpr (given > 0) {
      mechanism_.drive_by({&fill, this});
      if constexpr (has_system) system_.drive_by({&fill, this});
    }
    std::copy(minimal.choice().reference.begin(), minimal.choice().reference.end(), reference_.begin());
    return minimal.decompose(starter, *state_);
  }

  static void fill(void* self, Dual, Dual* input) {
    const Derivatives& x = *static_cast<const Derivatives*>(self);
    for (std::size_t i = 0; i < given; ++i) input[i] = {x.u_[i], i < x.du_.size() ? x.du_[i] : 0.0};
  }

  /// Along the direction that is given.
  Fault derive(Minimal& minimal) {
    mechanism_.begin_step(state_->t, 1.0);
    find_coordinates(minimal);
    find_speeds(minimal);
    if (!find_accelerations()) return {.cause = Cause::accelerations_not_finite, .t = state_->t};
    chart_accelerations<Dual>(charts(), delta_.data(), v_.data(), vdot_.data(), second_.data());
    take_slopes(rate_, minimal, dxdot_.data());
    take_slopes(second_, minimal, dxdot_.data() + freedoms);
    for (std::size_t i = 0; i < M::sizes.states; ++i) dxdot_[2 * freedoms + i] = vdot_[joints + i].slope;
    if constexpr (has_system) {
      system_.begin_step(state_->t, 1.0);
      system_.report(q_.data(), v_.data(), vdot_.data(), lambda_.data(), columns_.data());
    } else {
      mechanism_.report(q_.data(), v_.data(), vdot_.data(), lambda_.data(), columns_.data());
    }
    return {};
  }

  /// Coordinates whose loops stay closed.
  void find_coordinates(Minimal& minimal) {
    displacement<double>(charts(), minimal.choice().reference.data(), state_->q.data(), values_.data());
    give_slopes(dx_.data(), minimal, delta_);
    retract<Dual>(charts(), reference_.data(), delta_.data(), q_.data());
    if constexpr (m > 0) {
      std::copy(state_->v.begin(), state_->v.end(), v_.begin());
      mechanism_.constraint_residual(q_.data(), v_.data(), phi_.data(), phid_.data());
      follow_loops(phi_, minimal, delta_);
      retract<Dual>(charts(), reference_.data(), delta_.data(), q_.data());
    }
  }

  /// Speeds that keep them closed.
  void find_speeds(Minimal& minimal) {
    for (std::size_t i = 0; i < M::sizes.states; ++i) v_[joints + i] = {state_->v[joints + i], dx_[2 * freedoms + i]};
    for (std::size_t i = 0; i < n; ++i) room_[i] = delta_[i].value;
    chart_rates<double>(charts(), room_.data(), state_->v.data(), values_.data());
    give_slopes(dx_.data() + freedoms, minimal, rate_);
    chart_speeds<Dual>(charts(), delta_.data(), rate_.data(), v_.data());
    if constexpr (m > 0) {
      mechanism_.constraint_residual(q_.data(), v_.data(), phi_.data(), phid_.data());
      follow_loops(phid_, minimal, rate_);
      chart_speeds<Dual>(charts(), delta_.data(), rate_.data(), v_.data());
    }
  }

  /// The augmented update, until the accelerations and their derivatives come no closer; false where one is no number.
  bool find_accelerations() {
    std::copy(state_->lambda.begin(), state_->lambda.end(), lambda_.begin());
    std::copy(state_->vdot.begin(), state_->vdot.end(), vdot_.begin());
    double least = std::numeric_limits<double>::infinity();
    for (int iteration = 0, stalled = 0; iteration < 200 && stalled < 3; ++iteration) {
      before_ = vdot_;
      mechanism_.evaluate(q_.data(), v_.data(), lambda_.data(), vdot_.data(), correction_.data());
      for (std::size_t i = 0; i < m; ++i) lambda_[i] += correction_[i];
      Change value, slope;
      for (std::size_t i = 0; i < n; ++i) {
        value.add(before_[i].value, vdot_[i].value);
        slope.add(before_[i].slope, vdot_[i].slope);
      }
      if (!(slope.size - slope.size == 0.0)) return false;
      const double share = std::max(value.share(), slope.share());
      if (m == 0 || share == 0.0) break;
      stalled = share < least ? 0 : stalled + 1;
      least = std::min(least, share);
    }
    return true;
  }

  /// The largest change of numbers, and the largest of these; not a number where one is none.
  struct Change {
    double largest = 0.0, size = 0.0;

    void add(double before, double now) {
      largest = std::max(largest, std::abs(now - before));
      if (size == size && !(std::abs(now) <= size)) size = std::abs(now);
    }

    double share() const { return largest > 0.0 ? largest / size : 0.0; }
  };

  /// Numbers with these slopes of independent ones, and none of others.
  void give_slopes(const double* slopes, Minimal& minimal, Fixed<Dual, n>& numbers) {
    room_.fill(0.0);
    minimal.take(slopes, room_);
    for (std::size_t i = 0; i < n; ++i) numbers[i] = {values_[i], room_[i]};
  }

  void take_slopes(const Fixed<Dual, n>& numbers, Minimal& minimal, double* slopes) {
    for (std::size_t i = 0; i < n; ++i) room_[i] = numbers[i].slope;
    minimal.put(room_, slopes);
  }

  /// Slopes of dependent ones that close gaps of the loops.
  void follow_loops(const Fixed<Dual, m>& gaps, Minimal& minimal, Fixed<Dual, n>& numbers) {
    for (std::size_t i = 0; i < m; ++i) gap_[i] = gaps[i].slope;
    const Fixed<double, n>& step = minimal.solve(gap_);
    for (std::size_t i = 0; i < n; ++i) numbers[i].slope -= step[i];
  }

  const StateOf<typename Simulation::Subject>* state_ = nullptr;  ///< the present one, with its accelerations and multipliers
  D mechanism_;
  [[no_unique_address]] std::conditional_t<has_system, S, None> system_;
  Fixed<Dual, M::sizes.parameters> parameters_;
  Fixed<Dual, M::sizes.cuts> penalties_;
  Fixed<Road<Dual>, M::sizes.roads> roads_;
  Fixed<double, states> dx_, dxdot_;
  Fixed<double, given> u_;
  Fixed<double, numbers_per_input * inputs> du_;
  Fixed<Dual, M::sizes.coordinates> reference_, q_;
  Fixed<Dual, n> delta_, rate_, second_, v_, vdot_, before_;
  Fixed<Dual, m> phi_, phid_, lambda_, correction_;
  Fixed<Dual, columns> columns_;
  Fixed<double, n> values_, room_;
  Fixed<double, m> gap_;
};

}  // namespace cutjoint
