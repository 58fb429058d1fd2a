// Simulations of one model that take their steps together, each in a lane of its own.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <new>

#include "cutjoint/core/arrays.hpp"
#include "cutjoint/core/fault.hpp"
#include "cutjoint/core/instances.hpp"
#include "cutjoint/core/lane_inputs.hpp"
#include "cutjoint/core/lane_road.hpp"
#include "cutjoint/core/mechanism.hpp"
#include "cutjoint/core/simulation.hpp"
#include "cutjoint/core/stabilisation.hpp"
#include "cutjoint/core/state.hpp"
#include "cutjoint/core/trapezoidal.hpp"

namespace cutjoint {

/// Simulations by the trapezoidal rule, side by side in M, their mechanism with reals that are numbers of several.
///
/// They start one by one, as `Sim`, and are taken over; from there they go as `Sim` would, up to rounding.  What the other lanes have
/// changes no bit of one, nor does the lane that it is in.  One that fails stops, and the others go on.
template <class Sim, Sized M>
class LaneSimulations {
 public:
  using Real = typename M::real_type;
  using Instances = Selection<Real>;
  using Mask = typename Instances::Mask;
  static constexpr int width = Instances::number;

  LaneSimulations() : state_(blank(mechanism_)), sources_(mechanism_), steps_(mechanism_, Real(1), FixedPoint{}) {}

  /// How many bytes some take in memory that begins anywhere, with so many for each simulation alone.
  static constexpr std::size_t bytes(std::size_t each) { return alignof(LaneSimulations) + sizeof(LaneSimulations) + width * each; }

  /// Some in such memory; `alone` is where that of the single ones begins.
  static LaneSimulations* make(void* memory, char*& alone) {
    const std::size_t past = reinterpret_cast<std::uintptr_t>(memory) % alignof(LaneSimulations);
    char* place = static_cast<char*>(memory) + alignof(LaneSimulations) - past;
    alone = place + sizeof(LaneSimulations);
    return ::new (place) LaneSimulations();
  }

  LaneSimulations(const LaneSimulations&) = delete;
  LaneSimulations& operator=(const LaneSimulations&) = delete;

  /// Go on from `settled` simulations with the same settings; where there is none its lane stands still.
  void take_over(const std::array<Sim*, width>& sims) {
    going_ = Instances::all_if(false);
    Sim* first = nullptr;
    for (int k = 0; k < width; ++k) {
      if (!at(sims, k)) continue;
      going_[k] = -1;
      if (!first) first = at(sims, k);
    }
    if (!first) return;
    settings_ = first->settings();
    for (int k = 0; k < width; ++k) put(k, at(sims, k) ? *at(sims, k) : *first);
    load_mechanism(mechanism_, parameters_.data(), roads_.data(), settings_.stabilisation, penalties_);
    if constexpr (M::sizes.inputs > 0) sources_.drive(mechanism_, [this](int k) { return at(inputs_, k).source(); });
    mechanism_.begin_step(state_.t, Real(1));
    steps_.set_fixed_point(settings_.fixed_point);
  }

  bool any_goes() const { return Instances::any(going_); }
  bool goes(int k) const { return Instances::has(going_, k); }
  Mask going() const { return going_; }

  /// Why the one in a lane stopped, and when, s.
  const Fault& fault(int k) const { return at(faults_, k); }
  double time(int k) const { return state_.t[k]; }

  /// A step of the settings' length.
  void step() {
    integrate(Real(settings_.dt), origin_ + (number_ + Real(1)) * Real(settings_.dt));
    number_ = number_ + Real(1);
  }

  /// Steps of all, which have the same time, to another, the last one shorter where they do not end there.
  void advance(double until) {
    const double rounding = 1e-9 * settings_.dt;
    while (any_goes()) {
      const double left = until - present();
      if (!(left > rounding)) return;
      if (left + rounding >= settings_.dt) {
        step();
        continue;
      }
      integrate(Real(left), Real(until));
      origin_ = state_.t;
      number_ = Real(0);
    }
  }

  /// Find the columns of all at the present states.
  void report() { mechanism_.report(state_.q.data(), state_.v.data(), state_.vdot.data(), state_.lambda.data(), columns_.data()); }

  /// Those of one.
  void columns(int k, double* columns) const {
    for (std::size_t i = 0; i < columns_.size(); ++i) columns[i] = columns_[i][k];
  }

 private:
  static constexpr Sizes sizes = M::sizes;

  template <class Items>
  static auto& at(Items& items, int k) {
    return items[static_cast<std::size_t>(k)];
  }

  template <class Values, class Numbers>
  static void put(int k, const Values& values, Numbers& numbers) {
    for (std::size_t i = 0; i < numbers.size(); ++i) numbers[i].v[k] = values[i];
  }

  void put(int k, Sim& sim) {
    const typename Sim::Memory memory = sim.memory();
    state_.t.v[k] = memory.state.t;
    put(k, memory.state.q, state_.q), put(k, memory.state.v, state_.v), put(k, memory.state.vdot, state_.vdot), put(k, memory.state.lambda, state_.lambda);
    put(k, memory.parameters, parameters_), put(k, memory.penalties, penalties_);
    at(inputs_, k) = memory.used;
    origin_.v[k] = memory.origin;
    number_.v[k] = static_cast<double>(memory.number);
    for (std::size_t i = 0; i < sizes.roads; ++i) roads_[i].put(k, sim.roads()[i]);
  }

  /// The time of those that go.
  double present() const {
    for (int k = 0; k < width; ++k)
      if (goes(k)) return state_.t[k];
    return 0.0;
  }

  void integrate(Real h, Real until) {
    steps_.set_step(h);
    const Mask failed = steps_.step_of(state_, going_);
    for (int k = 0; k < width; ++k)
      if (Instances::has(failed, k)) stop(k, steps_.fault(k, static_cast<long>(number_[k]) + 1));
    watch();
    state_.t = where(going_, until, state_.t);
  }

  void stop(int k, const Fault& fault) {
    going_[k] = 0;
    at(faults_, k) = fault;
  }

  /// Stop those in which a force that was left out would act.
  void watch() {
    if constexpr (sizes.guards > 0) {
      Fixed<Real, sizes.guards> margins;
      mechanism_.guard(state_.q.data(), state_.v.data(), margins.data());
      for (std::size_t i = 0; i < sizes.guards; ++i)
        for (int k = 0; k < width; ++k)
          if (goes(k) && !(margins[i][k] >= 0.0))
            stop(k, {.cause = Cause::guard_violated, .list = FaultList::guards, .index = static_cast<int>(i), .t = state_.t[k],
                     .step = static_cast<long>(number_[k]) + 1, .value = -margins[i][k]});
    }
  }

  M mechanism_;
  SimulationSettings settings_{};
  Fixed<Road<Real>, sizes.roads> roads_;
  Fixed<Real, sizes.parameters> parameters_;
  Cuts<M> penalties_;
  StateOf<M> state_;
  Real origin_{0}, number_{0};  ///< of whole steps since the origin
  std::array<HostInputs<double, sizes.inputs>, width> inputs_;
  LaneInputs<M> sources_;
  Trapezoidal<M> steps_;
  Fixed<Real, sizes.columns> columns_;
  Mask going_{};
  std::array<Fault, width> faults_{};
};

}  // namespace cutjoint
