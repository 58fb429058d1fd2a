// The coefficients of Runge-Kutta methods: fractions, exact in any precision, or decimals of thirty digits.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace cutjoint {

struct Fraction {
  std::int64_t above, below = 1;  ///< long has 32 bits on Windows and on small processors

  template <class Real>
  Real as() const { return Real(above) / Real(below); }

  constexpr bool is_zero() const { return above == 0; }
};

template <std::size_t stages>
using Coefficients = std::array<Fraction, stages>;

/// A number that is no fraction: the nearest double, and what that leaves of it for number types with more digits.
struct Decimal {
  double nearest = 0, rest = 0;

  template <class Real>
  constexpr Real as() const {
    return Real(nearest) + Real(rest);
  }

  constexpr bool is_zero() const { return nearest == 0; }
};

template <std::size_t stages>
using Decimals = std::array<Decimal, stages>;

/// sum += h times the weighted derivatives.
template <class Real, class Weight, std::size_t stages, class Tangents, class Numbers>
void add_derivatives(Real h, const std::array<Weight, stages>& weights, const Tangents& derivatives, Numbers& sum) {
  for (std::size_t j = 0; j < stages && j < derivatives.size(); ++j) {
    if (weights[j].is_zero()) continue;
    const Real weight = h * weights[j].template as<Real>();
    for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += weight * derivatives[j][i];
  }
}

/// Its transpose: what is by the sum, added to what is by the derivatives.
template <class Weight, std::size_t stages, class Numbers, class Tangents>
void add_derivatives_vjp(double h, const std::array<Weight, stages>& weights, const Numbers& by_sum, Tangents& by_derivatives) {
  for (std::size_t j = 0; j < stages && j < by_derivatives.size(); ++j) {
    if (weights[j].is_zero()) continue;
    const double weight = h * weights[j].template as<double>();
    for (std::size_t i = 0; i < by_sum.size(); ++i) by_derivatives[j][i] += weight * by_sum[i];
  }
}

}  // namespace cutjoint
