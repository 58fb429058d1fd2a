// Steps of several instances of a mechanism in SIMD lanes, and a mechanism whose instances find accelerations of several states at once.
#pragma once

#include "cutjoint/core/stepping/step_statistics.hpp"
#include "cutjoint/core/mechanism/instances.hpp"
#include "cutjoint/core/start/start.hpp"

namespace cutjoint {

/// Copy values into lane k.
void put_lane(int k, const auto& values, auto& numbers) {
  for (std::size_t i = 0; i < numbers.size(); ++i) numbers[i].v[k] = values[i];
}

/// Copy a state into lane k.
template <class Single, int N, class... One, class... Several>
void put_lane(int k, const State<Single, One...>& state, State<Lanes<Single, N>, Several...>& states) {
  states.t.v[k] = state.t;
  put_lane(k, state.q, states.q), put_lane(k, state.v, states.v);
  put_lane(k, state.vdot, states.vdot), put_lane(k, state.lambda, states.lambda);
}

/// The numbers of lane k.
void read_lane(int k, const auto& numbers, auto& values) {
  for (std::size_t i = 0; i < numbers.size(); ++i) values[i] = numbers[i][k];
}

/// The state of lane k.
template <class Single, int N, class... One, class... Several>
void read_lane(int k, const State<Lanes<Single, N>, Several...>& states, State<Single, One...>& state) {
  state.t = states.t[k];
  read_lane(k, states.q, state.q), read_lane(k, states.v, state.v);
  read_lane(k, states.vdot, state.vdot), read_lane(k, states.lambda, state.lambda);
}

/// The start of an instance: a consistent state, parameters, roads and inputs.  `number` steps have been taken since
/// `origin`, s.  The sources of roads and inputs outlive the steps.
template <class StateOfOne>
struct LaneStart {
  const StateOfOne& state;
  const double* parameters;
  const double* penalties;
  const Road<double>* roads;
  InputSource<double> inputs{};
  double origin = 0.0;
  long number = 0;
  long steps_to_measurement = 1;  ///< steps until violations are measured
};

/// Steps of instances in lanes by the trapezoidal rule.
///
/// Each steps as if alone, up to rounding; its bits depend neither on other lanes nor on its own lane.  One that fails
/// stops at its last state, the others continue.  Between runs the instances may find accelerations of several states of one mechanism.
template <Sized M>
class LaneSteps {
 public:
  using Real = typename M::real_type;
  using Instances = Selection<Real>;
  using Mask = typename Instances::Mask;
  static constexpr int width = Instances::number;

  explicit LaneSteps(M& mechanism)
      : mechanism_(mechanism), roads_(sizes_of(mechanism).roads), parameters_(sizes_of(mechanism).parameters), penalties_(sizes_of(mechanism).cuts),
        state_(design_state(mechanism)), from_(state_), sources_(mechanism), steps_(mechanism, Real(1), FixedPoint{}), columns_(sizes_of(mechanism).columns),
        margins_(sizes_of(mechanism).guards), vdot_(sizes_of(mechanism).speeds), correction_(sizes_of(mechanism).equations),
        rate_(correction_.size()) {}

  LaneSteps(const LaneSteps&) = delete;
  LaneSteps& operator=(const LaneSteps&) = delete;

  /// Accelerations and multipliers of several states of one mechanism, given by `like`; no lane is running.
  template <class StateOfOne>
  void accelerate(std::array<StateOfOne, width>& states, double motion, const double* parameters, const Stabilisation<double>& s,
                  const Road<double>* roads, const InputSource<double>& source) {
    for (int k = 0; k < width; ++k) {
      put_lane(k, at(states, k), state_);
      put_data(k, parameters, s.penalties, roads, source);
    }
    mechanism_.load(parameters_.data(), {.penalty = Real(s.penalty), .damping_ratio = Real(s.damping_ratio), .frequency = Real(s.frequency),
                                         .penalties = s.penalties ? penalties_.data() : nullptr}, roads_.data());
    drive();
    cutjoint::accelerate(mechanism_, state_, Real(motion), vdot_, correction_);
    for (int k = 0; k < width; ++k) read_lane(k, state_, at(states, k));
  }

  /// Stop all lanes.
  void clear() { running_ = Instances::all_if(false); }

  /// Put an instance into a lane; the first one fills lanes without one.
  template <class StateOfOne>
  void put(int k, const LaneStart<StateOfOne>& start) {
    const bool is_first = !any_running();
    for (int lane = is_first ? 0 : k; lane < (is_first ? width : k + 1); ++lane) fill(lane, start);
    running_[k] = -1;
  }

  /// Prepare for steps of the instances, which have the same settings; with `violation_limits` they stop if a loop is torn.
  void begin(const SimulationSettings& settings, const double* violation_limits = nullptr) {
    settings_ = settings;
    violation_limits_ = violation_limits;
    load_mechanism(mechanism_, parameters_.data(), roads_.data(), settings_.stabilisation, penalties_);
    drive();
    mechanism_.begin_step(state_.t, Real(1));
    steps_.set_fixed_point(settings_.fixed_point);
    steps_.reset_count();
  }

  bool any_running() const { return Instances::any(running_); }
  bool is_running(int k) const { return Instances::has(running_, k); }
  Mask running() const { return running_; }

  /// The fault of a lane.
  const Fault& fault(int k) const { return at(faults_, k); }

  /// Its time, s.
  double time(int k) const { return state_.t[k]; }

  /// Its evaluations since the beginning, until its iterations had converged.
  long evaluations(int k) const { return static_cast<long>(steps_.evaluations()[k]); }

  /// A step of the settings' length.
  void step() {
    integrate(Real(settings_.dt), origin_ + (number_ + Real(1)) * Real(settings_.dt));
    number_ = where(running_, number_ + Real(1), number_);
  }

  /// Step all from their common time to another; the last step is shorter if needed.
  void advance(double until) {
    const double rounding = 1e-9 * settings_.dt;
    while (any_running()) {
      const double left = until - present();
      if (!(left > rounding)) return;
      if (left + rounding >= settings_.dt) {
        step();
        continue;
      }
      integrate(Real(left), Real(until));
      origin_ = where(running_, state_.t, origin_);
      number_ = where(running_, Real(0), number_);
    }
  }

  /// Stop those in which a force that was left out would act at the end of a step.
  void watch([[maybe_unused]] Real number) {
    if constexpr (sizes.guards > 0) {
      if (margins_.empty()) return;
      mechanism_.guard(state_.q.data(), state_.v.data(), margins_.data());
      for (std::size_t i = 0; i < margins_.size(); ++i)
        for (int k = 0; k < width; ++k)
          if (is_running(k) && !(margins_[i][k] >= 0.0))
            stop(k, {.cause = Cause::guard_violated, .list = FaultList::guards, .index = static_cast<int>(i), .t = state_.t[k],
                     .step = static_cast<long>(number[k]), .value = -margins_[i][k]});
    }
  }

  /// Find the columns of all at the present states; of those that stopped in the last step, at their last ones.
  const auto& report() {
    mechanism_.report(state_.q.data(), state_.v.data(), state_.vdot.data(), state_.lambda.data(), columns_.data());
    return columns_;
  }

  /// Those of one.
  void columns(int k, double* columns) const { read_lane(k, columns_, columns); }

 protected:
  /// What the instance in a lane that stopped would go on from, but for the memory of its sources.
  void leave(int k, auto& memory) const {
    read_lane(k, state_, memory.state);
    steps_.expected().read_lane(k, memory.integrator.expected);
    memory.origin = origin_[k];
    memory.number = static_cast<long>(number_[k]);
    memory.steps_to_measurement = at(steps_to_measurement_, k);
  }

  /// The instance in a lane goes on from accelerations that have been.
  void expect(int k, const auto& expected) { steps_.expected().put_lane(k, expected); }

  /// The instance in a lane goes on from elsewhere; with a fault it stops there.
  template <class StateOfOne>
  void resume(int k, const LaneStart<StateOfOne>& start, const Fault& fault) {
    fill(k, start);
    running_[k] = -1;
    if (fault) stop(k, fault);
    evaluated_.v[k] = start.state.t;
    mechanism_.begin_step(evaluated_, Real(1));
  }

 private:
  static constexpr Sizes sizes = static_sizes<M>();

  static auto& at(auto& items, int k) { return items[static_cast<std::size_t>(k)]; }

  template <class StateOfOne>
  void fill(int k, const LaneStart<StateOfOne>& start) {
    put_lane(k, start.state, state_);
    Mask which = Instances::all_if(false);
    which[k] = -1;
    steps_.expected().forget(which);
    put_data(k, start.parameters, start.penalties, start.roads, start.inputs);
    origin_.v[k] = start.origin;
    number_.v[k] = static_cast<double>(start.number);
    at(steps_to_measurement_, k) = start.steps_to_measurement;
  }

  void put_data(int k, const double* parameters, const double* penalties, const Road<double>* roads, const InputSource<double>& source) {
    put_lane(k, parameters, parameters_);
    if (penalties) put_lane(k, penalties, penalties_);
    for (std::size_t i = 0; i < roads_.size(); ++i) roads_[i].put(k, roads[i]);
    at(inputs_, k) = source;
  }

  /// The mechanism takes inputs from the source of each lane.
  void drive() {
    if constexpr (sizes.inputs > 0) sources_.drive(mechanism_, [this](int k) { return at(inputs_, k); });
  }

  /// The time of those that go.
  double present() const {
    for (int k = 0; k < width; ++k)
      if (is_running(k)) return state_.t[k];
    return 0.0;
  }

  /// Tell sources of a step.  Instances whose inputs have parts within it stop before.  Where inputs jump, the step begins with their
  /// accelerations, as in FixedPointSteps.  Returns the instances whose loops may be left open.
  Mask begin_inputs(Real until) {
    Mask jump = Instances::all_if(false), opens = jump;
    for (int k = 0; k < width; ++k) {
      const InputSource<double>& source = at(inputs_, k);
      if (!is_running(k) || !source.begin) continue;
      const StepBegin begin = source.begin(source.host, state_.t[k], until[k]);
      if (begin.jumps) jump[k] = -1;
      if (begin.opens) opens[k] = -1;
      if (begin.parts) stop(k, {});
    }
    if (!Instances::any(jump)) return opens;
    steps_.restart(state_, penalties_, jump);
    return opens;
  }

  /// Close loops that a step has left open behind guides that jump, as a simulation alone does; returns those that stay open.
  Mask project_after_jumps(Mask opens) {
    mechanism_.constraint_residual(state_.q.data(), state_.v.data(), correction_.data(), rate_.data());
    for (int k = 0; k < width; ++k) {
      if (!Instances::has(opens, k)) continue;
      const auto is_closed = [&](const Equations<M>& open, double per) {
        return largest_violation(open.size(), violation_limits_, [&](std::size_t i) { return per * open[i][k]; }).is_closed();
      };
      if (is_closed(correction_, 1.0) && is_closed(rate_, closing_time(settings_))) opens[k] = 0;
    }
    return Instances::any(opens) ? steps_.projection().close(state_, opens) : opens;
  }

  void integrate(Real h, Real until) {
    Mask opens = Instances::all_if(false);
    if constexpr (sizes.inputs > 0) opens = begin_inputs(until);
    opens = Instances::both(opens, running_);
    if (!any_running()) return;
    const Real begun = state_.t;
    if (violation_limits_ && Instances::any(opens)) from_ = state_;
    steps_.set_step(h);
    Mask failed = steps_.step_of(state_, running_);
    for (int k = 0; k < width; ++k)
      if (Instances::has(failed, k)) stop(k, steps_.fault(k, static_cast<long>(number_[k]) + 1));
    opens = Instances::without(opens, failed);
    if (violation_limits_ && Instances::any(opens)) {
      opens = project_after_jumps(opens);
      for (int k = 0; k < width; ++k)
        if (Instances::has(opens, k)) stop(k, steps_.projection().fault(k, static_cast<long>(number_[k]) + 1));
      save_before(opens);
      failed = Instances::either(failed, opens);
    }
    evaluated_ = where(failed, begun, begun + h);
    if (Instances::any(failed)) mechanism_.begin_step(evaluated_, Real(1));
    state_.t = where(running_, until, state_.t);
    if (violation_limits_) watch_violations();
    watch(number_ + Real(1));
  }

  /// Some are as they were before the step.
  void save_before(Mask which) {
    Instances::take_all(which, from_.q, state_.q), Instances::take_all(which, from_.v, state_.v);
    Instances::take_all(which, from_.vdot, state_.vdot), Instances::take_all(which, from_.lambda, state_.lambda);
  }

  /// Stop those of which a loop is torn, as a simulation alone does.
  void watch_violations() {
    bool due = false;
    for (int k = 0; k < width; ++k) due |= is_running(k) && --at(steps_to_measurement_, k) <= 0;
    if (!due) return;
    mechanism_.constraint_residual(state_.q.data(), state_.v.data(), correction_.data(), rate_.data());
    for (int k = 0; k < width; ++k) {
      if (!is_running(k) || at(steps_to_measurement_, k) > 0) continue;
      const ConstraintViolation violation = largest_violation(sizes_of(mechanism_).equations, violation_limits_, [&](std::size_t i) { return correction_[i][k]; });
      at(steps_to_measurement_, k) = violation.next_measurement();
      if (violation.is_torn()) stop(k, violation.fault(state_.t[k], static_cast<long>(number_[k]) + 1));
    }
  }

  void stop(int k, const Fault& fault) {
    running_[k] = 0;
    at(faults_, k) = fault;
  }

  M& mechanism_;
  SimulationSettings settings_{};
  Array<M, sizes.roads, Road<Real>> roads_;
  Array<M, sizes.parameters> parameters_;
  Cuts<M> penalties_;
  StateOf<M> state_, from_;
  Real evaluated_{0};           ///< the times at which the mechanism is
  Real origin_{0}, number_{0};  ///< of whole steps since the origin
  std::array<InputSource<double>, width> inputs_;
  LaneInputs<M> sources_;
  Trapezoidal<M> steps_;
  Array<M, sizes.columns> columns_;
  Array<M, sizes.guards> margins_;
  Speeds<M> vdot_;
  Equations<M> correction_, rate_;
  const double* violation_limits_ = nullptr;
  std::array<long, width> steps_to_measurement_{};
  Mask running_{};
  std::array<Fault, width> faults_{};
};

/// A mechanism that may have SIMD instances for accelerations, as needed by the search for an equilibrium, which mostly evaluates
/// neighbouring states.
template <class Alone, class Instances>
class SideBySide : public Alone {
 public:
  using Alone::Alone;

  /// How many states it accelerates at once.
  static constexpr std::size_t states_at_once = LaneSteps<Instances>::width;

  /// Use instances for accelerations of several states; they must be idle and outlive this use.
  void lend(LaneSteps<Instances>& lanes) { lanes_ = &lanes; }

  void load(const double* parameters, const Stabilisation<double>& stabilisation, const Road<double>* roads) {
    Alone::load(parameters, stabilisation, roads);
    parameters_ = parameters;
    stabilisation_ = stabilisation;
    roads_ = roads;
  }

  void drive_by(const InputSource<double>& source) requires requires(Alone& alone) { alone.drive_by(source); } {
    Alone::drive_by(source);
    source_ = source;
  }

  /// `cutjoint::accelerate` for several states at a time.
  void accelerate(std::array<StateOf<Alone>, states_at_once>& states, double motion) {
    if (lanes_) return lanes_->accelerate(states, motion, parameters_, stabilisation_, roads_, source_);
    Speeds<Alone> next(sizes_of(*this).speeds);
    Equations<Alone> correction(sizes_of(*this).equations);
    for (StateOf<Alone>& state : states) cutjoint::accelerate<Alone>(*this, state, motion, next, correction);
  }

 private:
  LaneSteps<Instances>* lanes_ = nullptr;
  const double* parameters_ = nullptr;
  Stabilisation<double> stabilisation_;
  const Road<double>* roads_ = nullptr;
  InputSource<double> source_;
};

}  // namespace cutjoint
