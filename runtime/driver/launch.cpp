// Where runs begin, in double for all methods and number types.
#include "cutjoint/launch.hpp"

template class cutjoint::Launch<cutjoint::AnyMechanism<double>>;
