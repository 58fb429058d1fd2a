// Scalar products and sizes of vectors.
#pragma once

#include <cmath>
#include <cstddef>
#include <span>
#include <type_traits>

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

/// The larger of two numbers; NaN if one is NaN.
template <class Real>
Real larger(Real a, Real b) { return b > a || b != b ? b : a; }

/// The largest absolute value; NaN if one is NaN.
template <class Real>
Real largest(std::span<const Real> values) {
  using std::abs;
  Real result(0);
  for (const Real value : values)
    if (const Real size = abs(value); size > result || size != size) result = size;
  return result;
}

/// The largest by registers: a step needs it more than ten times.  It is inlined, and so compiled with the caller's flags.
[[gnu::always_inline]] inline double largest(std::span<const double> values) {
  typedef double Four __attribute__((vector_size(32)));
  typedef double Loose __attribute__((vector_size(32), aligned(8), may_alias));
  Four most{}, least{}, odd{};
  const double* at = values.data();
  for (std::size_t fours = values.size() / 4; fours > 0; --fours, at += 4) {
    const Four x = *reinterpret_cast<const Loose*>(at);
    most = x > most ? x : most;
    least = x < least ? x : least;
    odd += x - x;  // zero unless one is no finite number
  }
  double result = 0, rest = (odd[0] + odd[1]) + (odd[2] + odd[3]);
  for (std::size_t j = 0; j < 4; ++j) {
    result = most[j] > result ? most[j] : result;
    result = -least[j] > result ? -least[j] : result;
  }
  for (std::size_t left = values.size() % 4; left > 0; --left, ++at) {
    const double size = std::abs(*at);
    result = size > result ? size : result;
    rest += size - size;
  }
  return rest == 0 ? result : largest<double>(values);
}

template <class Numbers>
  requires requires(const Numbers& values) { values.data(); }
[[gnu::always_inline]] inline auto largest(const Numbers& values) {
  return largest(std::span<const typename Numbers::value_type>(values.data(), values.size()));
}

/// The index of the largest of some sizes, or of one that is NaN; 0 if there are none.
std::size_t index_of_largest(std::size_t length, auto size) {
  std::size_t index = 0;
  for (std::size_t i = 1; i < length; ++i)
    if (size(i) > size(index) || size(i) != size(i)) index = i;
  return index;
}

/// That of the largest absolute value among the first ones.
std::size_t index_of_largest(const auto& values, std::size_t length) {
  using std::abs;
  return index_of_largest(length, [&](std::size_t i) { return abs(values[i]); });
}

/// The size of value i of so many, the last of which have `sizes`; 1 for the others.
inline double size_at(std::span<const double> sizes, std::size_t i, std::size_t length) {
  return length - i <= sizes.size() ? sizes[sizes.size() - (length - i)] : 1.0;
}

/// The same with the last values relative to `sizes`.
template <class Numbers>
auto largest(const Numbers& values, std::span<const double> sizes) {
  using Real = std::remove_cvref_t<decltype(values[0])>;
  const std::size_t first = values.size() - sizes.size();
  Real result = largest(std::span<const Real>(values.data(), first));
  for (std::size_t i = 0; i < sizes.size(); ++i) {
    const Real both[2] = {result, values[first + i] / Real(sizes[i])};
    result = largest(std::span<const Real>(both, 2));
  }
  return result;
}

}  // namespace cutjoint
