// Derivatives of the end of a step with respect to its beginning, inputs and parameters.
#pragma once

#include <cstring>

#include "cutjoint/core/derivatives/substep_derivatives.hpp"

namespace cutjoint {

/// `Derivatives` of a `Simulation` with the trapezoidal rule, an explicit method or Radau IIA; step lengths chosen by error control count as constants.
///
/// The step is taken, and its substeps are differentiated as they were taken.
template <class Simulation, Sized D, Sized S, std::size_t dofs, class ForceResidual>
class StepDerivatives : public SubstepDerivatives<Simulation, D, S, dofs, ForceResidual> {
 public:
  using Base = SubstepDerivatives<Simulation, D, S, dofs, ForceResidual>;
  using typename Base::M, typename Base::Minimal;
  using Base::inputs, Base::states;

  static constexpr std::size_t parameters = M::sizes.parameters;

  /// Take a step. Matrices by rows, with a row for each state: by the states before the step, by a constant shift of each input
  /// during it, by parameters; a null pointer where one is not wanted. On a fault the simulation is unchanged.
  Fault step(Simulation& simulation, Minimal& minimal, double* by_state, double* by_input, double* by_parameter) {
    blocks_ = {{{by_state, states}, {by_input, inputs, 0}, {by_parameter, parameters, inputs}}};
    for (const Block& block : blocks_)
      if (block.matrix) std::fill_n(block.matrix, states * block.width, 0.0);
    for (std::size_t i = 0; by_state && i < states; ++i) by_state[i * states + i] = 1.0;
    is_loaded_ = false;
    open(simulation, minimal, nullptr);
    return take(simulation);
  }

  /// Rows of a matrix of seeds: states, values that controllers hold, and what is carried from step to step: changes of coordinates and velocities, and
  /// the differences of accelerations (also averaged ones) and multipliers from those that states give; with loops room for a derivative.
  static constexpr std::size_t rows = states + M::sizes.discrete + M::sizes.coordinates + (Base::averages ? 3 : 2) * M::sizes.speeds +
                                      (Base::m == 0 ? 0 : std::max(M::sizes.equations, M::sizes.coordinates));

  /// Seeds of a run: the derivative of states along each, then of values that controllers hold and of what is carried, a matrix (rows, number) by rows; and what
  /// each seed changes besides: the index of an input, that of a parameter after those of inputs, or -1.
  struct Directions {
    double* matrix;
    std::size_t number;
    const int* by;
  };

  /// Outputs of a run by their indices, with their derivatives along the seeds, at the beginning and after each `every` steps.
  struct Trajectory {
    std::size_t number;
    const int* outputs;
    long every;
    double *values, *derivatives;
  };

  /// Events of a run: the number wanted and the number found; of each the indicator, its time (most) and the derivative of the time along
  /// the seeds (most, number), the outputs after it (most, reported) and their derivatives at the moving time (most, reported, number).
  struct Events {
    int most = 0;
    int* found = nullptr;
    int* which = nullptr;
    double *times = nullptr, *derivatives_of_times = nullptr, *values = nullptr, *derivatives = nullptr;
  };

  /// Record the events of the next run with seeds.
  void record_events(const Events& events) { events_ = events; }

  /// Take this many steps; seeds are then those of the end, and so is the choice of independent coordinates, which is made again when ill-conditioned.
  Fault run(Simulation& simulation, Minimal& minimal, long steps, const Directions& along, Trajectory trajectory) {
    blocks_ = {{{along.matrix, along.number, -1, along.by, M::sizes.discrete}, {}, {}}};
    open(simulation, minimal, along.matrix + (states + M::sizes.discrete) * along.number);
    if (this->trajectories_) this->trajectories_->change_seeds(InputTrajectories<inputs>::Seeded::changes);
    trajectory_ = &trajectory;
    if (events_.found) *events_.found = 0;
    const Fault lacks = find_carried();
    const Fault fault = lacks ? lacks : go_on(steps, trajectory), left = lacks ? lacks : find_states();
    events_ = {};
    return fault ? fault : left;
  }

 protected:
  using Base::n, Base::joints, Base::is_explicit, Base::reuses_accelerations, Base::carries_derivative, Base::no_row, Base::loaded_, Base::is_derivative_known_, Base::coordinate_rates_;
  using Base::averages, Base::indicators, Base::dt_begin_, Base::cut_, Base::dt_end_, Base::charts, Base::delta_, Base::du_, Base::dx_, Base::lambda_, Base::mechanism_, Base::parameters_, Base::q_, Base::rate_, Base::reference_, Base::v_, Base::vdot_;
  using typename Base::Steps;

  /// Records substeps, controller samples and output samples instead of differentiating them.
  struct Recorder {
    Fault (*part)(void* who, const StateOf<M>& from, const StateOf<M>& end, double h) = nullptr;
    Fault (*sample)(void* who, std::size_t first, std::size_t number) = nullptr;
    Fault (*row)(void* who, Trajectory& trajectory) = nullptr;
    void* who = nullptr;
  };

  /// The rows of a matrix, or none, and what its columns change besides states: indices from one on, those of a list, or nothing (-1).
  struct Block {
    double* matrix = nullptr;
    std::size_t width = 0;
    int first = -1;
    const int* by = nullptr;
    std::size_t discrete = 0;  ///< values of controllers, with rows after those of states

    int at(std::size_t column) const { return by ? by[column] : first < 0 ? -1 : first + static_cast<int>(column); }
  };

  void open(Simulation& simulation, Minimal& minimal, double* carried) {
    simulation_ = &simulation;
    minimal_ = &minimal;
    carried_ = carried;
    this->wants_derivative_ = carries_derivative && carried;
    begins_at_event_ = false;
    last_derivative_.fill(std::numeric_limits<double>::quiet_NaN());
    this->trajectories_ = simulation.trajectories();
    this->along_ = {};
    simulation.apply_settings();  // the steps that are watched are those of the settings
    simulation.complete_state();
    if constexpr (averages) {
      const auto& newton = simulation.steps().newton();
      this->rule_ = newton_settings(simulation.settings()).rule;
      next_means_ = newton.means(), restarts_ = newton.restarts();
      restarts_average_ = was_short_ = false;
    }
    load_all();
  }

  /// Everything that is constant during the steps; parameters are loaded with the seeds.
  void load_all() {
    this->load(*simulation_, *minimal_);
    loaded_ = no_row;
  }

  Fault go_on(long steps, Trajectory& trajectory) {
    Simulation& simulation = *simulation_;
    if constexpr (M::sizes.discrete > 0) {
      const auto& sampling = simulation.sampling();
      for (std::size_t i = 0; i < sampling.size(); ++i)
        if (sampling.is_of(i, simulation.state().t, 1e-9 * simulation.settings().dt))
          if (const Fault fault = sample(sampling.first_of(i), sampling.discrete_by(i))) return fault;
    }
    if (const Fault fault = report(trajectory)) return fault;
    is_loaded_ = false;
    for (long i = 1; i <= steps; ++i) {
      if (const Fault fault = take(simulation)) return fault;
      if (i % trajectory.every == 0)
        if (const Fault fault = report(trajectory)) return fault;
    }
    return {};
  }

  Fault take(Simulation& simulation) {
    const auto before = simulation.memory();
    const auto sample = blocks_[0].discrete > 0 ? &on_sample : nullptr;
    Fault fault;
    if constexpr (Base::is_stepped) {
      auto& stepper = simulation.steps().stepper();
      last_ = simulation.state();
      substep_fault_ = this->refused_ = {};
      count_indicators(stepper);
      stepper.watch({&on_accepted_step, this});
      simulation.watch_substeps({nullptr, sample, this});
      fault = simulation.step();
      stepper.watch({});
      if (!fault || has_made_step(fault)) {
        if (!substep_fault_) substep_fault_ = end_at_event();
        if (substep_fault_) fault = substep_fault_;
      }
    } else {
      substeps_ = count_substeps(simulation.steps());
      simulation.watch_substeps({&on_substep, sample, this});
      fault = simulation.step();
    }
    simulation.watch_substeps({});
    if (fault && !has_made_step(fault)) simulation.restore(before);
    return fault;
  }

  std::size_t count_columns() const {
    std::size_t columns = 0;
    for (const Block& block : blocks_)
      if (block.matrix) columns += block.width;
    return columns;
  }

  /// Apply a function to all seeds, in lanes; arguments are the first seed and the number.
  Fault for_seeds(auto use) {
    const std::size_t columns = count_columns();
    for (std::size_t first = 0; first < columns; first += seeds_at_once)
      if (const Fault fault = use(first, std::min(seeds_at_once, columns - first))) return fault;
    return {};
  }

  /// A sample of outputs at the present state, with their derivatives along the seeds.
  Fault report(Trajectory& trajectory) {
    if (recorder_.row) return recorder_.row(recorder_.who, trajectory);
    if (trajectory.number == 0) return {};
    const std::size_t columns = count_columns();
    const double* known = simulation_->report();
    for (std::size_t i = 0; i < trajectory.number; ++i) *trajectory.values++ = known[trajectory.outputs[i]];
    const auto& state = simulation_->complete_state();
    const Fault fault = for_seeds([&](std::size_t first, std::size_t number) -> Fault {
      if (const Fault odd = load_seeds(state, first, number)) return odd;
      Base::report(state.t);
      for (std::size_t i = 0; i < trajectory.number; ++i)
        for (std::size_t k = 0; k < number; ++k)
          trajectory.derivatives[i * columns + first + k] = this->columns_[static_cast<std::size_t>(trajectory.outputs[i])].derivative[k];
      return {};
    });
    trajectory.derivatives += trajectory.number * columns;
    return fault;
  }

  /// From derivatives of states to those of everything that is carried from step to step.
  Fault find_carried() {
    const auto& state = simulation_->complete_state();
    std::copy(state.vdot.begin(), state.vdot.end(), known_.begin());
    double* const carried = carried_;
    return for_seeds([&](std::size_t first, std::size_t number) -> Fault {
      carried_ = nullptr;
      const Fault fault = load_seeds(state, first, number);
      carried_ = carried;
      if (fault) return fault;
      visit_carried(first, [&](Dual& x, const double* row, Carried kind) {
        for (std::size_t k = 0; k < number && kind != Carried::state; ++k) x.derivative[k] += row[k];
      });
      store_carried(first, number);
      return {};
    });
  }

  /// From these to derivatives of states, with independent coordinates chosen again if they are ill-conditioned.
  Fault find_states() {
    const auto& state = simulation_->complete_state();
    if (minimal_->is_ill_conditioned(simulation_->starter(), simulation_->state()))
      if (const Fault fault = minimal_->choose(simulation_->starter(), simulation_->state())) return fault;
    std::copy(minimal_->choice().reference.begin(), minimal_->choice().reference.end(), reference_.begin());
    return for_seeds([&](std::size_t first, std::size_t number) -> Fault {
      if (const Fault fault = load_seeds(state, first, number)) return fault;
      store_states(first, number);
      if (!this->enter(simulation_->mechanism(), state) || !this->find_accelerations()) return this->not_finite();
      restart_average();
      visit_carried(first, [&](const Dual& x, double* row, Carried kind) {
        for (std::size_t k = 0; k < number && kind != Carried::state; ++k) row[k] = reuses_accelerations || kind == Carried::mean ? row[k] - x.derivative[k] : 0.0;
      });
      return {};
    });
  }

  /// What is carried from step to step: states, a remainder that they do not determine, and accelerations that a rule averages.
  enum class Carried { state, rest, mean };

  /// Visit the carried numbers, with their derivatives along the seeds from one on.
  void visit_carried(std::size_t first, auto use) {
    double* row = carried_ + first;
    const auto all = [&](auto& numbers, Carried kind) {
      for (Dual& x : numbers) use(x, row, kind), row += blocks_[0].width;
    };
    all(q_, Carried::state), all(v_, Carried::state), all(vdot_, Carried::rest);
    if constexpr (carries_derivative) all(coordinate_rates_, Carried::rest);
    else all(lambda_, Carried::rest);
    if constexpr (averages) all(this->mean_, Carried::mean);
  }

  /// The rule continues with the accelerations of the state.
  void restart_average() {
    if constexpr (averages) this->mean_ = vdot_;
  }

  void store_carried(std::size_t first, std::size_t number) {
    visit_carried(first, [number](const Dual& x, double* row, Carried) { copy_derivatives(reinterpret_cast<const double*>(&x.derivative), number, row); });
  }

  /// This many derivatives, usually all.
  [[gnu::always_inline]] static void copy_derivatives(const double* from, std::size_t number, double* to) {
    if (number == seeds_at_once) std::memcpy(to, from, sizeof(Tangents));
    else std::copy_n(from, number, to);
  }

  /// Number of steps or substeps that the integrator has taken with the present one; Newton methods may divide steps.
  long count_substeps(const Steps& steps) const {
    if constexpr (requires { steps.newton(); }) return substeps_ + 1 + steps.newton().substeps();
    else return substeps_ + 1;
  }

  static Fault on_substep(void* who, const StateOf<M>& from, double h) {
    StepDerivatives* const self = static_cast<StepDerivatives*>(who);
    if (self->count_substeps(self->simulation_->steps()) != ++self->substeps_) return {.cause = Cause::step_subdivided, .t = from.t};
    return self->follow(from, self->simulation_->state(), h);
  }

  static Fault on_sample(void* self, std::size_t first, std::size_t number) { return static_cast<StepDerivatives*>(self)->sample(first, number); }

  /// A controller's sample: the values that it holds change with the present state.
  Fault sample([[maybe_unused]] std::size_t at, [[maybe_unused]] std::size_t discrete) {
    if constexpr (indicators > 0)
      if (const Fault fault = end_at_event()) return fault;
    if constexpr (Base::has_stages) known_.fill(std::numeric_limits<double>::quiet_NaN());
    if (recorder_.sample) return recorder_.sample(recorder_.who, at, discrete);
    if constexpr (M::sizes.discrete > 0) {
      const auto& state = simulation_->complete_state();
      Fixed<Dual, M::sizes.discrete> next;
      bool changes = false;
      const Fault fault = for_seeds([&](std::size_t first, std::size_t number) -> Fault {
        if (const Fault odd = load_seeds(state, first, number)) return odd;
        if constexpr (Base::has_system) this->system_.begin_step(state.t, 1.0);
        this->subject().sample(q_.data(), v_.data(), vdot_.data(), lambda_.data(), next.data());
        for (std::size_t i = at; i < at + discrete; ++i)
          for (std::size_t k = 0; k < number; ++k) {
            double& derivative = blocks_[0].matrix[(states + i) * blocks_[0].width + first + k];
            changes = changes || derivative != next[i].derivative[k];
            derivative = next[i].derivative[k];
          }
        return {};
      });
      if (changes) forget_carried();
      return fault;
    }
    return {};
  }

  /// Discard carried derivatives of accelerations, which are computed from the state.
  void forget_carried() { known_.fill(std::numeric_limits<double>::quiet_NaN()), last_derivative_.fill(std::numeric_limits<double>::quiet_NaN()); }

  /// Whether the substep from a state begins with accelerations that an input trajectory has changed.
  bool begins_anew(const StateOf<M>& from) const { return this->trajectories_ && this->trajectories_->begins_anew(from.t); }

  /// A method has taken a step, or its substep before an event.
  static void on_accepted_step(void* who, auto& scheme) {
    StepDerivatives* const self = static_cast<StepDerivatives*>(who);
    if (self->substep_fault_) return;
    StateOf<M> end = self->last_;
    if constexpr (Base::has_stages) {
      end = scheme.stages().present();
      scheme.stages().read(self->points_);
    } else {
      std::copy_n(scheme.pose(), end.q.size(), end.q.begin());
      std::copy_n(scheme.pose() + end.q.size(), n, end.v.begin());
      end.t = scheme.time();
    }
    self->count_indicators(self->simulation_->steps().stepper());
    double h = end.t - self->last_.t;
    if constexpr (indicators > 0) {
      const auto [begin, length] = scheme.last_step();
      if (end.t != begin + length || self->cut_.left > 0) self->cut_.is_made = true, self->cut_.share = (end.t - begin) / length, h = length;
    }
    self->substep_fault_ = self->follow(self->last_, end, h);
    self->last_ = end;
  }

  /// Count the indicators that have changed mode since the last count. If all is continuous, the time of the change has no effect.
  void count_indicators(const auto& stepper) {
    cut_ = {};
    for (std::size_t i = 0; i < indicators; ++i) {
      const long number = stepper.counts().by_indicator[i];
      if (number != counted_[i] && !Base::Subject::indicators[i].is_continuous) cut_.which[cut_.left++] = i;
      counted_[i] = number;
    }
  }

  /// A substep has ended at an event whose time depends on the seeds: no other event may coincide.
  Fault end_at_event() {
    if (!std::exchange(begins_at_event_, false)) return {};
    for (std::size_t k = 0; k < count_columns(); ++k)
      if (time_row()[k] != 0.0) return cut_.fault(Cause::event_at_step_end, last_.t);
    return {};
  }

  /// The derivative of the event's time, stored in place of accelerations, which are computed anew after the event.
  double* time_row() { return carried_ + M::sizes.coordinates * blocks_[0].width + n * blocks_[0].width; }

  /// A substep has been taken between two states: propagate derivatives from its beginning to its end.
  Fault follow(const StateOf<M>& from, const StateOf<M>& end, double h) {
    if (cut_.left > 0 && !carried_ && !recorder_.part) return cut_.fault(Cause::step_subdivided, from.t);
    if (begins_anew(from)) forget_carried();
    if constexpr (averages) {
      const auto& newton = simulation_->steps().newton();
      restarts_average_ = was_short_ || newton.restarts() - is_short(h) != restarts_;
      this->means_ = restarts_average_ ? from.vdot : next_means_;
      next_means_ = newton.means(), restarts_ = newton.restarts(), was_short_ = is_short(h);
    }
    if constexpr (carries_derivative) {
      const auto& first = simulation_->steps().stepper().scheme().formula().first_derivative();
      is_derivative_known_ = (carried_ || recorder_.part) && std::equal(first.begin(), first.end(), last_derivative_.begin());
      std::copy(first.begin(), first.end(), first_derivative_.begin());
    }
    const Fault fault = recorder_.part ? recorder_.part(recorder_.who, from, end, h) : propagate_all(from, end, h);
    std::copy(end.vdot.begin(), end.vdot.end(), known_.begin());
    if (cut_.is_made || is_short(h)) known_.fill(std::numeric_limits<double>::quiet_NaN());
    begins_at_event_ = cut_.left > 0;
    if (begins_at_event_ && events_.found) ++*events_.found;
    if constexpr (carries_derivative) {
      const auto& last = simulation_->steps().stepper().scheme().formula().last_derivative();
      is_derivative_known_ = false;
      if (cut_.is_made) last_derivative_.fill(std::numeric_limits<double>::quiet_NaN());
      else std::copy(last.begin(), last.end(), last_derivative_.begin());
    }
    return fault;
  }

  /// Record an event: the derivative of its time, and outputs there for the host.
  Fault keep_event(const StateOf<M>& end, std::size_t first, std::size_t number) {
    for (std::size_t k = 0; k < number; ++k) time_row()[first + k] = dt_end_[k];
    if (!events_.found || *events_.found >= events_.most) return {};
    const auto at = static_cast<std::size_t>(*events_.found);
    const std::size_t columns = count_columns();
    events_.which[at] = static_cast<int>(cut_.which[0]);
    events_.times[at] = end.t;
    for (std::size_t k = 0; k < number; ++k) events_.derivatives_of_times[at * columns + first + k] = dt_end_[k];
    for (std::size_t i = 0; i < q_.size(); ++i) q_[i].value = end.q[i];
    for (std::size_t i = 0; i < n; ++i) v_[i].value = end.v[i];
    if (!this->enter(simulation_->mechanism(), end)) return this->not_finite();
    this->set_dual_time({end.t, dt_end_});
    if (!this->find_accelerations()) return this->not_finite();
    Base::report(Dual(end.t, dt_end_));
    for (std::size_t i = 0; i < trajectory_->number; ++i) {
      const Dual& x = this->columns_[static_cast<std::size_t>(trajectory_->outputs[i])];
      events_.values[at * trajectory_->number + i] = x.value;
      for (std::size_t k = 0; k < number; ++k) events_.derivatives[(at * trajectory_->number + i) * columns + first + k] = x.derivative[k];
    }
    return {};
  }

  Fault propagate_all(const StateOf<M>& from, const StateOf<M>& end, double h) {
    if (!is_loaded_) load_all();
    is_loaded_ = true;
    if (count_columns() > 0 && !this->prepare_substep(*simulation_, from, end, h)) return not_finite_step(end);
    const Fault fault = for_seeds([&](std::size_t first, std::size_t number) { return propagate_seeds(from, end, h, first, number); });
    simulation_->mechanism().begin_step(end.t, 1.0);
    return fault;
  }

  Fault propagate_seeds(const StateOf<M>& from, const StateOf<M>& end, double h, std::size_t first, std::size_t number) {
    for (;;) {
      if (const Fault fault = load_seeds(from, first, number)) return fault;
      if (this->go(*simulation_, from, end, h)) break;
      if (this->refused_) return this->refused_;
      if (!this->force_residual_.leave_out_infinite() || !this->prepare_substep(*simulation_, from, end, h)) return not_finite_step(end);
    }
    if (!this->project_end(*simulation_, end)) return {.cause = Cause::pose_singular, .t = end.t};
    if (this->speeds_jump(end)) return cut_.fault(Cause::speeds_jump, end.t);
    if (carried_) store_carried(first, number);
    else store_states(first, number);
    if constexpr (indicators > 0)
      if (cut_.left > 0) return keep_event(end, first, number);
    return {};
  }

  /// Whether Newton's iteration computes the accelerations at the end of a substep of this length anew.
  bool is_short(double h) const { return (Base::seeks_multipliers || averages) && h < simulation_->settings().dt / 100; }

  static Fault not_finite_step(const StateOf<M>& end) { return {.cause = Cause::accelerations_not_finite, .t = end.t}; }

  /// Derivatives of coordinates, velocities, accelerations and multipliers of a state along the seeds.
  Fault load_seeds(const StateOf<M>& state, std::size_t first, std::size_t number) {
    M& mechanism = simulation_->mechanism();
    mechanism.begin_step(state.t, 1.0);
    seed_columns(first, number);
    dt_begin_ = Tangents{};
    for (std::size_t k = 0; k < number && begins_at_event_; ++k) dt_begin_[k] = time_row()[first + k];
    if (!carried_ || !is_known(state))
      if (!this->enter(mechanism, state)) return this->not_finite();
    if (!carried_) {
      if (first == 0)
        if (const Fault fault = minimal_->decompose(simulation_->starter(), state)) return fault;
      if (!this->derive_motion(*minimal_)) return this->not_finite();
      restart_average();
      return {};
    }
    return load_carried(mechanism, state, first, number) ? Fault{} : this->not_finite();
  }

  /// Whether what is carried has the derivatives of a state's accelerations.
  bool is_known(const StateOf<M>& state) const {
    return carries_derivative ? is_derivative_known_ : reuses_accelerations && std::equal(known_.begin(), known_.end(), state.vdot.begin());
  }

  /// The same from carried derivatives; accelerations that are not carried are computed from the state.
  bool load_carried(M& mechanism, const StateOf<M>& state, std::size_t first, std::size_t number) {
    this->state_ = &state;
    this->take_inputs(mechanism);
    this->set_dual_time({state.t, dt_begin_});
    const auto take = [](const auto& values, auto& numbers) {
      for (std::size_t i = 0; i < numbers.size(); ++i) numbers[i].value = values[i];
    };
    take(state.q, q_), take(state.v, v_);
    const bool is_carried = is_known(state);
    if (is_carried && carries_derivative) {
      std::copy_n(first_derivative_.begin(), coordinate_rates_.size(), coordinate_rates_.begin());
      std::copy_n(first_derivative_.begin() + coordinate_rates_.size(), n, vdot_.begin());
    } else if (is_carried) {
      take(state.vdot, vdot_), take(state.lambda, lambda_);
    }
    visit_carried(first, [&](Dual& x, const double* row, Carried kind) {
      if (!is_carried && kind == Carried::rest) return;
      if (number < seeds_at_once) x.derivative = Tangents{};
      copy_derivatives(row, number, reinterpret_cast<double*>(&x.derivative));
    });
    if (!is_carried && !this->find_accelerations()) return false;
    if (restarts_average_) restart_average();
    return true;
  }

  /// Visit the columns of all matrices in order: the seed, the matrix, and the column in it.
  void visit(std::size_t first, std::size_t number, auto use) {
    for (std::size_t k = 0; k < number; ++k) {
      std::size_t column = first + k, which = 0;
      while (!blocks_[which].matrix || column >= blocks_[which].width) {
        if (blocks_[which].matrix) column -= blocks_[which].width;
        ++which;
      }
      use(k, blocks_[which], column);
    }
  }

  /// What columns change at the beginning of a substep.
  void seed_columns(std::size_t first, std::size_t number) {
    dx_.fill(Dual());
    du_.fill(Dual());
    for (Dual& x : parameters_) x.derivative = Tangents{};
    this->ddiscrete_.fill(Dual());
    std::size_t row = plain_row;
    visit(first, number, [&](std::size_t k, const Block& block, std::size_t column) {
      for (std::size_t i = 0; i < states; ++i) dx_[i].derivative[k] = block.matrix[i * block.width + column];
      for (std::size_t i = 0; i < block.discrete; ++i) this->ddiscrete_[i].derivative[k] = block.matrix[(states + i) * block.width + column];
      const int by = block.at(column), parameter = by - static_cast<int>(inputs);
      if (parameter >= 0) parameters_[static_cast<std::size_t>(parameter)].derivative[k] = 1.0, row = first;
      else if (by >= 0) du_[numbers_per_input * static_cast<std::size_t>(by)].derivative[k] = 1.0;
    });
    if (row != loaded_) this->load_parameters(*simulation_);
    loaded_ = row;
    if (this->trajectories_) this->change_trajectories(first, number);
  }

  /// Independent coordinates and rates at the end.
  void store_states(std::size_t first, std::size_t number) {
    displacement<Dual>(charts(), reference_.data(), q_.data(), delta_.data());
    chart_rates<Dual>(charts(), delta_.data(), v_.data(), rate_.data());
    this->gather_derivatives(delta_, *minimal_, dx_.data());
    this->gather_derivatives(rate_, *minimal_, dx_.data() + dofs);
    std::copy(v_.begin() + joints, v_.end(), dx_.begin() + 2 * dofs);
    visit(first, number, [this](std::size_t k, const Block& block, std::size_t column) {
      for (std::size_t i = 0; i < states; ++i) block.matrix[i * block.width + column] = dx_[i].derivative[k];
    });
  }

  static constexpr std::size_t plain_row = no_row - 1;  ///< loaded if no parameter changes

  Simulation* simulation_ = nullptr;
  Minimal* minimal_ = nullptr;
  Recorder recorder_;
  std::array<Block, 3> blocks_{};
  double* carried_ = nullptr;  ///< rows of a run's matrix that are carried from step to step
  Fixed<double, n> known_;     ///< the accelerations whose derivatives these are
  Fixed<double, carries_derivative ? M::sizes.coordinates + n : 0> first_derivative_, last_derivative_;  ///< derivatives at the beginning of an explicit substep, and at the end of the one before
  Fixed<double, averages ? n : 0> next_means_;  ///< accelerations that the rule of the next substep averages
  long restarts_ = 0;                            ///< as Newton's iteration counts them
  bool restarts_average_ = false, was_short_ = false;  ///< the next substep averages accelerations of the state; the last one was short
  bool is_loaded_ = false;     ///< what is constant during the steps, as taken at the first one
  long substeps_ = 0;  ///< as the integrator counts them
  StateOf<M> last_;  ///< end of the last step of an adaptive method
  Fault substep_fault_;                                     ///< why a step has no derivative
  Fixed<long, indicators> counted_;                      ///< how often indicators have changed mode
  bool begins_at_event_ = false;                       ///< the next substep begins at an event whose time depends on the seeds
  Events events_;
  const Trajectory* trajectory_ = nullptr;
};

}  // namespace cutjoint
