// One simulation of a model whose classes know their sizes: all its memory is inside, it throws nothing and prints nothing.
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <optional>
#include <type_traits>

#include "cutjoint/core/arrays.hpp"
#include "cutjoint/core/fault.hpp"
#include "cutjoint/core/initialisation.hpp"
#include "cutjoint/core/inputs.hpp"
#include "cutjoint/core/mechanism.hpp"
#include "cutjoint/core/retraction.hpp"
#include "cutjoint/core/road.hpp"
#include "cutjoint/core/simulation_settings.hpp"
#include "cutjoint/core/stabilisation.hpp"
#include "cutjoint/core/state.hpp"

namespace cutjoint {

/// What a host gives of its inputs.  An input whose value is no number follows the scene.  A value that was `put` with its rate and acceleration at a
/// time goes on like that; one that was written instead is held.
template <class Real, std::size_t n>
struct HostInputs {
  Fixed<Real, n> values;

  HostInputs() { values.fill(std::numeric_limits<Real>::quiet_NaN()); }

  void put(std::size_t i, Real t, Real value, Real rate, Real acceleration) {
    values[i] = put_[i] = value;
    rates_[i] = rate;
    accelerations_[i] = acceleration;
    times_[i] = t;
  }

  static void fill(void* host, Real t, Real* input) {
    const HostInputs& given = *static_cast<const HostInputs*>(host);
    for (std::size_t i = 0; i < n; ++i, input += numbers_per_input) {
      if (!(given.values[i] == given.values[i])) continue;
      const bool is_put = given.values[i] == given.put_[i];
      const Real since = t - given.times_[i], rate = is_put ? given.rates_[i] : Real(0), acceleration = is_put ? given.accelerations_[i] : Real(0);
      input[0] = given.values[i] + since * (rate + since / 2 * acceleration);
      input[1] = rate + since * acceleration;
      input[2] = acceleration;
    }
  }

  /// A source that gives these; none where all follow the scene.
  InputSource<Real> source() {
    for (const Real value : values)
      if (value == value) return {&fill, this};
    return {};
  }

  /// Whether others would give the same.
  bool operator==(const HostInputs& other) const {
    bool same = true;
    for (std::size_t i = 0; i < n; ++i) {
      const bool follow = !(values[i] == values[i]) && !(other.values[i] == other.values[i]);
      same = same && (follow || (values[i] == other.values[i] && put_[i] == other.put_[i] && rates_[i] == other.rates_[i] &&
                               accelerations_[i] == other.accelerations_[i] && times_[i] == other.times_[i]));
    }
    return same;
  }

 private:
  Fixed<Real, n> put_, rates_, accelerations_, times_;
};

/// A method with an integrator such as fixed_point_steps.hpp.  The mechanism finds where motions start; it is also what the integrator steps, its
/// `Subject`, unless that is a system in coordinates of its own or with a tangent.
///
/// Settings, parameters, and coordinates and speeds to start with, which are the mechanism's, are those of the scene until others are given.  `start`
/// finds a consistent state from them; `step` and `advance` go on from there.
///
/// An integrator has
///
/// - `fixed_point_step` and `stabilise`, the settings and penalties that the mechanism is loaded with,
/// - `begin`, which takes over a state as it is, `heed_inputs`, which does where inputs have jumped, and `step`, which goes on from one; it
///   `finds_events`, or is `adaptive`: its steps are as long as errors allow,
/// - `accelerate`, which finds accelerations and multipliers of a state and takes it over, `complete`, a state that has them, and `close`, which closes
///   the loops of a state and moves the masses least,
/// - `memory` and `restore`, what it remembers from step to step.
template <Sized M, class Integrator>
class Simulation {
 public:
  using Real = typename M::real_type;
  using Mechanism = M;
  using Subject = typename Integrator::Subject;

  Simulation(const SimulationSettings& settings, const Real* parameters, const Road<Real>* roads)
      : settings_(settings), roads_(roads), start_(blank(mechanism_)), state_(blank(subject())), columns_(sizes.columns) {
    for (std::size_t i = 0; i < sizes.parameters; ++i) parameters_[i] = parameters[i];
    if constexpr (sizes.inputs > 0) drive_by(used_);
  }

  Simulation(const Simulation&) = delete;
  Simulation& operator=(const Simulation&) = delete;

  SimulationSettings& settings() { return settings_; }

  /// What the error of a step may be, from the next one on.
  void set_tolerance(double relative, double absolute) {
    settings_.tolerance = relative;
    settings_.absolute_tolerance = absolute;
    counted_ = 0.0;  // as for steps of another length
  }

  auto& parameters() { return parameters_; }
  const auto& parameters() const { return parameters_; }

  /// Inputs, from the next step on; what is reported until then is of those before.
  auto& inputs() { return inputs_; }

  /// The value of an input at the present time, as the next step begins with it.
  Real present_input(std::size_t i) {
    InputValues now;
    read_inputs(inputs_, now);
    mechanism_.begin_step(state_.t, Real(1));
    return now[numbers_per_input * i];
  }

  /// Coordinates and speeds to start with, and which of them are given.
  StateOf<M>& start_state() { return start_; }
  Coordinates<M, unsigned char>& given_coordinates() { return given_coordinates_; }
  SpeedFlags<M>& given_speeds() { return given_speeds_; }

  /// Nothing is given to start with.
  void forget_start() {
    start_ = blank(mechanism_);
    given_coordinates_.fill(0);
    given_speeds_.fill(0);
  }

  /// Find a consistent state.
  Fault start() {
    is_started_ = false;
    used_ = inputs_;
    StateOf<M> begun = start_;
    Initialisation<M>& how = initialisation_.emplace(mechanism_, how_to_start(), parameters_.data(), roads_);
    if (const Fault fault = how.place(begun, given_coordinates_)) return at_start(fault);
    begun.v = start_.v;  // a pose at rest has none
    if (const Fault fault = how.move(begun, given_speeds_)) return at_start(fault);
    penalties_ = how.penalties();
    take_over(begun);
    count_from_here();
    load();
    if constexpr (has_system)
      if (const Fault fault = steps_->accelerate(state_, how.starter())) return fault;
    is_started_ = true;
    return {};
  }

  bool is_started() const { return is_started_; }

  /// Heed what has changed since the last step, as the next one does.
  void settle() {
    heed_settings();
    heed_changes();
  }

  /// A step of the settings' length; the state stays where it fails.
  Fault step() {
    heed_settings();
    const Real until = origin_ + Real(number_ + 1) * Real(settings_.dt);
    if (const Fault fault = integrate(Real(settings_.dt), until)) return fault;
    ++number_;
    return {};
  }

  /// Steps to a time, the last one shorter where they do not end there.
  Fault advance(double until) {
    heed_settings();
    const Real rounding = Real(1e-9) * Real(settings_.dt);
    while (Real(until) - state_.t > rounding) {
      const Real left = Real(until) - state_.t;
      if (!Integrator::adaptive && left + rounding >= Real(settings_.dt)) {
        if (const Fault fault = step()) return fault;
        continue;
      }
      if (const Fault fault = integrate(left, Real(until))) return fault;
      count_from_here();
    }
    return {};
  }

  /// The same, or to where a force changes its formula, if that is earlier: `event` is then its switch, else -1.
  Fault advance_to_event(double until, int& event)
    requires Integrator::finds_events
  {
    event = -1;
    heed_settings();
    heed_changes();
    const long events = steps_->events();
    const Real rounding = Real(1e-9) * Real(settings_.dt);  // no step of the integrator is as short
    while (Real(until) - state_.t > rounding && event < 0) {
      const Real whole = origin_ + Real(number_ + 1) * Real(settings_.dt), next = Integrator::adaptive ? Real(until) : std::min(whole, Real(until));
      is_reported_ = false;
      if (const Fault fault = steps_->step_to_event(state_, settings_, next, number_ + 1)) return fault;
      if (const Fault fault = watch()) return fault;
      if (steps_->events() > events) event = static_cast<int>(steps_->last_event());
      if (state_.t == whole) ++number_;
      else count_from_here();
    }
    return {};
  }

  /// Where the next of its steps ends unless an event or the time advanced to is before; nowhere where steps are as long as errors allow.
  Real next_time()
    requires Integrator::finds_events
  {
    heed_settings();
    return Integrator::adaptive ? std::numeric_limits<Real>::infinity() : origin_ + Real(number_ + 1) * Real(settings_.dt);
  }

  /// Whether a force that was left out would act in the present state.
  Fault watch() {
    if constexpr (sizes.guards > 0) {
      Fixed<Real, sizes.guards> margins;
      subject().guard(state_.q.data(), state_.v.data(), margins.data());
      for (std::size_t i = 0; i < sizes.guards; ++i)
        if (!(margins[i] >= Real(0)))
          return {.cause = Cause::guard_violated, .list = FaultList::guards, .index = static_cast<int>(i), .t = static_cast<double>(state_.t),
                  .step = number_ + 1, .value = static_cast<double>(-margins[i])};
    }
    return {};
  }

  /// Go on from a time, coordinates and speeds as they are, with the accelerations that belong to them.
  Fault go_to(Real t, const Real* q, const Real* v) {
    for (std::size_t i = 0; i < sizes.coordinates; ++i) state_.q[i] = q[i];
    for (std::size_t i = 0; i < sizes.speeds; ++i) state_.v[i] = v[i];
    state_.t = t;
    count_from_here();
    return accelerate();
  }

  /// Move the coordinates by displacements, one for each speed, then close the loops by moving the masses least; speeds stay as near as closed loops
  /// let them, and accelerations follow.
  Fault displace(const Real* delta) {
    heed_changes();
    const StateOf<Subject> from = state_;
    cutjoint::displace(charts_of(subject()), from.q, delta, state_.q);
    const Fault fault = steps_->close(state_);
    if (!fault) return accelerate();
    state_ = from;
    is_reported_ = false;
    return fault;
  }

  /// Put the Jacobian of the equations by the speeds into `columns`, column by column.
  void jacobian(Real* columns) {
    heed_changes();
    subject().begin_step(state_.t, Real(1));
    if constexpr (has_system) {
      Speeds<Subject> unit;
      for (std::size_t i = 0; i < sizes.speeds; ++i, columns += sizes.equations) {
        unit[i] = Real(1);
        system_.apply_jacobian(state_.q.data(), unit.data(), columns);
        unit[i] = Real(0);
      }
    } else {
      std::copy_n(initialisation_->starter().jacobian(state_), sizes.equations * sizes.speeds, columns);
    }
  }

  /// The mechanism, its roads and its starter at a time, for those who seek states to go to.
  M& mechanism() { return mechanism_; }
  const Road<Real>* roads() const { return roads_; }
  Starter<M>& starter_at(Real t) {
    heed_changes();
    mechanism_.begin_step(t, Real(1));
    return initialisation_->starter();
  }

  /// How cut joints are held, and their penalties, as `load_mechanism` takes them.
  StabilisationSettings stabilisation() { return Integrator::stabilise(settings_, penalties_); }
  const Cuts<M>& penalties() const { return penalties_; }

  /// The columns at the present state.
  const Real* report() {
    heed_parameters();
    if (!is_reported_) {
      const StateOf<Subject>& x = steps_->complete(state_);
      subject().report(x.q.data(), x.v.data(), x.vdot.data(), x.lambda.data(), columns_.data());
    }
    is_reported_ = true;
    return columns_.data();
  }

  /// The present state; with its accelerations and multipliers only if it is complete.
  const StateOf<Subject>& state() const { return state_; }
  const StateOf<Subject>& complete_state() {
    heed_parameters();
    return steps_->complete(state_);
  }

  /// Everything that the next steps follow from.
  struct Memory {
    SimulationSettings settings;
    Fixed<Real, M::sizes.parameters> parameters;
    HostInputs<Real, M::sizes.inputs> inputs, used;
    StateOf<Subject> state;
    Cuts<M> penalties;
    [[no_unique_address]] typename Integrator::Memory integrator;
    Real origin;
    long number;
    double counted;
  };

  Memory memory() const {
    return {.settings = settings_, .parameters = parameters_, .inputs = inputs_, .used = used_, .state = state_, .penalties = penalties_,
            .integrator = steps_->memory(), .origin = origin_, .number = number_, .counted = counted_};
  }

  /// Go on from what another moment, or another simulation, remembers.
  void restore(const Memory& memory) {
    settings_ = memory.settings;
    parameters_ = memory.parameters;
    inputs_ = memory.inputs;
    used_ = memory.used;
    state_ = memory.state;
    penalties_ = memory.penalties;
    origin_ = memory.origin;
    number_ = memory.number;
    counted_ = memory.counted;
    initialisation_.emplace(mechanism_, how_to_start(), parameters_.data(), roads_);
    load();
    steps_->restore(state_, memory.integrator);
    is_started_ = true;
  }

 private:
  static constexpr Sizes sizes = Subject::sizes;
  static constexpr bool has_system = !std::is_same_v<M, Subject>;

  struct None {};

  Subject& subject() {
    if constexpr (has_system)
      return system_;
    else
      return mechanism_;
  }

  /// The state begins where the mechanism has started.
  void take_over(const StateOf<M>& begun) {
    if constexpr (has_system) {
      system_.load(parameters_.data(), roads_);
      system_.begin_step(begun.t, Real(1));
      system_.initial_coordinates(begun.q.data(), begun.v.data(), state_.q.data(), state_.v.data());
      state_.t = begun.t;
    } else {
      state_ = begun;
    }
  }

  static Fault at_start(Fault fault) {
    fault.at_start = true;
    return fault;
  }

  typename Initialisation<M>::Settings how_to_start() const {
    return {.stabilisation = settings_.stabilisation, .equilibrium = settings_.equilibrium, .fixed_point_step = Integrator::fixed_point_step(settings_)};
  }

  /// Times of steps are those of whole steps since now.
  void count_from_here() {
    origin_ = state_.t;
    number_ = 0;
    counted_ = settings_.dt;
  }

  /// Steps have another length from now on, from which a given penalty and the frequency may follow, or another tolerance.
  void heed_settings() {
    if (settings_.dt == counted_) return;
    count_from_here();
    if (settings_.stabilisation.penalty && settings_.stabilisation.closure == Closure::penalty)
      std::fill(penalties_.begin(), penalties_.end(), Real(*settings_.stabilisation.penalty));
    load();
  }

  /// Load the mechanism and get ready for steps; the state stays.
  void load() {
    loaded_ = parameters_;
    const StabilisationSettings stabilisation = Integrator::stabilise(settings_, penalties_);
    load_mechanism(mechanism_, parameters_.data(), roads_, stabilisation, penalties_);
    if constexpr (has_system) system_.load(parameters_.data(), roads_);
    subject().begin_step(state_.t, Real(1));
    steps_.emplace(subject(), settings_, roads_);
    steps_->begin(state_);
    is_reported_ = false;
  }

  void drive_by(HostInputs<Real, M::sizes.inputs>& inputs) {
    if constexpr (sizes.inputs > 0) {
      mechanism_.drive_by({&HostInputs<Real, sizes.inputs>::fill, &inputs});
      if constexpr (has_system) system_.drive_by({&HostInputs<Real, sizes.inputs>::fill, &inputs});
    }
  }

  /// Parameters that have changed count from now on.
  void heed_parameters() {
    if (!std::equal(parameters_.begin(), parameters_.end(), loaded_.begin())) load();
  }

  /// So do inputs; what was reported before is of those of the last step.
  void heed_changes() {
    heed_parameters();
    if (inputs_ == used_) return;
    const bool jump = inputs_jump();
    used_ = inputs_;
    if (jump) steps_->heed_inputs(state_);
  }

  /// Whether inputs have another value, rate or acceleration now than those of the last step.
  bool inputs_jump() {
    if constexpr (sizes.inputs > 0) {
      InputValues now, before;
      read_inputs(inputs_, now);
      read_inputs(used_, before);
      return !(now == before);
    }
    return false;
  }

  using InputValues = Fixed<Real, numbers_per_input * M::sizes.inputs>;

  /// Inputs at the present time, as a host gives them; afterwards they are those of the last step.
  void read_inputs(HostInputs<Real, M::sizes.inputs>& inputs, InputValues& values) {
    drive_by(inputs);
    mechanism_.begin_step(state_.t, Real(1));
    std::copy_n(mechanism_.last_inputs(), values.size(), values.begin());
    drive_by(used_);
  }

  /// Accelerations that belong to the state.
  Fault accelerate() {
    heed_changes();
    is_reported_ = false;
    return steps_->accelerate(state_, initialisation_->starter());
  }

  Fault integrate(Real h, Real until) {
    heed_changes();
    is_reported_ = false;
    if (const Fault fault = steps_->step(state_, settings_, h, until, number_ + 1)) return fault;
    state_.t = until;
    return watch();
  }

  M mechanism_;
  [[no_unique_address]] std::conditional_t<has_system, Subject, None> system_;
  SimulationSettings settings_;
  const Road<Real>* roads_;
  Fixed<Real, M::sizes.parameters> parameters_, loaded_;
  HostInputs<Real, M::sizes.inputs> inputs_, used_;
  StateOf<M> start_;
  StateOf<Subject> state_;
  Coordinates<M, unsigned char> given_coordinates_;
  SpeedFlags<M> given_speeds_;
  Cuts<M> penalties_;
  Fixed<Real, Subject::sizes.columns> columns_;
  std::optional<Initialisation<M>> initialisation_;
  std::optional<Integrator> steps_;
  Real origin_{0};
  long number_ = 0;       ///< of steps since then
  double counted_ = 0.0;  ///< their length
  bool is_started_ = false, is_reported_ = false;
};

}  // namespace cutjoint
