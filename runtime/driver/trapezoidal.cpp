// The trapezoidal rule of the recursive method, which is compiled with the flags of generated code: a source of its own, since it does without
// Eigen, whose alignment follows the flags.
#include "cutjoint/precision.hpp"
#include "cutjoint/core/trapezoidal.hpp"

#include "cutjoint/mechanism.hpp"

template class cutjoint::Trapezoidal<cutjoint::AnyMechanism<cutjoint::Precision>>;
