// The coefficients of Runge-Kutta methods as fractions: exact in any precision.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace cutjoint {

struct Fraction {
  std::int64_t above, below = 1;  ///< long has 32 bits on Windows and on small processors

  template <class Real>
  Real as() const {
    return Real(above) / Real(below);
  }
};

template <std::size_t stages>
using Coefficients = std::array<Fraction, stages>;

/// sum += h times the weighted slopes.
template <class Real, std::size_t stages, class Slopes, class Numbers>
void add_slopes(Real h, const Coefficients<stages>& weights, const Slopes& slopes, Numbers& sum) {
  for (std::size_t j = 0; j < stages; ++j) {
    if (weights[j].above == 0) continue;
    const Real weight = h * weights[j].template as<Real>();
    for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += weight * slopes[j][i];
  }
}

}  // namespace cutjoint
