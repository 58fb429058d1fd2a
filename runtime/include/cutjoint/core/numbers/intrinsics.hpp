// Vector registers of doubles and their square roots where glibc's vector mathematics takes them: without <immintrin.h>, which takes a
// compiler as long as all other headers of generated code.
#pragma once

#include <cmath>

#if defined(__x86_64__) && defined(__GLIBC__)
typedef double cutjoint_register2 __attribute__((vector_size(16)));
typedef double cutjoint_register4 __attribute__((vector_size(32)));
typedef double cutjoint_register8 __attribute__((vector_size(64)));
#if __has_builtin(__builtin_elementwise_sqrt)
#define CUTJOINT_SQRT2(x) __builtin_elementwise_sqrt(x)
#define CUTJOINT_SQRT4(x) __builtin_elementwise_sqrt(x)
#define CUTJOINT_SQRT8(x) __builtin_elementwise_sqrt(x)
#else
#define CUTJOINT_SQRT2(x) __builtin_ia32_sqrtpd(x)
#define CUTJOINT_SQRT4(x) __builtin_ia32_sqrtpd256(x)
#ifdef __clang__
#define CUTJOINT_SQRT8(x) __builtin_ia32_sqrtpd512(x, 4)  // rounded as the processor is set to
#else
#define CUTJOINT_SQRT8(x) __builtin_ia32_sqrtpd512_mask(x, x, static_cast<unsigned char>(-1), 4)
#endif
#endif
#endif

namespace cutjoint {

/// Doubles per vector register, the number of instances in lanes.  Compilers spill wider vectors to memory.
#if defined(__AVX512F__)
inline constexpr int doubles_of_register = 8;
#elif defined(__AVX__)
inline constexpr int doubles_of_register = 4;
#else
inline constexpr int doubles_of_register = 2;
#endif

}  // namespace cutjoint
