// The number type that a simulator is built for: double, unless its build says otherwise.
#pragma once

#ifndef CUTJOINT_REAL
#define CUTJOINT_REAL double
#endif

namespace cutjoint {

using Precision = CUTJOINT_REAL;

}  // namespace cutjoint
