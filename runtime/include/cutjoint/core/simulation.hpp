// One simulation of a mechanism whose class knows its sizes: all its memory is inside, it throws nothing and prints nothing.
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <optional>

#include "cutjoint/core/arrays.hpp"
#include "cutjoint/core/fault.hpp"
#include "cutjoint/core/initialisation.hpp"
#include "cutjoint/core/inputs.hpp"
#include "cutjoint/core/mechanism.hpp"
#include "cutjoint/core/retraction.hpp"
#include "cutjoint/core/road.hpp"
#include "cutjoint/core/stabilisation.hpp"
#include "cutjoint/core/state.hpp"
#include "cutjoint/core/trapezoidal.hpp"

namespace cutjoint {

/// What a simulation needs to know besides its parameters.
struct SimulationSettings {
  StabilisationSettings stabilisation;
  FixedPoint fixed_point;
  double dt;
  bool equilibrium;
};

/// What a host gives of its inputs: value, rate and acceleration at a time, from which on an input goes on like that.  An input whose value is no
/// number follows the scene.
template <class Real, std::size_t n>
struct HostInputs {
  Fixed<Real, n> values, rates, accelerations, times;

  HostInputs() { values.fill(std::numeric_limits<Real>::quiet_NaN()); }

  static void fill(void* host, Real t, Real* input) {
    const HostInputs& given = *static_cast<const HostInputs*>(host);
    for (std::size_t i = 0; i < n; ++i, input += numbers_per_input) {
      if (!(given.values[i] == given.values[i])) continue;
      const Real since = t - given.times[i];
      input[0] = given.values[i] + since * (given.rates[i] + since / 2 * given.accelerations[i]);
      input[1] = given.rates[i] + since * given.accelerations[i];
      input[2] = given.accelerations[i];
    }
  }
};

/// The recursive method with the trapezoidal rule.
///
/// Settings, parameters, and coordinates and speeds to start with are those of the scene until others are given.  `start` finds a consistent
/// state from them; `step` and `advance` go on from there.
template <Sized M>
class Simulation {
 public:
  using Real = typename M::real_type;

  Simulation(const SimulationSettings& settings, const Real* parameters, const Road<Real>* roads)
      : settings_(settings), roads_(roads), start_(blank(mechanism_)), state_(start_), columns_(sizes.columns) {
    for (std::size_t i = 0; i < sizes.parameters; ++i) parameters_[i] = parameters[i];
    if constexpr (sizes.inputs > 0) mechanism_.drive_by({&HostInputs<Real, sizes.inputs>::fill, &inputs_});
  }

  Simulation(const Simulation&) = delete;
  Simulation& operator=(const Simulation&) = delete;

  SimulationSettings& settings() { return settings_; }
  auto& parameters() { return parameters_; }
  const auto& parameters() const { return parameters_; }

  /// Inputs, from the next step on.
  auto& inputs() { return inputs_; }

  /// The value of an input at the present time.
  Real present_input(std::size_t i) {
    mechanism_.begin_step(state_.t, Real(1));
    return mechanism_.last_inputs()[numbers_per_input * i];
  }

  /// Coordinates and speeds to start with, and which of them are given.
  StateOf<M>& start_state() { return start_; }
  Coordinates<M, unsigned char>& given_coordinates() { return given_coordinates_; }
  SpeedFlags<M>& given_speeds() { return given_speeds_; }

  /// Find a consistent state.
  Fault start() {
    is_started_ = false;
    state_ = start_;
    Initialisation<M>& how = initialisation_.emplace(mechanism_, how_to_start(), parameters_.data(), roads_);
    if (const Fault fault = how.place(state_, given_coordinates_)) return fault;
    state_.v = start_.v;  // a pose at rest has none
    if (const Fault fault = how.move(state_, given_speeds_)) return fault;
    penalties_ = how.penalties();
    count_from_here();
    load();
    is_started_ = true;
    return {};
  }

  bool is_started() const { return is_started_; }

  /// A step of the settings' length; the state stays where it fails.
  Fault step() {
    if (settings_.dt != counted_) count_from_here();
    const Fault fault = integrate(settings_.dt);
    if (!fault) state_.t = origin_ + Real(++number_) * Real(settings_.dt);
    return fault;
  }

  /// Steps to a time, the last one shorter where they do not end there.
  Fault advance(double until) {
    const Real rounding = Real(1e-9) * Real(settings_.dt);
    while (Real(until) - state_.t > rounding) {
      const Real left = Real(until) - state_.t;
      if (left + rounding >= Real(settings_.dt)) {
        if (const Fault fault = step()) return fault;
        continue;
      }
      if (const Fault fault = integrate(static_cast<double>(left))) return fault;
      state_.t = Real(until);
      count_from_here();
    }
    return {};
  }

  /// Go on from a time, coordinates and speeds as they are, with the accelerations that belong to them.
  Fault go_to(Real t, const Real* q, const Real* v) {
    for (std::size_t i = 0; i < sizes.coordinates; ++i) state_.q[i] = q[i];
    for (std::size_t i = 0; i < sizes.speeds; ++i) state_.v[i] = v[i];
    state_.t = t;
    count_from_here();
    is_reported_ = false;
    heed_parameters();
    Starter<M>& starter = initialisation_->starter();
    starter.accelerate(state_, Real(1));
    return starter.require_finite(state_);
  }

  /// Move the coordinates by displacements, one for each speed, then close the loops by moving the masses least; speeds stay as near as closed loops
  /// let them, and accelerations follow.
  Fault displace(const Real* delta) {
    heed_parameters();
    is_reported_ = false;
    const Coordinates<M> from = state_.q;
    retract<Real>(charts_of(mechanism_), from.data(), delta, state_.q.data());
    mechanism_.begin_step(state_.t, Real(1));
    if (const Fault fault = steps_->projection().positions(state_)) return fault;
    if (const Fault fault = steps_->projection().velocities(state_)) return fault;
    initialisation_->starter().accelerate(state_, Real(1));
    return initialisation_->starter().require_finite(state_);
  }

  /// The Jacobian of the loops' equations by the speeds, column by column.
  const Real* jacobian() {
    heed_parameters();
    mechanism_.begin_step(state_.t, Real(1));
    return initialisation_->starter().jacobian(state_);
  }

  /// The columns at the present state.
  const Real* report() {
    heed_parameters();
    if (!is_reported_) mechanism_.report(state_.q.data(), state_.v.data(), state_.vdot.data(), state_.lambda.data(), columns_.data());
    is_reported_ = true;
    return columns_.data();
  }

  const StateOf<M>& state() const { return state_; }

  /// Everything that the next steps follow from.
  struct Memory {
    SimulationSettings settings;
    Fixed<Real, M::sizes.parameters> parameters;
    HostInputs<Real, M::sizes.inputs> inputs;
    StateOf<M> state;
    Cuts<M> penalties;
    Real origin;
    long number;
    double counted;
  };

  Memory memory() const {
    return {.settings = settings_, .parameters = parameters_, .inputs = inputs_, .state = state_, .penalties = penalties_, .origin = origin_, .number = number_,
            .counted = counted_};
  }

  /// Go on from what another moment, or another simulation, remembers.
  void restore(const Memory& memory) {
    settings_ = memory.settings;
    parameters_ = memory.parameters;
    inputs_ = memory.inputs;
    state_ = memory.state;
    penalties_ = memory.penalties;
    origin_ = memory.origin;
    number_ = memory.number;
    counted_ = memory.counted;
    initialisation_.emplace(mechanism_, how_to_start(), parameters_.data(), roads_);
    load();
    is_started_ = true;
  }

 private:
  static constexpr Sizes sizes = M::sizes;

  typename Initialisation<M>::Settings how_to_start() const {
    return {.stabilisation = settings_.stabilisation, .equilibrium = settings_.equilibrium, .fixed_point_step = Real(settings_.dt)};
  }

  /// Times of steps are those of whole steps since now.
  void count_from_here() {
    origin_ = state_.t;
    number_ = 0;
    counted_ = settings_.dt;
  }

  /// Load the mechanism and get ready for steps; the state stays.
  void load() {
    loaded_ = parameters_;
    load_mechanism(mechanism_, parameters_.data(), roads_, settings_.stabilisation, penalties_);
    mechanism_.begin_step(state_.t, Real(1));
    steps_.emplace(mechanism_, Real(settings_.dt), settings_.fixed_point);
    is_reported_ = false;
  }

  /// Parameters that have changed count from now on.
  void heed_parameters() {
    if (!std::equal(parameters_.begin(), parameters_.end(), loaded_.begin())) load();
  }

  Fault integrate(double h) {
    heed_parameters();
    steps_->set_step(Real(h));
    steps_->set_fixed_point(settings_.fixed_point);
    is_reported_ = false;
    const Fault fault = steps_->step(state_, number_ + 1);
    return fault ? fault : watch();
  }

  /// Whether a force that was left out would act in the present state.
  Fault watch() {
    if constexpr (sizes.guards > 0) {
      Fixed<Real, sizes.guards> margins;
      mechanism_.guard(state_.q.data(), state_.v.data(), margins.data());
      for (std::size_t i = 0; i < sizes.guards; ++i)
        if (!(margins[i] >= Real(0)))
          return {.cause = Cause::guard_violated, .list = FaultList::guards, .index = static_cast<int>(i), .t = static_cast<double>(state_.t),
                  .step = number_ + 1, .value = static_cast<double>(-margins[i])};
    }
    return {};
  }

  M mechanism_;
  SimulationSettings settings_;
  const Road<Real>* roads_;
  Fixed<Real, M::sizes.parameters> parameters_, loaded_;
  HostInputs<Real, M::sizes.inputs> inputs_;
  StateOf<M> start_, state_;
  Coordinates<M, unsigned char> given_coordinates_;
  SpeedFlags<M> given_speeds_;
  Cuts<M> penalties_;
  Fixed<Real, M::sizes.columns> columns_;
  std::optional<Initialisation<M>> initialisation_;
  std::optional<Trapezoidal<M>> steps_;
  Real origin_{0};
  long number_ = 0;       ///< of steps since then
  double counted_ = 0.0;  ///< their length
  bool is_started_ = false, is_reported_ = false;
};

}  // namespace cutjoint
