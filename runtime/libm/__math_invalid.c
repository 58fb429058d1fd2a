#include "libm.h"

double cutjoint_k_math_invalid(double x)
{
	return (x - x) / (x - x);
}
