#include "libm.h"

double cutjoint_k_math_oflow(uint32_t sign)
{
	return cutjoint_k_math_xflow(sign, 0x1p769);
}
