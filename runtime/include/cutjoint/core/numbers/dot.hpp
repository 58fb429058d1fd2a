// The scalar product.
#pragma once

#include <cstddef>
#include <span>

namespace cutjoint {

/// The sum of the products.
template <class Real>
Real dot(std::span<const Real> a, std::span<const Real> b) {
  Real result(0);
  for (std::size_t i = 0; i < a.size(); ++i) result += a[i] * b[i];
  return result;
}

typedef double FourProducts __attribute__((vector_size(32)));

/// Prevent contraction of products and sums (FMA), which would depend on what the compiler knows of the length and on the target
/// processor.
[[gnu::always_inline]] inline void seal([[maybe_unused]] FourProducts& products) {
#if defined(__FMA__)
  asm("" : "+x"(products));
#elif !defined(__x86_64__)
  asm("" : "+m"(products));
#endif
}

/// The sum by registers, in an order independent of what the compiler knows of the length.
[[gnu::always_inline]] inline double dot(std::span<const double> a, std::span<const double> b) {
  typedef double Loose __attribute__((vector_size(32), aligned(8), may_alias));
  FourProducts sum{}, last_a{}, last_b{};
  const std::size_t left = a.size() % 4, whole = a.size() - left;
  for (std::size_t i = 0; i < whole; i += 4) {
    FourProducts next = *reinterpret_cast<const Loose*>(a.data() + i) * *reinterpret_cast<const Loose*>(b.data() + i);
    seal(next);
    sum += next;
  }
  for (std::size_t j = 0; j < left; ++j) last_a[j] = a[whole + j], last_b[j] = b[whole + j];
  last_a *= last_b;
  seal(last_a);
  sum += last_a;
  return (sum[0] + sum[1]) + (sum[2] + sum[3]);
}

}  // namespace cutjoint
