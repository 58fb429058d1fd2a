// One simulation of a model. It neither throws nor prints; if its classes know their sizes, all its memory is inside.
#pragma once

#include <deque>

#include "cutjoint/core/stepping/step_statistics.hpp"
#include "cutjoint/core/inputs/host_inputs.hpp"
#include "cutjoint/core/start/initialisation.hpp"
#include "cutjoint/core/inputs/input_trajectories.hpp"
#include "cutjoint/core/inputs/sampling.hpp"

namespace cutjoint {

/// The solver of a simulation's start; systems have none.
template <class M>
struct StartOf {
  struct type {};
};

template <Mechanism M>
struct StartOf<M> {
  using type = Initialisation<M>;
};

/// A method with an integrator such as fixed_point_steps.hpp. The mechanism finds the start. It is also the integrator's `Subject`, unless
/// that is a system in other coordinates or with a Jacobian.
///
/// Settings, parameters, start coordinates and velocities (those of the mechanism) are the scene's until others are given. `start` finds a
/// consistent state; `step` and `advance` integrate from there.
///
/// An integrator has
///
/// - `fixed_point_step` and `stabilise`, the settings and penalties for loading the mechanism,
/// - `begin`, which takes a state, `start`, which takes the state of another simulation, `restart_after_input_jump`, optionally `restart_after_sample` after a controller's sample, and `step`;
/// either it `finds_events`, or it is `adaptive`: its steps follow the error,
/// - `accelerate`, which finds accelerations and multipliers of a state and makes it the present one, `complete`, a state with them, and `close`,
/// which projects a state in the mass metric,
/// - `memory` and `restore`, what it keeps between steps,
/// - for a run, `evaluations` and `iterations`, `watch_impacts` and, if it `knows_residuals`, those of the loops.
///
/// Inputs at `guiding` places move guides.
///
/// A step ends at each controller sample, and the next one begins with the values that the controller then holds.  Adaptive explicit steps of a
/// simulation that `foresees` pass samples that change nothing on which the motion depends. Outputs at the instant of a sample follow from the
/// new values. Controllers with a common instant are sampled in their order.
///
/// A mechanism or system without known sizes belongs to a caller, who also provides the inputs and checks guards and violations. It begins at
/// a start that was found elsewhere.
template <class M, class Integrator, int... guiding>
class Simulation {
 public:
  using Real = typename M::real_type;
  using Mechanism = M;
  using Subject = typename Integrator::Subject;
  using Steps = Integrator;
  using Settings = typename SettingsOf<Integrator>::type;
  using Smoothed = SmoothedInputs<Real, static_sizes<M>().inputs, guiding...>;
  using Trajectories = InputTrajectories<static_sizes<M>().inputs>;

  /// `violation_limits` of the equations (m or rad): beyond them a loop counts as torn.
  Simulation(const Settings& settings, const Real* parameters, const Road<Real>* roads, const double* violation_limits)
    requires Sized<M>
      : settings_(settings), roads_(roads), violation_limits_(violation_limits), start_(design_state(mechanism_)), state_(design_state(subject())), sampling_(subject()), columns_(sizes.columns) {
    for (std::size_t i = 0; i < sizes.parameters; ++i) parameters_[i] = parameters[i];
    drive_by(smoothed_.used());
  }

  Simulation(M& mechanism, const Settings& settings, const Real* parameters, const Road<Real>* roads)
    requires(!Sized<M>)
      : mechanism_(mechanism), settings_(settings), roads_(roads), violation_limits_(nullptr), parameters_(parameters, parameters + sizes_of(mechanism).parameters),
        start_(design_state(mechanism)), state_(start_), sampling_(mechanism), columns_(sizes_of(mechanism).columns) {}

  /// Read inputs from a source.
  void drive_by(const InputSource<Real>& source) requires(!Sized<M>) { mechanism_.drive_by(sampling_.source(source)); }

  /// Let inputs, guides included, follow trajectories until none is given. The present state receives the accelerations of their values.
  Fault set_input_trajectories(Trajectories* trajectories) requires Sized<M> {
    apply_changes();
    trajectories_ = trajectories;
    if (trajectories) trajectories->begin(static_cast<double>(state_.t), settings_.dt);
    drive_by(smoothed_.used());
    return accelerate();
  }

  Trajectories* trajectories() const { return trajectories_; }

  /// A callback after the sample of a controller.
  struct SampleWatch {
    void (*call)(void* who) = nullptr;
    void* who = nullptr;
  };

  void watch_samples(const SampleWatch& watch) { sample_watch_ = watch; }

  /// A callback after each step or substep, with the states at its ends, and before a controller holds this many values of a sample.
  struct SubstepWatch {
    Fault (*call)(void* who, const StateOf<Subject>& from, Real h) = nullptr;
    Fault (*sample)(void* who, std::size_t first, std::size_t number) = nullptr;
    void* who = nullptr;
  };

  void watch_substeps(const SubstepWatch& watch) { substep_watch_ = watch; }

  Simulation(const Simulation&) = delete;
  Simulation& operator=(const Simulation&) = delete;

  Settings& settings() { return settings_; }

  /// Set the tolerance from the next step on.
  void set_tolerance(double relative, double absolute) {
    settings_.tolerance = relative;
    settings_.absolute_tolerance = absolute;
    counted_ = 0.0;  // as for steps of another length
  }

  auto& parameters() { return parameters_; }
  const auto& parameters() const { return parameters_; }

  /// Set inputs from the next step on; outputs until then belong to the previous values.
  auto& inputs() { return inputs_; }

  /// The value of an input with which the next step begins.
  Real get_input(std::size_t i) {
    const InputValues now = read_inputs(inputs_);
    mechanism_.begin_step(state_.t, Real(1));
    return now[numbers_per_input * i];
  }

  /// Set start coordinates and velocities, and which of them are given.
  StateOf<M>& start_state() { return start_; }
  Coordinates<M, unsigned char>& given_coordinates() { return given_coordinates_; }
  SpeedFlags<M>& given_speeds() { return given_speeds_; }

  /// Clear the given start values.
  void forget_start() {
    start_ = design_state(mechanism_);
    given_coordinates_.fill(0);
    given_speeds_.fill(0);
  }

  /// Set the first-order states of the start, or those of the equilibrium if that is requested.
  void leave_states() { std::fill(given_speeds_.begin() + start_sizes.joint_speeds(), given_speeds_.end(), 0); }

  /// Find a consistent state.
  Fault start() {
    StateOf<M> begun = start_;
    if (const Fault fault = place(begun)) return fault;
    penalties_ = initialisation_->penalties();
    take_over(begun);
    count_from_here();
    load();
    if constexpr (has_system)
      if (const Fault fault = steps_->accelerate(state_, initialisation_->starter())) return fault;
    is_started_ = true;
    return sample();
  }

  /// Find a consistent state of the mechanism from start values, with accelerations before the first samples; the simulation stops.
  Fault place(StateOf<M>& begun) {
    is_started_ = false;
    steps_to_measurement_ = 1;
    inputs_.begin(state_.t);
    smoothed_.begin(inputs_);
    sampling_.begin();
    if (settings_.equilibrium)
      for (std::size_t i = start_sizes.joint_speeds(); i < start_sizes.speeds; ++i)
        if (given_speeds_[i]) begun.v[i] = Real(0);  // first-order states that are given count once the pose is found
    Initialisation<M>& how = initialisation_.emplace(mechanism_, how_to_start(), parameters_.data(), roads_);
    if (const Fault fault = how.place(begun, given_coordinates_)) return at_start(fault);
    for (std::size_t i = 0; i < start_sizes.speeds; ++i)  // a pose at rest has no speeds, and its own first-order states but for given ones
      if (i < start_sizes.joint_speeds() || given_speeds_[i]) begun.v[i] = start_.v[i];
    if (const Fault fault = how.move(begun, given_speeds_)) return at_start(fault);
    return {};
  }

  /// Begin at a start in the coordinates of the mechanism that found it, with its penalties; `motion` is 0 at rest. If controllers have `discrete`
  /// values at the start's time, continue after this many whole steps.
  Fault begin(const StateOf<M>& start, const Cuts<M>& penalties, Real motion, const std::optional<std::vector<Real>>& discrete = std::nullopt)
    requires(!Sized<M>)
  {
    penalties_ = penalties;
    take_over(start, motion);
    count_from_here();
    if (discrete) {
      number_ = std::lround(static_cast<double>(state_.t / Real(settings_.dt)));
      origin_ = Real(0);
    }
    load_subject();
    subject().begin_step(state_.t, motion);
    make_steps();
    is_reported_ = false;
    is_started_ = true;
    sampling_.begin();
    if (discrete) sampling_.resume(state_.t, rounding(), *discrete);
    if (const Fault fault = steps_->start(state_, motion)) return fault;
    return motion > Real(0) ? sample() : Fault{};
  }

  bool is_started() const { return is_started_; }

  /// The integrator, after the simulation has begun.
  Integrator& steps() { return *steps_; }
  const Integrator& steps() const { return *steps_; }

  /// Change the step length, on which a given penalty and the frequency may depend, or the tolerance.
  void apply_settings() {
    if (settings_.dt == counted_) return;
    count_from_here();
    if (settings_.stabilisation.penalty && settings_.stabilisation.closure == Closure::penalty)
      std::fill(penalties_.begin(), penalties_.end(), Real(*settings_.stabilisation.penalty));
    load();
  }

  /// Apply changes since the last step, as the next step would: rollouts in lanes take over what then is.
  void settle() {
    apply_settings();
    follow(next_whole());
  }

  /// A step of the settings' length; on failure the state is unchanged.
  Fault step() {
    apply_settings();
    return call(next_whole(), [this] { return whole_step(); });
  }

  /// Steps to a time; the last one is shorter if they do not end there.
  Fault advance(double until) {
    apply_settings();
    return call(Real(until), [this, until] { return steps_to(Real(until)); });
  }

  /// Integrate to a time or to the next event if that is earlier: `event` is then its indicator, else -1.
  Fault advance_to_event(double until, int& event) requires Integrator::finds_events {
    event = -1;
    apply_settings();
    return call(Real(until), [this, until, &event] { return steps_to_event(Real(until), event); });
  }

  /// End of the next equal step, unless an event or the target time comes first; none for adaptive steps.
  Real next_time() requires Integrator::finds_events {
    apply_settings();
    return Integrator::adaptive ? std::numeric_limits<Real>::infinity() : next_whole();
  }

  /// Whether a force that the reduction left out would act in the present state.
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

  /// Whether a step may tear a loop, so that violations are measured.
  bool watches_violations() const {
    if constexpr (requires { Integrator::leaves_violations(settings_); } && sizes.equations > 0) return Integrator::leaves_violations(settings_);
    else return false;
  }

  const double* violation_limits() const { return violation_limits_; }

  /// The constraint violations of the present state.
  ConstraintViolation violation() {
    subject().begin_step(state_.t, Real(1));
    return find_violation();
  }

  /// Statistics of the last step, or of the last call for adaptive integrators.
  StepStatistics statistics() {
    StepStatistics statistics = last_;
    subject().begin_step(state_.t, Real(1));
    measure_loops(statistics);
    measure_pivots(statistics);
    return statistics;
  }

  /// Limits of these, from the next step on; they belong to the host and are not part of the memory.
  Limits& limits() { return limits_; }
  /// Values that controllers hold; NaN before their first samples.
  const auto& discrete_values() const requires may_sample<Subject> { return sampling_.memory().values; }

  /// Values that controllers hold, and the number of samples of each.
  const auto& sampling() const requires may_sample<Subject> { return sampling_; }

  /// Set the values that controllers hold, until a memory is restored.
  void set_discrete_values(const auto& values) requires may_sample<Subject> { sampling_.set_values(values); }

  /// Time of the next controller sample (s); infinity if there is none.
  double next_sample() const requires may_sample<Subject> { return static_cast<double>(sampling_.next()); }

  /// Sample the controllers that are due, for a host that sets times itself.
  Fault take_samples() {
    apply_changes();
    return sample();
  }

  /// The host moves to another time: the next samples are those after it.
  void skip_samples(Real t) { sampling_.skip_to(t, rounding()); }

  /// Continue from a time, coordinates and velocities as given, with their accelerations; guides are where the host has them.
  Fault go_to(Real t, const Real* q, const Real* v) {
    jump_to(t);
    steps_to_measurement_ = 1;
    for (std::size_t i = 0; i < sizes.coordinates; ++i) state_.q[i] = q[i];
    for (std::size_t i = 0; i < sizes.speeds; ++i) state_.v[i] = v[i];
    state_.t = t;
    count_from_here();
    return accelerate();
  }

  /// Displace coordinates, one number per velocity, then project positions and velocities in the mass metric and find accelerations.
  Fault displace(const Real* delta) {
    apply_changes();
    const StateOf<Subject> from = state_;
    cutjoint::displace(charts_of(subject()), from.q, delta, state_.q);
    const Fault fault = steps_->close(state_);
    if (!fault) return accelerate();
    state_ = from;
    is_reported_ = false;
    return fault;
  }

  /// Write the Jacobian of the constraints with respect to velocities into `columns`, column by column.
  void jacobian(Real* columns) {
    apply_changes();
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

  /// Set mechanism, roads and starter to the present time.
  M& mechanism() { return mechanism_; }
  const Road<Real>* roads() const { return roads_; }
  auto& starter() {
    apply_changes();
    mechanism_.begin_step(state_.t, Real(1));
    return initialisation_->starter();
  }

  /// Move to the state at a time that `find` computes from the present one.
  Fault seek(Real t, auto find) {
    const auto before = smoothed_;
    StateOf<Subject> found = state_;
    apply_changes();
    jump_to(t);
    mechanism_.begin_step(found.t = t, Real(1));
    if (const Fault fault = find(initialisation_->starter(), found)) {
      smoothed_ = before;
      mechanism_.begin_step(state_.t, Real(1));
      return fault;
    }
    return go_to(t, found.q.data(), found.v.data());
  }

  /// Closure and penalties of the cut joints, as `load_mechanism` takes them.
  StabilisationSettings stabilisation() { return Integrator::stabilise(settings_, penalties_); }
  const Cuts<M>& penalties() const { return penalties_; }

  /// The outputs at the present state.
  const Real* report() {
    apply_parameters();
    if (!is_reported_) {
      const StateOf<Subject>& x = steps_->complete(state_);
      subject().report(x.q.data(), x.v.data(), x.vdot.data(), x.lambda.data(), columns_.data());
    }
    is_reported_ = true;
    return columns_.data();
  }

  /// Poses and velocities of bodies and markers in the present state; before a start those of the start values.
  void pose(Real* numbers) {
    const auto find_poses = [&](const auto& state) {
      mechanism_.begin_step(state.t, Real(1));
      mechanism_.poses(state.q.data(), state.v.data(), numbers);
    };
    if (is_started_) {
      apply_parameters();
      find_poses(state_);
    } else {
      initialisation_.emplace(mechanism_, how_to_start(), parameters_.data(), roads_);
      find_poses(start_);
    }
  }

  /// The present state; accelerations and multipliers only if it is complete.
  const StateOf<Subject>& state() const { return state_; }
  const StateOf<Subject>& complete_state() {
    apply_parameters();
    return steps_->complete(state_);
  }

  /// The state with accelerations for the present inputs; `complete_state` has those of the last step.
  const StateOf<Subject>& present_state() {
    apply_changes();
    return steps_->complete(state_);
  }

  /// Everything that the next steps depend on.
  struct Memory {
    Settings settings;
    Array<M, static_sizes<M>().parameters> parameters;
    HostInputs<Real, static_sizes<M>().inputs> inputs;
    Smoothed smoothed;
    StateOf<Subject> state;
    Cuts<M> penalties;
    [[no_unique_address]] typename SamplingOf<Subject>::Memory sampling;
    [[no_unique_address]] typename Integrator::Memory integrator;
    Real origin;
    long number;
    double counted;
    long steps_to_measurement;
  };

  Memory memory() const {
    return {.settings = settings_, .parameters = parameters_, .inputs = inputs_, .smoothed = smoothed_, .state = state_, .penalties = penalties_,
            .sampling = sampling_.memory(), .integrator = steps_->memory(), .origin = origin_, .number = number_, .counted = counted_, .steps_to_measurement = steps_to_measurement_};
  }

  /// Restore a memory of this or another simulation.
  void restore(const Memory& memory) {
    settings_ = memory.settings;
    parameters_ = memory.parameters;
    inputs_ = memory.inputs;
    smoothed_ = memory.smoothed;
    state_ = memory.state;
    penalties_ = memory.penalties;
    sampling_.restore(memory.sampling);
    origin_ = memory.origin;
    number_ = memory.number;
    counted_ = memory.counted;
    steps_to_measurement_ = memory.steps_to_measurement;
    initialisation_.emplace(mechanism_, how_to_start(), parameters_.data(), roads_);
    load();
    steps_->restore(state_, memory.integrator);
    is_started_ = true;
  }

 private:
  using InputValues = Fixed<Real, numbers_per_input * static_sizes<M>().inputs>;

  static constexpr Sizes sizes = static_sizes<Subject>(), start_sizes = static_sizes<M>();
  static constexpr bool has_system = !std::is_same_v<M, Subject>;
  static constexpr bool is_system = !cutjoint::Mechanism<Subject>;
  static constexpr bool passes_samples = may_sample<Subject> && !Sized<M> && !is_system && Integrator::finds_events && Integrator::adaptive;
  static constexpr bool has_trajectories = Sized<M> && std::is_same_v<Real, double> && start_sizes.inputs > 0;

  struct None {};

  /// A sample that a step has passed: its time, that of the next one, and what controllers hold after it.
  struct Passed {
    Real t, next;
    typename SamplingOf<Subject>::Memory after;
  };

  Subject& subject() {
    if constexpr (has_system) return system_;
    else return mechanism_;
  }

  /// Take the state that the mechanism started with.
  void take_over(const StateOf<M>& begun, Real motion = Real(1)) {
    if constexpr (is_system) {
      subject().load(parameters_.data(), roads_);
      subject().begin_step(begun.t, motion);
      subject().initial_coordinates(begun.q.data(), begun.v.data(), state_.q.data(), state_.v.data());
      state_.t = begun.t;
    } else {
      state_ = begun;
    }
  }

  static Fault at_start(Fault fault) {
    fault.at_start = true;
    return fault;
  }

  auto how_to_start() const {
    return typename Initialisation<M>::Settings{
        .stabilisation = settings_.stabilisation, .equilibrium = settings_.equilibrium, .fixed_point_step = Integrator::fixed_point_step(settings_)};
  }

  /// Count whole steps from now.
  void count_from_here() {
    origin_ = state_.t;
    number_ = 0;
    counted_ = settings_.dt;
  }

  /// Load the mechanism and prepare for steps; the state is unchanged.
  void load() {
    load_subject();
    subject().begin_step(state_.t, Real(1));
    make_steps();
    steps_->begin(state_);
    is_reported_ = false;
    last_ = {};
  }

  void make_steps() {
    steps_.emplace(subject(), settings_, roads_);
    if constexpr (requires { steps_->take_penalties(penalties_); }) steps_->take_penalties(penalties_);
  }

  void load_subject() {
    loaded_ = parameters_;
    const StabilisationSettings stabilisation = Integrator::stabilise(settings_, penalties_);
    load_mechanism(mechanism_, parameters_.data(), roads_, stabilisation, penalties_);
    if constexpr (has_system) system_.load(parameters_.data(), roads_);
  }

  static void fill_by_trajectories(void* self, Real t, Real* input) {
    Simulation& own = *static_cast<Simulation*>(self);
    HostInputs<Real, static_sizes<M>().inputs>::fill(own.host_, t, input);
    own.trajectories_->fill(t, input);
  }

  void drive_by(HostInputs<Real, static_sizes<M>().inputs>& inputs) {
    if constexpr (Sized<M> && (sizes.inputs > 0 || may_sample<Subject>)) {
      InputSource<Real> given{};
      if constexpr (sizes.inputs > 0) given = {&HostInputs<Real, sizes.inputs>::fill, &inputs};
      if constexpr (has_trajectories)
        if (trajectories_) host_ = &inputs, given = {&fill_by_trajectories, this};
      const InputSource<Real> source = sampling_.source(given);
      mechanism_.drive_by(source);
      if constexpr (has_system) system_.drive_by(source);
    }
  }

  /// Apply changed parameters from now on.
  void apply_parameters() {
    if (!std::equal(parameters_.begin(), parameters_.end(), loaded_.begin())) begin_again([this] { load(); });
  }

  /// Restart steps at a state that other steps led to; the extrapolation of accelerations stays.
  void begin_again(auto begin) {
    if constexpr (requires { steps_->expected(); }) {
      const auto expected = steps_->expected();
      begin();
      steps_->expected() = expected;
    } else {
      begin();
    }
  }

  /// The same for inputs that move no guide; guides follow calls. Earlier outputs belong to the inputs of the last step.
  void apply_changes() {
    if (take_changes()) steps_->restart_after_input_jump(state_);
  }

  /// Whether inputs that move no guide have changed their value, rate or acceleration; steps begin with the resulting accelerations.
  bool take_changes() {
    apply_parameters();
    if (smoothed_.others_are_unchanged(inputs_)) return false;
    const InputValues before = read_inputs(smoothed_.used());
    smoothed_.take_others(inputs_);
    return !(read_inputs(smoothed_.used()) == before);
  }

  /// A call from the present time to another begins: guides follow the host.
  void follow(Real until) {
    const bool others_jump = take_changes();
    const auto scene = [this](std::size_t i, Real t, Real* numbers) { read_scene(i, t, numbers); };
    if (smoothed_.begin_call(inputs_, state_.t, until, Real(settings_.dt), scene) || others_jump) steps_->restart_after_input_jump(state_);
  }

  /// The host sets the time itself: guides are where it has them.
  void jump_to(Real t) {
    if (t != state_.t || !smoothed_.is_unchanged(inputs_)) smoothed_.begin(inputs_);
  }

  /// Inputs at the present time as the host gives them; afterwards those of the steps.
  InputValues read_inputs(HostInputs<Real, static_sizes<M>().inputs>& inputs) {
    InputValues values;
    if constexpr (sizes.inputs > 0) {
      drive_by(inputs);
      mechanism_.begin_step(state_.t, Real(1));
      std::copy_n(mechanism_.last_inputs(), values.size(), values.begin());
      drive_by(smoothed_.used());
    }
    return values;
  }

  /// Value, rate and acceleration of an input in the scene at a time.
  void read_scene([[maybe_unused]] std::size_t i, [[maybe_unused]] Real t, [[maybe_unused]] Real* numbers) {
    if constexpr (Smoothed::any) {
      mechanism_.drive_by({});
      mechanism_.begin_step(t, Real(1));
      std::copy_n(mechanism_.last_inputs() + numbers_per_input * i, numbers_per_input, numbers);
      drive_by(smoothed_.used());
    }
  }

  /// Accelerations of the state.
  Fault accelerate() {
    apply_changes();
    is_reported_ = false;
    return steps_->accelerate(state_, initialisation_->starter());
  }

  /// Shorter than any step of the integrator.
  Real rounding() const { return Real(1e-9) * Real(settings_.dt); }

  /// End of the next step of the settings' length.
  Real next_whole() const { return origin_ + Real(number_ + 1) * Real(settings_.dt); }

  /// A call that integrates to a time. If it fails at once, the inputs of guides are unchanged.
  Fault call(Real until, auto continue_call) {
    if constexpr (!Smoothed::any) {
      apply_changes();
      return continue_call();
    } else {
      const auto before = smoothed_;
      const StateOf<Subject> from = state_;
      if (until - state_.t > rounding() && smoothed_.is_due(inputs_, state_.t, rounding())) follow(until);
      else apply_changes();
      Fault fault = continue_call();
      if (fault && !has_made_step(fault)) fault = smoothed_.is_catching_up() ? jump(continue_call) : fault;
      if (fault && !has_made_step(fault)) fault = find_torn_loop(fault);
      if (fault && state_.t == from.t) restore_state(from, before);
      return fault;
    }
  }

  /// Jump by more than steps can follow: project the loops at the host's guide positions.
  Fault jump(auto continue_call) {
    const auto before = smoothed_;
    const StateOf<Subject> from = state_;
    smoothed_.begin(inputs_);
    Fault fault = steps_->close(state_);
    if (!fault) {
      steps_->restart_after_input_jump(state_);
      fault = continue_call();
    }
    if (fault && state_.t == from.t) restore_state(from, before);
    return fault;
  }

  /// The fault of a step, or that of a loop which cannot close at positions that guides reach within a few steps.
  Fault find_torn_loop(const Fault& fault) {
    constexpr int ahead[] = {0, 1, 4};
    const auto before = smoothed_;
    const StateOf<Subject> from = state_;
    Fault found = fault;
    for (const int steps : ahead) {
      smoothed_.look_ahead(state_.t, Real(steps * settings_.dt));
      const Fault open = steps_->close(state_);
      restore_state(from, before);
      if (open.cause != Cause::loops_not_closed) continue;
      found = {.cause = Cause::loops_violated, .list = open.list, .index = open.index, .t = fault.t, .step = fault.step, .value = open.value,
                .size = violation_limits_[open.index]};
      break;
    }
    return found;
  }

  /// Return to a state and trajectories as before a failed step.
  void restore_state(const StateOf<Subject>& state, const Smoothed& smoothed) {
    state_ = state;
    smoothed_ = smoothed;
    subject().begin_step(state_.t, Real(1));
    begin_again([this] { steps_->begin(state_); });
  }

  Fault whole_step() {
    const Real whole = next_whole();
    const Fault fault = integrate(Real(settings_.dt), whole);
    if (state_.t == whole) ++number_;  // also where the step is made, and what it has led to is a fault
    return fault;
  }

  Fault steps_to(Real until) {
    while (until - state_.t > rounding()) {
      const Real left = until - state_.t;
      if (!Integrator::adaptive && left + rounding() >= Real(settings_.dt)) {
        if (const Fault fault = whole_step()) return fault;
        continue;
      }
      const Fault fault = integrate(left, until);
      if (state_.t == until) count_from_here();
      if (fault) return fault;
    }
    return {};
  }

  Fault steps_to_event(Real until, int& event) {
    const long events = steps_->events();
    while (until - state_.t > rounding() && event < 0) {
      const Real whole = next_whole(), end = Integrator::adaptive ? until : std::min(whole, until), next = enter_pieces_until(end);
      is_reported_ = false;
      const StepStatistics before = counted();
      if (const Fault fault = steps_->step_to_event(state_, settings_, next, number_ + 1)) return fault;
      const Fault fault = end_step(before);
      if (steps_->events() > events) event = static_cast<int>(steps_->last_event());
      if (state_.t == whole) ++number_;
      else count_from_here();
      if (fault) return fault;
    }
    return {};
  }

  /// Guides enter the next pieces of their trajectories. Returns the time before which no piece ends and no controller is due; at most `until`.
  Real enter_pieces_until(Real until) {
    Real next = until;
    if constexpr (Smoothed::any) {
      if (smoothed_.advance_piece(state_.t, rounding())) steps_->restart_after_input_jump(state_);
      next = std::min(next, smoothed_.next_end());
    }
    if constexpr (passes_samples) next = std::min(next, passed_.empty() ? sampling_.next() : passed_.back().next);
    else if constexpr (may_sample<Subject>) next = std::min(next, sampling_.next());
    if constexpr (has_trajectories)
      if (trajectories_) next = std::min(next, begin_substep_of_trajectories());
    next = next < until - rounding() ? next : until;
    if constexpr (has_trajectories)
      if (trajectories_) trajectories_->end_substep(next);
    return next;
  }

  /// Trajectories enter the next substep, with new accelerations if they may jump. Returns when they next may.
  Real begin_substep_of_trajectories() {
    if (trajectories_->begin_substep(state_.t)) restart_exactly();
    return trajectories_->next_jump();
  }

  /// Give the present state its accelerations and multipliers.
  void restart_exactly() {
    if constexpr (sizes.equations == 0 || Integrator::finds_events) steps_->restart_after_input_jump(state_);
    else steps_->accelerate(state_, initialisation_->starter());
  }

  /// Sample the controllers that are due.
  Fault sample() {
    if constexpr (may_sample<Subject>) {
      if (is_system && sampling_.next() <= state_.t + rounding()) restart_at_sample();  // accelerations of a step only come near to those that outputs need
      if constexpr (passes_samples)
        for (; !passed_.empty() && passed_.front().t <= state_.t + rounding(); passed_.pop_front()) sampling_.restore(passed_.front().after);
      SampleChanges changes;  // since accelerations were found
      Fault fault;
      for (std::size_t i = 0; i < sampling_.size() && !fault; ++i) {
        if (!sampling_.is_due(i, state_.t, rounding())) continue;
        if (changes.motion && sampling_.is_accelerated(i)) {
          restart_from_sample();
          changes = {};
        }
        is_reported_ = false;
        fault = sample(i, sampling_.is_accelerated(i) ? steps_->complete(state_) : state_, changes);
      }
      moves_by_samples_ = changes.motion;
      if (changes.motion) restart_from_sample();
      else if (changes.any) subject().begin_step(state_.t, Real(1));
      return fault;
    }
    return {};
  }

  /// Apply the new values of controllers.
  void restart_from_sample() {
    restart_at_sample();
    if (sample_watch_.call) sample_watch_.call(sample_watch_.who);
  }

  /// Give the present state the accelerations of its forces.
  void restart_at_sample() {
    is_reported_ = false;
    if constexpr (requires { steps_->restart_after_sample(state_); }) steps_->restart_after_sample(state_);
    else steps_->restart_after_input_jump(state_);
  }

  /// A sample reads the accelerations of the previous values.
  Fault sample(std::size_t controller, const StateOf<Subject>& x, SampleChanges& changes) {
    if (changes.outdates || sampling_.is_accelerated(controller)) {
      subject().begin_step(x.t, Real(1));
      subject().sample(x.q.data(), x.v.data(), x.vdot.data(), x.lambda.data(), sampling_.next_values());
      changes.outdates = false;
    }
    if (substep_watch_.sample)
      if (const Fault fault = substep_watch_.sample(substep_watch_.who, sampling_.first_of(controller), sampling_.discrete_by(controller))) return fault;
    if (!sampling_.take(controller, changes))
      return {.cause = Cause::sample_not_finite, .list = FaultList::controllers, .index = static_cast<int>(controller), .t = static_cast<double>(x.t),
              .step = number_ + 1};
    return {};
  }

  /// Pass samples within the last step up to the first that changes what the motion depends on, where the step has to end.  Returns its time, else that of the
  /// next one after the step.
  static Real pass_samples(void* who, auto& scheme, Real end) {
    Simulation& own = *static_cast<Simulation*>(who);
    const auto before = own.sampling_.memory();
    if (!own.passed_.empty()) own.sampling_.restore(own.passed_.back().after);
    StateOf<Subject> x = own.state_;
    while ((x.t = own.sampling_.next()) < end) {
      SampleChanges changes;
      scheme.read_between(x.t, x);
      for (std::size_t i = 0; i < own.sampling_.size() && !changes.motion; ++i)
        if (own.sampling_.is_due(i, x.t, own.rounding())) changes.motion = own.sample(i, x, changes) || changes.motion;
      if (changes.motion) break;
      own.passed_.push_back({x.t, own.sampling_.next(), own.sampling_.memory()});
    }
    own.sampling_.restore(before);
    return x.t;
  }

  void find_residuals(Equations<Subject>& residual, Equations<Subject>& rate) {
    if constexpr (is_system) {
      Equations<Subject> curvature;
      subject().constraint_residual(state_.q.data(), state_.v.data(), state_.vdot.data(), residual.data(), rate.data(), curvature.data());
    } else if constexpr (sizes.equations > 0) {
      mechanism_.constraint_residual(state_.q.data(), state_.v.data(), residual.data(), rate.data());
    }
  }

  /// The constraint violation of the mechanism or system at the present time.
  ConstraintViolation find_violation() {
    Equations<Subject> residual, rate;
    find_residuals(residual, rate);
    return largest_violation(sizes.equations, violation_limits_, [&](std::size_t i) { return residual[i]; });
  }

  /// A step to a time, in substeps between pieces of trajectories and controller samples.
  Fault integrate(Real h, Real until) {
    is_reported_ = false;
    Real next = enter_pieces_until(until);
    if (!(next < until)) return integrate_substep(h, until);
    const StateOf<Subject> from = state_;
    const auto before = smoothed_;
    const auto discrete = sampling_.memory();
    Fault exceeded;
    for (;; next = enter_pieces_until(until)) {
      const Fault fault = integrate_substep(next - state_.t, next);
      if (fault && fault.cause != Cause::limit_exceeded) {
        sampling_.restore(discrete);
        restore_state(from, before);
        return fault;
      }
      if (fault && !exceeded) exceeded = fault;
      if (!(next < until)) return exceeded;
    }
  }

  Fault integrate_substep(Real h, Real until) {
    const StepStatistics before = counted();
    if (const Fault fault = substep_watch_.call ? take_watched_substep(h, until) : take_substep(h, until)) return fault;
    state_.t = until;
    if (const Fault fault = watch_violations()) return fault;
    return end_step(before);
  }

  [[gnu::noinline]] Fault take_watched_substep(Real h, Real until) {
    const StateOf<Subject> from = state_;
    if (const Fault fault = take_substep(h, until)) return fault;
    state_.t = until;
    return substep_watch_.call(substep_watch_.who, from, h);
  }

  /// Check the result of a step and sample the controllers at its end.
  Fault end_step(const StepStatistics& before) {
    const Fault fault = check_step(before);
    const Fault sampled = sample();
    return fault ? fault : sampled;
  }

  /// Iterations and evaluations so far.
  StepStatistics counted() const { return {.iterations = steps_->iterations(), .evaluations = steps_->evaluations()}; }

  /// Check the result of a step: omitted forces that would act, and limits.
  Fault check_step(const StepStatistics& before) {
    last_ = counted();
    last_.iterations -= before.iterations;
    last_.evaluations -= before.evaluations;
    if constexpr (requires { steps_->change(); }) last_.change = steps_->change();
    if (const Fault fault = watch()) return fault;
    if (!limits_.any()) return {};
    StepStatistics statistics = last_;
    if (limits_.of_loops()) measure_loops(statistics);
    if (limits_.of_pivots()) measure_pivots(statistics);
    return limits_.watch(statistics, static_cast<double>(state_.t), number_ + 1);
  }

  void measure_pivots(StepStatistics& statistics) const {
    if constexpr (requires { steps_->smallest_pivot(); }) statistics.pivot = steps_->smallest_pivot();
  }

  /// Violations of position and velocity of the mechanism or system at the present time.
  void measure_loops(StepStatistics& statistics) {
    Equations<Subject> residual, rate;
    find_residuals(residual, rate);
    const ConstraintViolation violation = largest_violation(sizes.equations, violation_limits_, [&](std::size_t i) { return residual[i]; });
    statistics.violation = violation.size;
    statistics.equation = violation.equation;
    for (const Real& x : rate) statistics.violation_rate = std::max(statistics.violation_rate, std::abs(static_cast<double>(x)));
  }

  /// On failure the state is unchanged.
  Fault take_substep(Real h, Real until) {
    if constexpr (may_sample<Subject> && Integrator::finds_events)
      if (sampling_.any() && settings_.foresees) {
        const bool passes = passes_samples && !moves_by_samples_;
        steps_->stepper().limit_before_end(sampling_.next(passes));
        if constexpr (passes_samples) steps_->stepper().shorten_by({&pass_samples, passes ? this : nullptr});
      }
    if constexpr (Smoothed::any)
      if (watches_violations() && smoothed_.is_catching_up()) {
        const StateOf<Subject> from = state_;
        Fault fault = steps_->step(state_, settings_, h, until, number_ + 1);
        if (!fault) fault = project_after_jump(until);
        if (fault) state_ = from;
        return fault;
      }
    return steps_->step(state_, settings_, h, until, number_ + 1);
  }

  /// Project loops that a step has left open after a guide's jump; the next step begins with new accelerations.
  Fault project_after_jump(Real t) {
    state_.t = t;
    Equations<Subject> residual, rate;
    if constexpr (!is_system) mechanism_.constraint_residual(state_.q.data(), state_.v.data(), residual.data(), rate.data());
    const auto violation = [&](const Equations<Subject>& open, Real per) { return largest_violation(sizes.equations, violation_limits_, [&](std::size_t i) { return per * open[i]; }); };
    if (violation(residual, Real(1)).is_closed() && violation(rate, Real(closing_time(settings_))).is_closed()) return {};
    return steps_->close(state_);
  }

  /// Whether a loop is torn at the end of a step.
  Fault watch_violations() {
    if (!watches_violations() || --steps_to_measurement_ > 0) return {};
    const ConstraintViolation violation = find_violation();
    steps_to_measurement_ = violation.next_measurement();
    return violation.is_torn() ? violation.fault(static_cast<double>(state_.t), number_ + 1) : Fault{};
  }

  std::conditional_t<Sized<M>, M, M&> mechanism_;
  [[no_unique_address]] std::conditional_t<has_system, Subject, None> system_;
  Settings settings_;
  const Road<Real>* roads_;
  const double* violation_limits_;
  Array<M, static_sizes<M>().parameters> parameters_, loaded_;
  HostInputs<Real, static_sizes<M>().inputs> inputs_;
  Smoothed smoothed_;
  StateOf<M> start_;
  StateOf<Subject> state_;
  Coordinates<M, unsigned char> given_coordinates_;
  SpeedFlags<M> given_speeds_;
  Cuts<M> penalties_;
  [[no_unique_address]] SamplingOf<Subject> sampling_;
  [[no_unique_address]] std::conditional_t<may_sample<Subject>, SampleWatch, None> sample_watch_;
  SubstepWatch substep_watch_;
  Trajectories* trajectories_ = nullptr;
  HostInputs<Real, static_sizes<M>().inputs>* host_ = nullptr;  ///< in addition to trajectories
  Array<Subject, sizes.columns> columns_;
  std::optional<typename StartOf<M>::type> initialisation_;
  std::optional<Integrator> steps_;
  StepStatistics last_;    ///< of what is counted separately
  Limits limits_;
  Real origin_{0};
  long number_ = 0;       ///< of steps since then
  double counted_ = 0.0;  ///< their total length
  long steps_to_measurement_ = 1;   ///< steps until violations are measured
  bool is_started_ = false, is_reported_ = false;
  bool moves_by_samples_ = true;  ///< whether the last samples have changed what the motion depends on: a step then ends at the next one
  [[no_unique_address]] std::conditional_t<passes_samples, std::deque<Passed>, None> passed_;
};

}  // namespace cutjoint
