// The machine's multiply-adds of doubles per second at each vector width: as many independent ones as hide their latency.
#include <chrono>
#include <cstdio>

template <class Vector>
__attribute__((noinline)) double per_second(int lanes, long rounds) {
  constexpr int chains = 12;
  Vector sums[chains], factor = Vector{} + 0.999999, term = Vector{} + 1e-6;
  for (int i = 0; i < chains; ++i) sums[i] = Vector{} + i;
  const auto begin = std::chrono::steady_clock::now();
  for (long n = 0; n < rounds; ++n)
    for (int i = 0; i < chains; ++i) {
      sums[i] = sums[i] * factor + term;
      asm volatile("" : "+v"(sums[i]));  // in its register, and not merged with others
    }
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  return lanes * static_cast<double>(rounds) * chains / seconds;
}

typedef double Two __attribute__((vector_size(16)));
typedef double Four __attribute__((vector_size(32)));
typedef double Eight __attribute__((vector_size(64)));

template <class Vector>
void tell(int lanes) {
  double best = 0;
  for (int run = 0; run < 5; ++run) {
    const double now = per_second<Vector>(lanes, 20'000'000);
    best = now > best ? now : best;
  }
  std::printf("%s\"%d\": %.6g", lanes == 1 ? "{" : ", ", lanes, best);
}

int main() {
  tell<double>(1);
#ifdef __SSE2__
  tell<Two>(2);
#endif
#ifdef __AVX2__
  tell<Four>(4);
#endif
#ifdef __AVX512F__
  tell<Eight>(8);
#endif
  std::printf("}\n");
}
