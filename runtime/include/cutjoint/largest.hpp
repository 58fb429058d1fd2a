// The size of a vector.
#pragma once

#include <cmath>
#include <vector>

namespace cutjoint {

/// The largest absolute value; not a number where one is none.
template <class Real>
Real largest(const std::vector<Real>& values) {
  using std::abs;
  Real result(0);
  for (const Real value : values)
    if (const Real size = abs(value); size > result || size != size) result = size;
  return result;
}

}  // namespace cutjoint
