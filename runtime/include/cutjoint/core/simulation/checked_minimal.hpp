// Minimal coordinates of a simulation for the C interface, and derivatives.
#pragma once

#include "cutjoint/core/simulation/checked_simulation.hpp"
#include "cutjoint/core/derivatives/derivatives.hpp"

namespace cutjoint {

/// A checked simulation of a `Model` with `Derivatives`, its `dofs`, and `state_names`: coordinates, their rates, first-order states.
template <class Model>
class CheckedMinimal : public CheckedSimulation<Model> {
  struct Memory;

 public:
  using Base = CheckedSimulation<Model>;
  using Derivatives = typename Model::Derivatives;
  using Minimal = typename Derivatives::Minimal;

  Minimal minimal{};
  Derivatives derivatives{};
  typename Model::Sim::Trajectories trajectories{};  ///< of inputs in the next run

  static int start(CheckedMinimal* s) {
    if (!Base::holds_one(s)) return no_simulation;
    s->minimal.restore({});
    return Base::start(s);
  }

  static int choose_independent(CheckedMinimal* s) {
    return Base::when_started(s, [s] { return s->minimal.choose(s->sim.starter(), s->sim.state()); });
  }

  static int choose_independent_speeds(CheckedMinimal* s, const int* speeds) {
    if (const int status = Base::ask_started(s)) return status;
    if (!speeds && dofs > 0) return no_array;
    Speeds<typename Model::Sim::Mechanism, unsigned char> independent;
    for (int i = 0; i < dofs; ++i) {
      if (speeds[i] < 0 || speeds[i] >= joint_speeds || independent[static_cast<std::size_t>(speeds[i])]) return no_such_index;
      independent[static_cast<std::size_t>(speeds[i])] = 1;
    }
    return Base::status_of(s, s->minimal.choose(s->sim.starter(), s->sim.state(), independent));
  }

  static int is_ill_conditioned(CheckedMinimal* s) { return ask(s) == call_ok && s->minimal.is_ill_conditioned(s->sim.starter(), s->sim.state()); }

  static const char* state_name(const CheckedMinimal* s, int index) {
    if (!Base::holds_one(s) || !s->minimal.choice().is_made || index < 0 || index >= states) return nullptr;
    if (index >= 2 * dofs) return element_of(Model::state_names, joint_speeds + index - 2 * dofs);
    const bool is_rate = index >= dofs;
    int left = is_rate ? index - dofs : index, speed = 0;
    while (!s->minimal.choice().independent[static_cast<std::size_t>(speed)] || left-- > 0) ++speed;
    return element_of(Model::state_names, is_rate ? Model::speeds + speed : speed);
  }

  static int completed_step(CheckedMinimal* s) {
    if (const int status = Base::ask_started(s)) return status;
    s->minimal.settle(s->sim.state());
    return Base::status_of(s, s->sim.watch());
  }

  static int set_minimal_state(CheckedMinimal* s, double time, const double* numbers) {
    if (const int status = ask(s)) return status;
    if (!numbers) return no_array;
    if (!is_finite(time) || !all_finite(numbers, states)) return not_finite;
    const auto close = [s, numbers](auto& starter, auto& found) { return s->minimal.close(s->sim.mechanism(), starter, numbers, found); };
    return Base::status_of(s, s->sim.seek(time, close));
  }

  static int get_minimal_state(CheckedMinimal* s, double* numbers) {
    if (const int status = ask(s)) return status;
    if (!numbers) return no_array;
    s->minimal.read(s->sim.state(), numbers);
    return call_ok;
  }

  static int minimal_state_derivatives(CheckedMinimal* s, double* derivatives) {
    if (const int status = ask(s)) return status;
    if (!derivatives) return no_array;
    s->minimal.derive(s->sim.present_state(), derivatives);
    return call_ok;
  }

  static int linearise(CheckedMinimal* s, double* A, double* B, double* C, double* D) {
    return when_chosen(s, [=] { return s->derivatives.linearise(s->sim, s->minimal, A, B, C, D); });
  }

  static int linearise_rates(CheckedMinimal* s, double* B_rate, double* B_acceleration, double* D_rate, double* D_acceleration) {
    return when_chosen(s, [=] { return s->derivatives.linearise_rates(s->sim, s->minimal, B_rate, B_acceleration, D_rate, D_acceleration); });
  }

  static int linearise_parameters(CheckedMinimal* s, double* E, double* F) {
    return when_chosen(s, [=] { return s->derivatives.linearise_parameters(s->sim, s->minimal, E, F); });
  }

  static int directional_derivative(CheckedMinimal* s, const double* dx, const double* du, double* derivatives, double* outputs) {
    if (const int status = ask(s)) return status;
    if (states > 0 && (!dx || !derivatives)) return no_array;
    if ((Model::inputs > 0 && !du) || (Model::outputs > 0 && !outputs)) return no_array;
    if (!all_finite(dx, states) || !all_finite(du, 3 * Model::inputs)) return not_finite;
    return Base::status_of(s, s->derivatives.along(s->sim, s->minimal, dx, du, nullptr, derivatives, outputs));
  }

  static int directional_derivative_parameters(CheckedMinimal* s, const double* dp, double* derivatives, double* outputs) {
    if (const int status = ask(s)) return status;
    if ((Model::parameters > 0 && !dp) || (states > 0 && !derivatives) || (Model::outputs > 0 && !outputs)) return no_array;
    if (!all_finite(dp, Model::parameters)) return not_finite;
    return Base::status_of(s, s->derivatives.along(s->sim, s->minimal, nullptr, nullptr, dp, derivatives, outputs));
  }

  static int step_derivatives(CheckedMinimal* s, double* by_state, double* by_input, double* by_parameter) {
    return when_chosen(s, [=] { return s->derivatives.step(s->sim, s->minimal, by_state, by_input, by_parameter); });
  }

  static int forward_sensitivities(CheckedMinimal* s, long steps, int seeds, const int* by, double* matrix, int reported, const int* outputs, long every,
                             double* values, double* derivatives) {
    if (const int status = ask(s)) return status;
    if (seeds < 0 || reported < 0 || every < 1) return no_such_index;
    if ((seeds > 0 && (!by || !matrix)) || (reported > 0 && (!outputs || !values || !derivatives))) return no_array;
    for (int i = 0; i < seeds; ++i)
      if (by[i] < -1 || by[i] >= Model::inputs + Model::parameters) return no_such_index;
    for (int i = 0; i < reported; ++i)
      if (outputs[i] < 0 || outputs[i] >= Model::outputs) return no_such_index;
    if (!all_finite(matrix, Derivatives::rows * static_cast<std::size_t>(seeds))) return not_finite;
    return along_trajectories(s, [&] {
      return s->derivatives.run(s->sim, s->minimal, steps, {matrix, static_cast<std::size_t>(seeds), by},
                                 {static_cast<std::size_t>(reported), outputs, every, values, derivatives});
    });
  }

  /// `trajectories` are records of C with the members of `InputTrajectory`, of different inputs.
  template <class Record>
  static int set_input_trajectories(CheckedMinimal* s, int number, const Record* trajectories) {
    if (!Base::holds_one(s)) return no_simulation;
    s->trajectories.clear();
    if (number > 0 && !trajectories) return no_array;
    Fixed<bool, Model::inputs> taken;
    for (int i = 0; i < number; ++i) {
      const Record& x = trajectories[i];
      if (x.input < 0 || x.input >= Model::inputs || taken[static_cast<std::size_t>(x.input)] || x.pieces < 1) return no_such_index;
      if (!x.times || !x.coefficients) return no_array;
      if (!all_finite(x.times, static_cast<std::size_t>(x.pieces)) || !all_finite(x.coefficients, 4 * static_cast<std::size_t>(x.pieces))) return not_finite;
      for (long k = 1; k < x.pieces; ++k)
        if (!(x.times[k - 1] < x.times[k])) return not_finite;
      taken[static_cast<std::size_t>(x.input)] = true;
    }
    for (int i = 0; i < number; ++i) s->trajectories.add({trajectories[i].input, trajectories[i].jumps, trajectories[i].pieces, trajectories[i].times, trajectories[i].coefficients, trajectories[i].seeds, trajectories[i].derivatives});
    return call_ok;
  }

  static int record_events(CheckedMinimal* s, int most, int* found, int* events, double* times, double* derivatives_of_times, double* values, double* derivatives) {
    if (!Base::holds_one(s)) return no_simulation;
    if (most < 0) return no_such_index;
    if (!found || (most > 0 && (!events || !times || !derivatives_of_times || !values || !derivatives))) return no_array;
    s->derivatives.record_events({most, found, events, times, derivatives_of_times, values, derivatives});
    return call_ok;
  }

  static int adjoint_sensitivities(CheckedMinimal* s, long steps, int reported, const int* outputs, long every, int objectives, const double* weights, double* values,
                          double* tape, std::size_t records, double* by_state, double* by_input, double* by_parameter) {
    if (const int status = ask(s)) return status;
    if (steps < 0 || reported < 0 || objectives < 0 || every < 1) return no_such_index;
    if ((reported > 0 && (!outputs || !values)) || !tape) return no_array;
    if (objectives > 0 && ((reported > 0 && !weights) || !by_state || !by_input || !by_parameter)) return no_array;
    for (int i = 0; i < reported; ++i)
      if (outputs[i] < 0 || outputs[i] >= Model::outputs) return no_such_index;
    const std::size_t rows = static_cast<std::size_t>(steps / every) + 1;
    if (!all_finite(weights, static_cast<std::size_t>(objectives) * static_cast<std::size_t>(reported) * rows)) return not_finite;
    return along_trajectories(s, [&] {
      return s->derivatives.adjoint_sensitivities(s->sim, s->minimal, steps, {static_cast<std::size_t>(reported), outputs, every, values, nullptr},
                                         {static_cast<std::size_t>(objectives), weights, by_state, by_input, by_parameter}, {tape, records});
    });
  }

  static int event_indicators(CheckedMinimal* s, double* values) {
    if (const int status = Base::ask_started(s)) return status;
    if (!values) return no_array;
    s->sim.starter();
    cutjoint::event_indicators(s->sim.mechanism(), s->sim.state(), s->sim.roads(), values);
    return call_ok;
  }

  static std::size_t snapshot_size() { return Base::template size_with<Memory>(); }

  static int save(const CheckedMinimal* s, void* snapshot) {
    if (const int status = Base::ask_started(s)) return status;
    return snapshot ? Base::template write<Memory>([s] { return Memory{s->sim.memory(), s->minimal.choice()}; }, snapshot) : no_array;
  }

  static int restore(CheckedMinimal* s, const void* snapshot, std::size_t bytes) {
    if (!Base::holds_one(s)) return no_simulation;
    if (bytes != snapshot_size()) return no_array;
    return Base::template read<Memory>(snapshot, [s](const Memory& memory) {
      s->sim.restore(memory.sim);
      s->minimal.restore(memory.choice);
    });
  }

 protected:
  static constexpr int dofs = Model::dofs, joint_speeds = Model::joint_speeds, all_speeds = Model::speeds,
                       states = 2 * dofs + all_speeds - joint_speeds;

  /// The status of calls that need independent coordinates; chooses them if needed.
  static int ask(CheckedMinimal* s) {
    if (const int status = Base::ask_started(s)) return status;
    return s->minimal.choice().is_made ? static_cast<int>(call_ok) : choose_independent(s);
  }

  static int when_chosen(CheckedMinimal* s, auto call) {
    const int status = ask(s);
    return status ? status : Base::status_of(s, call());
  }

 private:
  /// A run with the given input trajectories: guides start at their values, with independent coordinates and rates unchanged; afterwards inputs are restored.
  static int along_trajectories(CheckedMinimal* s, auto run) {
    if (s->trajectories.number() == 0) return Base::status_of(s, run());
    double numbers[states + 1];
    s->minimal.read(s->sim.state(), numbers);
    Fault fault = s->sim.set_input_trajectories(&s->trajectories);
    const auto close = [s, &numbers](auto& starter, auto& found) { return s->minimal.close(s->sim.mechanism(), starter, numbers, found); };
    if (!fault && s->trajectories.any_of([](std::size_t input) { return Model::Sim::Smoothed::is_guiding(input); })) fault = s->sim.seek(s->sim.state().t, close);
    if (!fault) fault = run();
    const Fault behind = s->sim.set_input_trajectories(nullptr);
    s->trajectories.clear();
    return Base::status_of(s, fault ? fault : behind);
  }

  struct Memory {
    typename Model::Sim::Memory sim;
    typename Minimal::Choice choice;
  };
};

}  // namespace cutjoint
