// The beginning of runs, in double for all methods and number types.
#include "cutjoint/initial_state.hpp"

template class cutjoint::InitialState<cutjoint::AnyMechanism<double>>;
