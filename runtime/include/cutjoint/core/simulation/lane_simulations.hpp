// Simulations of one model stepped together in SIMD lanes.
#pragma once

#include <cstdint>
#include <new>

#include "cutjoint/core/stepping/lane_steps.hpp"
#include "cutjoint/core/simulation/simulation.hpp"

namespace cutjoint {

/// A base with a mechanism, constructed before the integrator.
template <Sized M>
struct LaneMechanism {
  M mechanism;
};

/// The inputs of a simulation in a lane; the host does not change them during a call.
template <class Smoothed>
class SmoothedLaneInputs {
 public:
  void begin(const typename Smoothed::Inputs& given, const Smoothed& smoothed, double dt) {
    given_ = given;
    smoothed_ = smoothed;
    dt_ = dt;
  }

  /// The state at the beginning of a step, also for a repeated step.
  const Smoothed& smoothed() const { return smoothed_; }

  /// The source of these.
  InputSource<double> source() {
    InputSource<double> source = smoothed_.used().source();
    if (Smoothed::any && source.fill) source = {&fill, this, &begin_step};
    return source;
  }

 private:
  static void fill(void* host, double t, double* input) { Smoothed::Inputs::fill(&static_cast<SmoothedLaneInputs*>(host)->smoothed_.used(), t, input); }

  static StepBegin begin_step(void* host, double t, double until) {
    SmoothedLaneInputs& own = *static_cast<SmoothedLaneInputs*>(host);
    const auto no_scene = [](std::size_t, double, double*) {};  // not needed by guides that follow the host
    const bool jumps = own.smoothed_.begin_call(own.given_, t, until, own.dt_, no_scene);
    return {jumps, own.smoothed_.is_catching_up(), own.smoothed_.next_end() < until - 1e-9 * own.dt_};
  }

  typename Smoothed::Inputs given_;
  Smoothed smoothed_;
  double dt_ = 0.0;
};

/// Simulations by the trapezoidal rule in the lanes of M, their mechanism with lanes of reals.  They start one by one
/// as `Sim` and are taken over.  If a host may move guides, a simulation whose step fails, or is divided by a guide's trajectory, leaves its
/// lane until the end of the call and continues alone, as after a jump too large for steps.  Then it returns to its lane,
/// or has the fault of a single simulation.
template <class Sim, Sized M>
class LaneSimulations : private LaneMechanism<M>, public LaneSteps<M> {
 public:
  using LaneSteps<M>::width;

  LaneSimulations() : LaneSteps<M>(this->mechanism) {}

  /// The bytes of memory, of any alignment, for these and single simulations of the given size.
  static constexpr std::size_t bytes(std::size_t each) { return alignof(LaneSimulations) + sizeof(LaneSimulations) + width * each; }

  /// Create them in such memory; `alone` is the beginning of that for single simulations.
  static LaneSimulations* make(void* memory, char*& alone) {
    const std::size_t past = reinterpret_cast<std::uintptr_t>(memory) % alignof(LaneSimulations);
    char* place = static_cast<char*>(memory) + alignof(LaneSimulations) - past;
    alone = place + sizeof(LaneSimulations);
    return ::new (place) LaneSimulations();
  }

  /// Let a simulation use the instances to find its start, before their steps.
  void lend_to(Sim& sim) { sim.mechanism().lend(*this); }

  void step() {
    call([this] { LaneSteps<M>::step(); }, [](Sim& alone) { return alone.step(); });
  }

  void advance(double until) {
    call([this, until] { LaneSteps<M>::advance(until); }, [until](Sim& alone) { return alone.advance(until); });
  }

  /// Continue from `settled` simulations with the same settings; lanes without one are idle.
  void take_over(const std::array<Sim*, width>& sims) {
    this->clear();
    sims_ = sims;
    const Sim* first = nullptr;
    for (std::size_t k = 0; k < sims.size(); ++k) {
      if (!sims[k]) continue;
      const auto memory = sims[k]->memory();
      inputs_[k].begin(memory.inputs, memory.smoothed, memory.settings.dt);
      this->put(static_cast<int>(k), start_from(k, memory));
      this->expect(static_cast<int>(k), memory.integrator.expected);
      if (!first) first = sims[k];
    }
    if (first) this->begin(first->memory().settings, first->watches_violations() ? first->violation_limits() : nullptr);
  }

 private:
  using Memory = typename Sim::Memory;

  LaneStart<decltype(Memory::state)> start_from(std::size_t k, const Memory& memory) {
    return {.state = memory.state, .parameters = memory.parameters.data(), .penalties = memory.penalties.data(), .roads = sims_[k]->roads(),
            .inputs = inputs_[k].source(), .origin = memory.origin, .number = memory.number, .steps_to_measurement = memory.steps_to_measurement};
  }

  /// A call for all lanes; those that stop continue alone.
  void call(auto together, auto alone) {
    const auto running = this->running();
    together();
    if constexpr (Sim::Smoothed::any)
      for (int k = 0; k < width; ++k)
        if (running[k] && !this->is_running(k) && !has_made_step(this->fault(k))) step_alone(k, alone);
  }

  void step_alone(int k, auto go_on) {
    const auto place = static_cast<std::size_t>(k);
    Sim& alone = *sims_[place];
    Memory memory = alone.memory();
    this->leave(k, memory);
    memory.smoothed = inputs_[place].smoothed();
    alone.restore(memory);
    const Fault fault = go_on(alone);
    memory = alone.memory();
    inputs_[place].begin(memory.inputs, memory.smoothed, memory.settings.dt);
    this->resume(k, start_from(place, memory), fault);
    this->expect(k, memory.integrator.expected);
  }

  std::array<Sim*, width> sims_{};
  std::array<SmoothedLaneInputs<typename Sim::Smoothed>, width> inputs_;
};

}  // namespace cutjoint
