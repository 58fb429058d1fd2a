// The number type of a batch: one number of each of several instances of a mechanism, side by side.
#pragma once

#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC diagnostic ignored "-Wpsabi"  // all parts of a batch have the same flags, so they agree on how registers are passed
#pragma GCC diagnostic ignored "-Wuninitialized"  // GCC 12 finds such variables in its own AVX-512 header (GCC bug 105593)
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"
#endif

#include "cutjoint/core/mechanism/instances.hpp"

namespace cutjoint::batch {

/// The number of instances side by side.
inline constexpr int width = doubles_of_register;

using Real = Lanes<double, width>;

/// A condition for each instance.
using Mask = Real::Mask;

inline bool any(Mask mask) { return Selection<Real>::any(mask); }

}  // namespace cutjoint::batch
