#include "libm.h"

double cutjoint_k_math_uflow(uint32_t sign)
{
	return cutjoint_k_math_xflow(sign, 0x1p-767);
}
