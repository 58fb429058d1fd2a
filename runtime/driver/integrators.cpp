// The integrators of the recursive method, which are compiled with the flags of generated code: a source of their own, since they do without
// Eigen, whose alignment follows the flags.
#define CUTJOINT_INSTANTIATE template
#include "integrators.hpp"
