// Dual numbers in SIMD lanes.
#pragma once

#include "cutjoint/core/roads/dual_road.hpp"
#include "cutjoint/core/numbers/lanes.hpp"

namespace cutjoint {

/// Dual numbers in lanes: all values, then all derivatives along the first seed, and so on.  Each operation is a
/// call, so that long functions compile in seconds.
template <int N>
struct Lanes<Dual, N> {
  using Plain = Lanes<double, N>;
  using Mask = typename Plain::Mask;
  using real_type = Dual;
  static constexpr int size = N;

  /// The same one after the other.
  struct Vector {
    Dual number[N];
    Dual& operator[](int k) { return number[k]; }
  };

  using Values = Side<std::max<std::size_t>(N, register_length)>;  ///< repeated if registers are longer
  using Derivatives = Side<seeds_at_once * N>;

  Values value;
  Derivatives derivative;

  Lanes() = default;
  Lanes(const Dual& x) : value(Values::of([&](std::size_t) { return Part{} + x.value; })), derivative(spread(x.derivative)) {}
  [[gnu::noinline]] Lanes(const Vector& vector) : Lanes([&](std::size_t k) -> const Dual& { return vector.number[k]; }, Gathered()) {}
  template <class... Numbers>
    requires(sizeof...(Numbers) == N && N > 1)
  [[gnu::always_inline]] Lanes(const Numbers&... x)
      : Lanes([list = std::array<const Dual*, N>{&x...}](std::size_t k) -> const Dual& { return *list[k]; }, Gathered()) {}

  [[gnu::noinline]] Dual operator[](int k) const {
    Dual number(value[static_cast<std::size_t>(k)]);
    for (std::size_t d = 0; d < seeds_at_once; ++d) number.derivative[d] = derivative[N * d + static_cast<std::size_t>(k)];
    return number;
  }

  Lanes& operator+=(const Lanes& b) { return *this = *this + b; }
  Lanes& operator*=(const Lanes& b) { return *this = *this * b; }

  static Mask mask(bool condition) { return Plain::mask(condition); }

#define CUTJOINT_DEFINE(operation, A, B) \
  [[gnu::noinline]] friend Lanes operator operation(const A& a, const B& b)
#define CUTJOINT_SUM(operation)                                                                                   \
  CUTJOINT_DEFINE(operation, Lanes, Lanes) { return {a.value operation b.value, a.derivative operation b.derivative}; } \
  CUTJOINT_DEFINE(operation, Lanes, Dual) { return a operation Lanes(b); }                                      \
  CUTJOINT_DEFINE(operation, Dual, Lanes) { return Lanes(a) operation b; }
  CUTJOINT_SUM(+)
  CUTJOINT_SUM(-)
#undef CUTJOINT_SUM
  CUTJOINT_DEFINE(*, Lanes, Lanes) { return {a.value * b.value, a.derivative * beside(b.value) + beside(a.value) * b.derivative}; }
  CUTJOINT_DEFINE(*, Lanes, Dual) { return {a.value * b.value, a.derivative * b.value + beside(a.value) * spread(b.derivative)}; }
  CUTJOINT_DEFINE(*, Dual, Lanes) { return b * a; }
  CUTJOINT_DEFINE(/, Lanes, Lanes) {
    const Values quotient = a.value / b.value;
    return {quotient, (a.derivative - beside(quotient) * b.derivative) * beside(1.0 / b.value)};
  }
#undef CUTJOINT_DEFINE
  friend Lanes operator/(const Lanes& a, const Dual& b) { return a / Lanes(b); }
  friend Lanes operator/(const Dual& a, const Lanes& b) { return Lanes(a) / b; }
  [[gnu::noinline]] friend Lanes operator-(const Lanes& a) { return {-a.value, -a.derivative}; }
  friend Mask operator<(const Lanes& a, const Lanes& b) { return value_of(a) < value_of(b); }
  friend Mask operator<=(const Lanes& a, const Lanes& b) { return value_of(a) <= value_of(b); }

  friend Plain value_of(const Lanes& a) {
    typename Plain::Vector v;
    std::memcpy(&v, &a.value, sizeof v);
    return v;
  }

  /// condition ? yes : no in each lane.
  friend Lanes where(const Mask& condition, const Lanes& yes, const Lanes& no) {
    using Bits = decltype(Part{} < Part{});
    const Values chosen = of(where(condition, Plain(1.0), Plain(0.0)));
    const auto choose = [&](const auto& a, const auto& b) {
      return std::remove_cvref_t<decltype(a)>::of([&](std::size_t p) {
        const Bits is_first = chosen.part[p % (sizeof chosen / sizeof(Part))] > 0.0;
        return is_first ? a.part[p] : b.part[p];
      });
    };
    return {choose(yes.value, no.value), choose(yes.derivative, no.derivative)};
  }

  friend Lanes abs(const Lanes& a) { return where(value_of(a) < Plain(0.0), -a, a); }

  friend Dual sum(const Lanes& a) {
    Dual total(sum(value_of(a)));
    for (std::size_t d = 0; d < seeds_at_once; ++d) {
      typename Plain::Vector v;
      std::memcpy(&v, reinterpret_cast<const double*>(a.derivative.part) + N * d, sizeof v);
      total.derivative[d] = sum(Plain(v));
    }
    return total;
  }

  friend Lanes follow(Plain value, Plain steepness, const Lanes& a) { return {of(value), along(beside(of(steepness)), a.derivative)}; }

 private:
  Lanes(const Values& values, const Derivatives& derivatives) : value(values), derivative(derivatives) {}

  struct Gathered {};

  /// One number for each.
  template <class Each>
  [[gnu::always_inline]] Lanes(Each each, Gathered)
      : value(Values::of([&](std::size_t p) { return part_of([&](std::size_t i) { return each((p * register_length + i) % N).value; }); })),
        derivative(Derivatives::of([&](std::size_t p) {
          return part_of([&](std::size_t i) { return each((p * register_length + i) % N).derivative[(p * register_length + i) / N]; });
        })) {}

  [[gnu::always_inline]] static Part part_of(auto each) {
    Part part;
    for (std::size_t i = 0; i < register_length; ++i) part[i] = each(i);
    return part;
  }

  static Values of(Plain a) {
    Values values;
    for (std::size_t i = 0; i < sizeof values / sizeof(double); i += N) std::memcpy(&values[i], &a.v, sizeof a.v);
    return values;
  }

  /// Values repeated for the derivatives along each seed.
  [[gnu::always_inline]] static Derivatives beside(const Values& a) {
    return Derivatives::of([&](std::size_t p) { return a.part[p % (sizeof a / sizeof(Part))]; });
  }

  /// Derivatives equal in all lanes.
  [[gnu::always_inline]] static Derivatives spread(const Tangents& a) {
    return Derivatives::of([&](std::size_t p) {
      if constexpr (N >= register_length) return Part{} + a[p * register_length / N];
      else return part_of([&](std::size_t i) { return a[(p * register_length + i) / N]; });
    });
  }
};

template <int N>
struct Row<Lanes<Dual, N>> {
  Dual* x;
  void operator=(const Lanes<Dual, N>& side) const {
    for (int k = 0; k < N; ++k) x[k] = side[k];
  }
};

}  // namespace cutjoint
