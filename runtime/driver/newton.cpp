// The integrators of the methods augmented and recursive-newton, which are compiled with the flags of generated code: a source of their own,
// since they do without Eigen, whose alignment follows the flags.
#include "cutjoint/lagrangian/recursive_newton.hpp"
#include "cutjoint/precision.hpp"

template class cutjoint::Newton<cutjoint::AnySystem<cutjoint::Precision>>;
template class cutjoint::AugmentedNewton<cutjoint::AnySystem<cutjoint::Precision>>;
template class cutjoint::RecursiveNewton<cutjoint::AnySystem<cutjoint::Precision>>;
