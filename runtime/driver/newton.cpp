// The integrators of the methods with Newton's iteration, which are compiled with the flags of generated code: a source of their own,
// since they do without Eigen, whose alignment follows the flags.
#define CUTJOINT_INSTANTIATE template
#include "newton.hpp"
