// Derivatives of the end of a step by its beginning, by inputs and by parameters.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>

#include "cutjoint/core/part_derivatives.hpp"

namespace cutjoint {

/// `Derivatives` of a `Simulation` whose steps go by the trapezoidal rule or by an explicit method, of an adaptive one with the lengths that it has chosen.
///
/// The step is made, and differentiated as it was, part by part.
template <class Simulation, Sized D, Sized S, std::size_t freedoms>
class StepDerivatives : public PartDerivatives<Simulation, D, S, freedoms> {
 public:
  using Base = PartDerivatives<Simulation, D, S, freedoms>;
  using typename Base::M, typename Base::Minimal;
  using Base::inputs, Base::states;

  static constexpr std::size_t parameters = M::sizes.parameters;

  /// Step the simulation.  Matrices by rows, of as many rows as there are states: by the states before the step, by a shift of each input during all of
  /// it, by parameters; a null pointer where one is not wanted.  Where there is a fault the simulation stays.
  Fault step(Simulation& simulation, Minimal& minimal, double* by_state, double* by_input, double* by_parameter) {
    blocks_ = {{{by_state, states}, {by_input, inputs, 0}, {by_parameter, parameters, inputs}}};
    for (const Block& block : blocks_)
      if (block.matrix) std::fill_n(block.matrix, states * block.width, 0.0);
    for (std::size_t i = 0; by_state && i < states; ++i) by_state[i * states + i] = 1.0;
    return take(simulation, minimal);
  }

  /// Directions of a run: how states change along each, and behind them what controllers hold, a matrix (states + held, number) by rows, and what
  /// changes beside them, the number of an input, that of a parameter behind those of inputs, or -1.
  struct Directions {
    double* matrix;
    std::size_t number;
    const int* by;
  };

  /// Outputs of a run by their numbers, with the change of each along directions, where it begins and behind each `every` steps.
  struct Course {
    std::size_t number;
    const int* outputs;
    long every;
    double *values, *slopes;
  };

  /// Step the simulation so many times; directions then are those of the end, and so is the choice of coordinates, which is made again where it has become poor.
  Fault play(Simulation& simulation, Minimal& minimal, long steps, const Directions& along, Course course) {
    blocks_ = {{{along.matrix, along.number, -1, along.by, M::sizes.held}, {}, {}}};
    if constexpr (M::sizes.held > 0) {
      simulation_ = &simulation;
      minimal_ = &minimal;
      const auto& sampling = simulation.sampling();
      for (std::size_t i = 0; i < sampling.size(); ++i)
        if (sampling.is_of(i, simulation.state().t, 1e-9 * simulation.settings().dt))
          if (const Fault fault = sample(sampling.first_of(i), sampling.held_by(i))) return fault;
    }
    if (const Fault fault = report(simulation, minimal, course)) return fault;
    for (long i = 1; i <= steps; ++i) {
      if (minimal.is_poor(simulation.starter(), simulation.state()))
        if (const Fault fault = choose_again(simulation, minimal)) return fault;
      if (const Fault fault = take(simulation, minimal)) return fault;
      if (i % course.every == 0)
        if (const Fault fault = report(simulation, minimal, course)) return fault;
    }
    return {};
  }

 private:
  using Base::n, Base::joints, Base::is_explicit;
  using Base::charts, Base::delta_, Base::du_, Base::dx_, Base::lambda_, Base::mechanism_, Base::parameters_, Base::q_, Base::rate_, Base::reference_, Base::v_, Base::vdot_;
  using typename Base::Steps;
  static constexpr bool is_adaptive = Steps::adaptive;

  /// The rows of a matrix, or none, and what changes along its columns beside states: the numbers from one on, those of a list, or, -1, nothing.
  struct Block {
    double* matrix = nullptr;
    std::size_t width = 0;
    int first = -1;
    const int* by = nullptr;
    std::size_t held = 0;  ///< values of controllers that have rows behind those of states

    int at(std::size_t column) const { return by ? by[column] : first < 0 ? -1 : first + static_cast<int>(column); }
  };

  Fault take(Simulation& simulation, Minimal& minimal) {
    const auto before = simulation.memory();
    simulation_ = &simulation;
    minimal_ = &minimal;
    const auto sample = blocks_[0].held > 0 ? &follow_sample : nullptr;
    Fault fault;
    if constexpr (is_adaptive) {
      last_ = simulation.state();
      followed_ = {};
      const long events = simulation.steps().events();
      simulation.steps().stepper().watch({&follow_length, this});
      simulation.watch_parts({nullptr, sample, this});
      fault = simulation.step();
      simulation.steps().stepper().watch({});
      if (!fault || has_made_step(fault)) {
        if (simulation.steps().events() != events) followed_ = {.cause = Cause::step_divided, .t = before.state.t};
        if (followed_) fault = followed_;
      }
    } else {
      parts_ = parts_taken(simulation.steps());
      simulation.watch_parts({&follow_part, sample, this});
      fault = simulation.step();
    }
    simulation.watch_parts({});
    if (fault && !has_made_step(fault)) simulation.restore(before);
    return fault;
  }

  std::size_t count_columns() const {
    std::size_t columns = 0;
    for (const Block& block : blocks_)
      if (block.matrix) columns += block.width;
    return columns;
  }

  /// A row of outputs at the present state, and how they change along directions.
  Fault report(Simulation& simulation, Minimal& minimal, Course& course) {
    if (course.number == 0) return {};
    const std::size_t columns = count_columns();
    simulation_ = &simulation;
    const double* known = simulation.report();
    for (std::size_t i = 0; i < course.number; ++i) *course.values++ = known[course.outputs[i]];
    if (const Fault fault = this->begin(simulation, minimal)) return fault;
    for (std::size_t first = 0; first < columns; first += directions) {
      const std::size_t number = std::min(directions, columns - first);
      begin_row(first, number);
      if (const Fault fault = this->derive(simulation.mechanism(), minimal, number)) return fault;
      for (std::size_t i = 0; i < course.number; ++i)
        for (std::size_t k = 0; k < number; ++k)
          course.slopes[i * columns + first + k] = this->columns_[static_cast<std::size_t>(course.outputs[i])].slope[k];
    }
    course.slopes += course.number * columns;
    return {};
  }

  /// Choose other independent coordinates in the present state, and put their changes in the place of those of the former ones.
  Fault choose_again(Simulation& simulation, Minimal& minimal) {
    const auto before = minimal.choice();
    if (const Fault fault = minimal.choose(simulation.starter(), simulation.state())) return fault;
    const auto after = minimal.choice();
    simulation_ = &simulation;
    minimal_ = &minimal;
    const std::size_t columns = count_columns();
    for (std::size_t first = 0; first < columns; first += directions) {
      const std::size_t number = std::min(directions, columns - first);
      minimal.restore(before);
      if (const Fault fault = this->begin(simulation, minimal)) return fault;
      begin_row(first, number);
      mechanism_.begin_step(simulation.state().t, 1.0);
      this->find_coordinates(minimal);
      this->find_speeds(minimal);
      minimal.restore(after);
      std::copy(after.reference.begin(), after.reference.end(), reference_.begin());
      end_row(first, number);
    }
    minimal.restore(after);
    return {};
  }

  /// How many steps an integrator has made that was asked for as many; of one that divides some, the parts beyond.
  long parts_taken(const Steps& steps) const {
    if constexpr (is_explicit) return steps.iterations();
    else if constexpr (requires { steps.newton(); }) return parts_ + 1 + steps.newton().substeps();
    else return parts_ + 1;
  }

  static Fault follow_part(void* who, const StateOf<M>& from, double h) {
    StepDerivatives* const self = static_cast<StepDerivatives*>(who);
    if (self->parts_taken(self->simulation_->steps()) != ++self->parts_) return {.cause = Cause::step_divided, .t = from.t};
    return self->follow(from, self->simulation_->state(), h);
  }

  static Fault follow_sample(void* self, std::size_t first, std::size_t number) { return static_cast<StepDerivatives*>(self)->sample(first, number); }

  /// A controller comes to hold the values of a sample, which change as the present state does.
  Fault sample([[maybe_unused]] std::size_t at, [[maybe_unused]] std::size_t held) {
    if constexpr (M::sizes.held > 0) {
      if (const Fault fault = this->begin(*simulation_, *minimal_)) return fault;
      Fixed<Dual, M::sizes.held> next;
      for (std::size_t first = 0; first < blocks_[0].width; first += directions) {
        const std::size_t number = std::min(directions, blocks_[0].width - first);
        begin_row(first, number);
        if (!this->derive_motion(simulation_->mechanism(), *minimal_, number)) return this->not_finite();
        if constexpr (Base::has_system) {
          this->system_.begin_step(this->state_->t, 1.0);
          this->system_.sample(q_.data(), v_.data(), vdot_.data(), lambda_.data(), next.data());
        } else {
          mechanism_.sample(q_.data(), v_.data(), vdot_.data(), lambda_.data(), next.data());
        }
        for (std::size_t i = at; i < at + held; ++i)
          for (std::size_t k = 0; k < number; ++k) blocks_[0].matrix[(states + i) * blocks_[0].width + first + k] = next[i].slope[k];
      }
    }
    return {};
  }

  /// An adaptive method has made one of its steps.
  template <class Scheme>
  static void follow_length(void* who, Scheme& scheme) {
    StepDerivatives* const self = static_cast<StepDerivatives*>(who);
    if (self->followed_) return;
    StateOf<M> end = self->last_;
    std::copy_n(scheme.pose(), end.q.size(), end.q.begin());
    std::copy_n(scheme.pose() + end.q.size(), n, end.v.begin());
    end.t = scheme.time();
    self->followed_ = self->follow(self->last_, end, end.t - self->last_.t);
    self->last_ = end;
  }

  /// A part of the step has been made from a state to another: what its beginning changes by becomes what its end does.
  Fault follow(const StateOf<M>& from, const StateOf<M>& end, double h) {
    Simulation& simulation = *simulation_;
    Starter<M>& starter = simulation.starter();
    M& mechanism = simulation.mechanism();
    this->load(simulation, *minimal_);
    const std::size_t columns = count_columns();
    const Fault no_end{.cause = Cause::accelerations_not_finite, .t = end.t};
    if (columns > 0 && !this->find_part(mechanism, from, end, h)) return no_end;
    for (std::size_t first = 0; first < columns; first += directions) {
      const std::size_t number = std::min(directions, columns - first);
      mechanism.begin_step(from.t, 1.0);
      begin_row(first, number);
      if (!this->enter(mechanism, from)) return this->not_finite();
      if (const Fault fault = minimal_->decompose(starter, from)) return fault;
      if (!this->derive_motion(mechanism, *minimal_, number)) return this->not_finite();
      if (!this->go(mechanism, from, h, number)) return no_end;
      if (!this->close_end(simulation)) return {.cause = Cause::pose_singular, .t = end.t};
      end_row(first, number);
    }
    mechanism.begin_step(end.t, 1.0);
    return {};
  }

  /// Visit columns of the matrices as if they stood side by side: the direction, the matrix, and the column in it.
  template <class Visit>
  void visit(std::size_t first, std::size_t number, Visit use) {
    for (std::size_t k = 0; k < number; ++k) {
      std::size_t column = first + k, which = 0;
      while (!blocks_[which].matrix || column >= blocks_[which].width) {
        if (blocks_[which].matrix) column -= blocks_[which].width;
        ++which;
      }
      use(k, blocks_[which], column);
    }
  }

  /// What changes along columns where a part begins.
  void begin_row(std::size_t first, std::size_t number) {
    dx_.fill(Dual());
    du_.fill(Dual());
    for (Dual& x : parameters_) x.slope = Slopes{};
    this->dheld_.fill(Dual());
    visit(first, number, [this](std::size_t k, const Block& block, std::size_t column) {
      for (std::size_t i = 0; i < states; ++i) dx_[i].slope[k] = block.matrix[i * block.width + column];
      for (std::size_t i = 0; i < block.held; ++i) this->dheld_[i].slope[k] = block.matrix[(states + i) * block.width + column];
      const int by = block.at(column), parameter = by - static_cast<int>(inputs);
      if (parameter >= 0) parameters_[static_cast<std::size_t>(parameter)].slope[k] = 1.0;
      else if (by >= 0) du_[numbers_per_input * static_cast<std::size_t>(by)].slope[k] = 1.0;
    });
    this->load_parameters(*simulation_);
  }

  /// Independent coordinates and rates at the end.
  void end_row(std::size_t first, std::size_t number) {
    displacement<Dual>(charts(), reference_.data(), q_.data(), delta_.data());
    chart_rates<Dual>(charts(), delta_.data(), v_.data(), rate_.data());
    this->take_slopes(delta_, *minimal_, dx_.data());
    this->take_slopes(rate_, *minimal_, dx_.data() + freedoms);
    std::copy(v_.begin() + joints, v_.end(), dx_.begin() + 2 * freedoms);
    visit(first, number, [this](std::size_t k, const Block& block, std::size_t column) {
      for (std::size_t i = 0; i < states; ++i) block.matrix[i * block.width + column] = dx_[i].slope[k];
    });
  }

  Simulation* simulation_ = nullptr;
  Minimal* minimal_ = nullptr;
  std::array<Block, 3> blocks_{};
  long parts_ = 0;  ///< as they are counted by the integrator
  StateOf<M> last_{M::sizes.coordinates, n, Base::m};  ///< of an adaptive method, where its last step ended
  Fault followed_;                                     ///< why one of its steps has no derivative
};

}  // namespace cutjoint
