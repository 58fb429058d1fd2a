// Inputs of several instances in SIMD lanes.
#pragma once

#include <array>
#include <cstddef>

#include "cutjoint/core/numbers/arrays.hpp"
#include "cutjoint/core/inputs/inputs.hpp"
#include "cutjoint/core/numbers/lanes.hpp"

namespace cutjoint {

/// A source of inputs that takes those of each instance from a source of its own.
template <class M>
class LaneInputs {
 public:
  using Real = typename M::real_type;
  static constexpr int width = Real::size;

  explicit LaneInputs(const M& instances) : numbers_(numbers_per_input * sizes_of(instances).inputs) {}

  /// Drive instances by sources, one for each.
  template <class SourceOf>
  void drive(M& instances, SourceOf source_of) {
    bool any = false;
    for (int k = 0; k < width; ++k) any |= (sources_[static_cast<std::size_t>(k)] = source_of(k)).fill != nullptr;
    instances.drive_by(any ? InputSource<Real>{&fill, this} : InputSource<Real>{});
  }

 private:
  static void fill(void* host, Real t, Real* input) {
    LaneInputs& lanes = *static_cast<LaneInputs*>(host);
    auto& numbers = lanes.numbers_;
    for (int k = 0; k < width; ++k) {
      const InputSource<double>& source = lanes.sources_[static_cast<std::size_t>(k)];
      if (!source.fill) continue;
      for (std::size_t i = 0; i < numbers.size(); ++i) numbers[i] = input[i][k];
      source.fill(source.host, t[k], numbers.data());
      for (std::size_t i = 0; i < numbers.size(); ++i) input[i].v[k] = numbers[i];
    }
  }

  std::array<InputSource<double>, width> sources_;
  Array<M, numbers_per_input * static_sizes<M>().inputs, double> numbers_;
};

}  // namespace cutjoint
