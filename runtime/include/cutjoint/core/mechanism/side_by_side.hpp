// A mechanism whose SIMD instances find accelerations of several states at once.
#pragma once

#include <array>
#include <cstddef>

#include "cutjoint/core/numbers/arrays.hpp"
#include "cutjoint/core/inputs/inputs.hpp"
#include "cutjoint/core/stepping/lane_steps.hpp"
#include "cutjoint/core/mechanism/mechanism.hpp"
#include "cutjoint/core/start/start.hpp"
#include "cutjoint/core/mechanism/state.hpp"

namespace cutjoint {

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

  void drive_by(const InputSource<double>& source)
    requires requires(Alone& alone) { alone.drive_by(source); }
  {
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
