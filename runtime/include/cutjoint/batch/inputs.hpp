// Inputs of several instances side by side.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "cutjoint/batch/real.hpp"
#include "cutjoint/mechanism.hpp"

namespace cutjoint::batch {

/// A mechanism with several instances.
using Instances = AnyMechanism<Real>;

/// A source of inputs that takes those of each instance from a source of its own.
class LaneInputs {
 public:
  explicit LaneInputs(const Description& d) : numbers_(numbers_per_input * d.inputs.size()) {}

  /// Drive instances by sources, one for each.
  template <class SourceOf>
  void drive(Instances& instances, SourceOf source_of) {
    bool any = false;
    for (int k = 0; k < width; ++k) any |= (sources_[static_cast<std::size_t>(k)] = source_of(k)).fill != nullptr;
    instances.drive_by(any ? InputSource<Real>{&fill, this} : InputSource<Real>{});
  }

 private:
  static void fill(void* host, Real t, Real* input) {
    LaneInputs& lanes = *static_cast<LaneInputs*>(host);
    std::vector<double>& numbers = lanes.numbers_;
    for (int k = 0; k < width; ++k) {
      const InputSource<double>& source = lanes.sources_[static_cast<std::size_t>(k)];
      if (!source.fill) continue;
      for (std::size_t i = 0; i < numbers.size(); ++i) numbers[i] = input[i][k];
      source.fill(source.host, t[k], numbers.data());
      for (std::size_t i = 0; i < numbers.size(); ++i) input[i].v[k] = numbers[i];
    }
  }

  std::array<InputSource<double>, width> sources_;
  std::vector<double> numbers_;
};

}  // namespace cutjoint::batch
