// Reference sizes of coordinates and velocities, beside which violations and changes are rounding.
#pragma once

#include <cmath>
#include <cstddef>
#include <span>
#include <type_traits>
#include <utility>

#include "cutjoint/core/mechanism/chart.hpp"
#include "cutjoint/core/numbers/largest.hpp"

namespace cutjoint {

/// That of violations of a pose (m): 1 + the largest coordinate for a mechanism of about a metre.
/// Otherwise lengths are relative to its arm, angles are multiplied by it, and times are relative to that of falling an arm's length at 1 m/s2.
/// `nominals` are those of rates (mechanism.hpp).
template <class Numbers, class Real = std::remove_cvref_t<decltype(std::declval<const Numbers&>()[0])>>
Real pose_size(const Numbers& q, double arm, std::span<const Chart> charts, std::span<const double> nominals) {
  using std::abs;
  if (arm == 1.0) return Real(1) + largest(q);
  if (charts.empty()) return Real(arm) + largest(q, nominals.first(q.size()));
  Real size(0);
  for (const Chart& chart : charts)
    for (std::size_t i = 0; i < static_cast<std::size_t>(chart.scalars); ++i)
      size = larger(size, abs(q[static_cast<std::size_t>(chart.q) + i]) / Real(nominals[static_cast<std::size_t>(chart.v) + i]));
  return Real(arm) + size;
}

/// That of violations of velocities (m/s).
template <class Numbers>
auto speed_size(const Numbers& v, double arm, std::span<const double> nominals) {
  auto size = largest(v, nominals);
  return decltype(size)(std::sqrt(arm)) + size;
}

/// That of accelerations (m/s2).
template <class Numbers>
auto acceleration_size(const Numbers& vdot, std::span<const double> nominals) {
  auto size = largest(vdot, nominals);
  return decltype(size)(1) + size;
}

}  // namespace cutjoint
