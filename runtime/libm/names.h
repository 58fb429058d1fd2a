/* The functions of this library under names of their own, so that no other library's are linked: included before all else. */
#ifndef CUTJOINT_LIBM_NAMES_H
#define CUTJOINT_LIBM_NAMES_H

#ifdef __cplusplus
#if __has_include(<features.h>) /* newlib has none */
#include <features.h>
#endif
#endif

#if defined(__cplusplus) && defined(__GLIBC__)
#define CUTJOINT_THROWS_NOTHING noexcept
#else
#define CUTJOINT_THROWS_NOTHING
#endif
#ifdef __cplusplus
extern "C" {
#else
#define hidden __attribute__((visibility("hidden"))) /* of its own sources */
#endif
#define CUTJOINT_OF_ONE(name) double name(double) CUTJOINT_THROWS_NOTHING __asm__("cutjoint_" #name);
#define CUTJOINT_OF_TWO(name) double name(double, double) CUTJOINT_THROWS_NOTHING __asm__("cutjoint_" #name);
CUTJOINT_OF_ONE(sin)
CUTJOINT_OF_ONE(cos)
CUTJOINT_OF_ONE(tan)
CUTJOINT_OF_ONE(asin)
CUTJOINT_OF_ONE(acos)
CUTJOINT_OF_ONE(atan)
CUTJOINT_OF_ONE(sinh)
CUTJOINT_OF_ONE(cosh)
CUTJOINT_OF_ONE(tanh)
CUTJOINT_OF_ONE(exp)
CUTJOINT_OF_ONE(expm1)
CUTJOINT_OF_ONE(log)
CUTJOINT_OF_ONE(log10)
CUTJOINT_OF_TWO(atan2)
CUTJOINT_OF_TWO(pow)
#undef CUTJOINT_OF_ONE
#undef CUTJOINT_OF_TWO
#ifdef __cplusplus
}
#endif

#endif
