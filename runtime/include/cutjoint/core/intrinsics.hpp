// The processor's own functions, where glibc's vector mathematics takes their registers.
#pragma once

#include <cmath>

#if defined(__x86_64__) && defined(__GLIBC__)
#include <immintrin.h>
#endif
