// One mechanism whose instances find the accelerations of several of its states side by side.
#pragma once

#include <array>
#include <cstddef>

#include "cutjoint/core/arrays.hpp"
#include "cutjoint/core/inputs.hpp"
#include "cutjoint/core/lane_inputs.hpp"
#include "cutjoint/core/lane_road.hpp"
#include "cutjoint/core/lane_steps.hpp"
#include "cutjoint/core/mechanism.hpp"
#include "cutjoint/core/start.hpp"
#include "cutjoint/core/state.hpp"

namespace cutjoint {

/// Instances that find accelerations of several states of a mechanism, and all memory that they need.  Others may step them between calls.
template <class M>
class Probes {
 public:
  using Real = typename M::real_type;
  static constexpr int width = Selection<Real>::number;

  explicit Probes(M& instances)
      : instances_(instances), sources_(instances), roads_(sizes_of(instances).roads), parameters_(sizes_of(instances).parameters),
        penalties_(sizes_of(instances).cuts), state_(blank(instances)), next_(sizes_of(instances).speeds), correction_(sizes_of(instances).equations) {}

  /// Load all instances as one mechanism is.
  void load(const double* parameters, const Stabilisation<double>& s, const Road<double>* roads, const InputSource<double>& source) {
    for (std::size_t i = 0; i < parameters_.size(); ++i) parameters_[i] = Real(parameters[i]);
    for (std::size_t i = 0; s.penalties && i < penalties_.size(); ++i) penalties_[i] = Real(s.penalties[i]);
    for (std::size_t i = 0; i < roads_.size(); ++i)
      for (int k = 0; k < width; ++k) roads_[i].put(k, roads[i]);
    instances_.load(parameters_.data(), {.penalty = Real(s.penalty), .damping_ratio = Real(s.damping_ratio), .frequency = Real(s.frequency),
                                         .penalties = s.penalties ? penalties_.data() : nullptr}, roads_.data());
    if constexpr (!Sized<M> || static_sizes<M>().inputs > 0) sources_.drive(instances_, [&](int) { return source; });
  }

  /// Accelerations and multipliers of states.
  template <class StateOfOne>
  void accelerate(std::array<StateOfOne, width>& states, double motion) {
    for (int k = 0; k < width; ++k) put_lane(k, states[static_cast<std::size_t>(k)], state_);
    cutjoint::accelerate(instances_, state_, Real(motion), next_, correction_);
    for (int k = 0; k < width; ++k) take_lane(k, state_, states[static_cast<std::size_t>(k)]);
  }

 private:
  static constexpr Sizes sizes = static_sizes<M>();

  M& instances_;
  LaneInputs<M> sources_;
  Array<M, sizes.roads, Road<Real>> roads_;
  Array<M, sizes.parameters> parameters_;
  Cuts<M> penalties_;
  StateOf<M> state_;
  Speeds<M> next_;
  Equations<M> correction_;
};

/// A mechanism that may have instances to find accelerations in, as a search for equilibrium takes it: most of that is accelerations of
/// neighbouring states.
template <class Alone, class Instances>
class SideBySide : public Alone {
 public:
  using Alone::Alone;

  /// How many states it accelerates at once.
  static constexpr std::size_t states_at_once = Probes<Instances>::width;

  /// Find accelerations of several states in probes, which outlive that.
  void lend(Probes<Instances>& probes) { probes_ = &probes; }

  void load(const double* parameters, const Stabilisation<double>& stabilisation, const Road<double>* roads) {
    Alone::load(parameters, stabilisation, roads);
    parameters_ = parameters;
    stabilisation_ = stabilisation;
    roads_ = roads;
  }

  void drive_by(const InputSource<double>& source)
    requires requires(Alone& alone) { alone.drive_by(source); }
  {
    Alone::drive_by(source);
    source_ = source;
  }

  /// `cutjoint::accelerate` for several states at a time.
  void accelerate(std::array<StateOf<Alone>, states_at_once>& states, double motion) {
    if (probes_) {
      probes_->load(parameters_, stabilisation_, roads_, source_);
      probes_->accelerate(states, motion);
      return;
    }
    Speeds<Alone> next(sizes_of(*this).speeds);
    Equations<Alone> correction(sizes_of(*this).equations);
    for (StateOf<Alone>& state : states) cutjoint::accelerate<Alone>(*this, state, motion, next, correction);
  }

 private:
  Probes<Instances>* probes_ = nullptr;
  const double* parameters_ = nullptr;
  Stabilisation<double> stabilisation_;
  const Road<double>* roads_ = nullptr;
  InputSource<double> source_;
};

}  // namespace cutjoint
