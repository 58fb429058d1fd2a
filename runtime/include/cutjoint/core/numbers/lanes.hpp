// SIMD lanes of reals: the members of a class of equal parts of a mechanism.
#pragma once

#include <cstring>
#include <type_traits>

#include "cutjoint/core/numbers/functions.hpp"
#include "cutjoint/core/numbers/intrinsics.hpp"

#if defined(__x86_64__) && defined(__GLIBC__)
#ifdef CUTJOINT_WITHOUT_LIBMVEC
#define CUTJOINT_IN_LIBMVEC(of)  // only the processor's square roots
#else
#define CUTJOINT_IN_LIBMVEC(of) of(sin) of(cos) of(tan) of(atan) of(exp) of(log)
#endif
extern "C" {  // glibc's vector mathematics, errors of at most 4 units in the last place
#define CUTJOINT_DECLARE(name) [[gnu::visibility("default")]] cutjoint_register2 _ZGVbN2v_##name(cutjoint_register2);
CUTJOINT_IN_LIBMVEC(CUTJOINT_DECLARE)
#undef CUTJOINT_DECLARE
#ifdef __AVX2__
#define CUTJOINT_DECLARE(name) [[gnu::visibility("default")]] cutjoint_register4 _ZGVdN4v_##name(cutjoint_register4);
CUTJOINT_IN_LIBMVEC(CUTJOINT_DECLARE)
#undef CUTJOINT_DECLARE
#endif
#ifdef __AVX512F__
#define CUTJOINT_DECLARE(name) [[gnu::visibility("default")]] cutjoint_register8 _ZGVeN8v_##name(cutjoint_register8);
CUTJOINT_IN_LIBMVEC(CUTJOINT_DECLARE)
#undef CUTJOINT_DECLARE
#endif
}
#endif

namespace cutjoint {

/// Numbers without derivatives.
template <class Real>
concept PlainReal = !requires(const Real& x) { x.derivative; };

/// The register type of N reals; one specialisation a type, since GCC takes no dependent element type.
template <class Real, int N>
struct Register;

template <int N>
struct Register<double, N> {
  typedef double type __attribute__((vector_size(N * sizeof(double))));
};

template <int N>
struct Register<float, N> {
  typedef float type __attribute__((vector_size(N * sizeof(float))));
};

/// N reals with lane-wise arithmetic; a plain real counts for all lanes.
template <class Real, int N>
struct Lanes {
  using Vector = typename Register<Real, N>::type;
  using Mask = decltype(Vector{} < Vector{});
  using real_type = Real;
  static constexpr int size = N;

  Vector v;

  Lanes() = default;
  Lanes(Vector vector) : v(vector) {}
  Lanes(Real x) : v(Vector{} + x) {}
  template <class... Reals>
    requires(sizeof...(Reals) == N && N > 1)
  Lanes(Reals... x) : v{x...} {}

  Real operator[](int k) const { return v[k]; }

  Lanes& operator+=(Lanes b) { return *this = *this + b; }
  Lanes& operator*=(Lanes b) { return *this = *this * b; }

  /// A condition that is the same in all lanes.
  static Mask mask(bool condition) { return condition ? ~Mask{} : Mask{}; }

  friend Lanes operator+(Lanes a, Lanes b) { return a.v + b.v; }
  friend Lanes operator-(Lanes a, Lanes b) { return a.v - b.v; }
  friend Lanes operator*(Lanes a, Lanes b) { return a.v * b.v; }
  friend Lanes operator/(Lanes a, Lanes b) { return a.v / b.v; }
  friend Lanes operator-(Lanes a) { return -a.v; }
  friend Mask operator<(Lanes a, Lanes b) { return a.v < b.v; }
  friend Mask operator<=(Lanes a, Lanes b) { return a.v <= b.v; }
};

/// Every stride-th number from x on.
template <class Side, int stride, class Number>
Side strided(const Number* x) {
  typename Side::Vector v;
  if constexpr (stride == 1 && std::is_same_v<Number, typename Side::real_type>) std::memcpy(static_cast<void*>(&v), x, sizeof v);
  else
    for (int k = 0; k < Side::size; ++k) v[k] = typename Side::real_type(x[k * stride]);
  return v;
}

/// Numbers in memory, assigned to as lanes.
template <class Side>
struct Row {
  typename Side::real_type* x;
  void operator=(Side side) const { std::memcpy(x, &side.v, sizeof side.v); }
};

/// The numbers from x on.
template <class Side>
Row<Side> row(typename Side::real_type* x) { return {x}; }

/// condition ? yes : no in each lane, both evaluated.
template <class Mask, PlainReal Real, int N>
Lanes<Real, N> where(Mask condition, Lanes<Real, N> yes, Lanes<Real, N> no) { return condition ? yes.v : no.v; }

/// The sum of all lanes, by halves.
template <PlainReal Real, int N>
Real sum(Lanes<Real, N> a) {
  if constexpr (N == 4) return (a[0] + a[2]) + (a[1] + a[3]);
  Real total = a[0];
  for (int k = 1; k < N; ++k) total += a[k];
  return total;
}

/// A function of one real in each lane.
template <class Real, int N, class Function>
Lanes<Real, N> each(Lanes<Real, N> a, Function function) {
  typename Lanes<Real, N>::Vector result;
  for (int k = 0; k < N; ++k) result[k] = function(a[k]);
  return result;
}

/// A function of two reals in each lane.
template <class Real, int N, class Function>
Lanes<Real, N> each(Lanes<Real, N> a, Lanes<Real, N> b, Function function) {
  typename Lanes<Real, N>::Vector result;
  for (int k = 0; k < N; ++k) result[k] = function(a[k], b[k]);
  return result;
}

#define CUTJOINT_EACH(name, derivative)      \
  template <PlainReal Real, int N>           \
  Lanes<Real, N> name(Lanes<Real, N> a) {    \
    return each(a, [](Real x) {              \
      using std::name;                       \
      return name(x);                        \
    });                                      \
  }
CUTJOINT_FUNCTIONS(CUTJOINT_EACH)
#undef CUTJOINT_EACH

/// Clears the sign bit.
template <PlainReal Real, int N>
Lanes<Real, N> abs(Lanes<Real, N> a) {
  using Vector = typename Lanes<Real, N>::Vector;
  using Bits = typename Lanes<Real, N>::Mask;
  return Vector(Bits(a.v) & ~Bits(-Vector{}));
}

#ifdef CUTJOINT_IN_LIBMVEC
#define CUTJOINT_DEFINE(name) inline Lanes<double, 2> name(Lanes<double, 2> a) { return _ZGVbN2v_##name(a.v); }
CUTJOINT_IN_LIBMVEC(CUTJOINT_DEFINE)
#undef CUTJOINT_DEFINE
inline Lanes<double, 2> sqrt(Lanes<double, 2> a) { return CUTJOINT_SQRT2(a.v); }
#ifdef __AVX2__
#define CUTJOINT_DEFINE(name) inline Lanes<double, 4> name(Lanes<double, 4> a) { return _ZGVdN4v_##name(a.v); }
CUTJOINT_IN_LIBMVEC(CUTJOINT_DEFINE)
#undef CUTJOINT_DEFINE
inline Lanes<double, 4> sqrt(Lanes<double, 4> a) { return CUTJOINT_SQRT4(a.v); }
#endif
#ifdef __AVX512F__
#define CUTJOINT_DEFINE(name) inline Lanes<double, 8> name(Lanes<double, 8> a) { return _ZGVeN8v_##name(a.v); }
CUTJOINT_IN_LIBMVEC(CUTJOINT_DEFINE)
#undef CUTJOINT_DEFINE
inline Lanes<double, 8> sqrt(Lanes<double, 8> a) { return CUTJOINT_SQRT8(a.v); }
#endif
#endif

template <PlainReal Real, int N>
Lanes<Real, N> atan2(Lanes<Real, N> a, Lanes<Real, N> b) {
  using std::atan2;
  return each(a, b, [](Real x, Real y) { return atan2(x, y); });
}

template <PlainReal Real, int N>
Lanes<Real, N> pow(Lanes<Real, N> a, Lanes<Real, N> b) {
  using std::pow;
  return each(a, b, [](Real x, Real y) { return pow(x, y); });
}

}  // namespace cutjoint
