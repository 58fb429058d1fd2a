// The code of a folder for numbers of 113 bits.  MODEL and TITLE are the name of the model, in capitals too, SOURCE is its file, FUNCTIONS one with
// those that its user supplies, for these numbers.
#pragma once

#define JOIN_(a, b) a##b
#define JOIN(a, b) JOIN_(a, b)
#define OF(name) JOIN(MODEL, _##name)
#define COUNT(name) JOIN(TITLE, _##name)

#define cutjoint quads  // the folder has a namespace of that name in its own
#include "cutjoint/quad.hpp"
#undef cutjoint

using quads::Quad;

#include SOURCE

namespace OF(code)::cutjoint {  // the functions of the model
#include FUNCTIONS
}

namespace OF(code)::cutjoint {  // parts side by side

template <class Real, int N>
struct Lanes;

template <int N>
struct Lanes<Quad, N> {
  using Vector = Lanes;
  using Mask = typename Lanes<double, N>::Mask;
  using real_type = Quad;
  static constexpr int size = N;

  Quad v[N];

  Lanes() = default;
  Lanes(const Quad& x) {
    for (Quad& each : v) each = x;
  }
  template <class... Numbers>
    requires(sizeof...(Numbers) == N && N > 1)
  Lanes(const Numbers&... x) : v{x...} {}

  const Quad& operator[](int k) const { return v[k]; }
  Quad& operator[](int k) { return v[k]; }

#define DEFINE(Result, operation, what)                            \
  friend Result operator operation(const Lanes& a, const Lanes& b) { \
    Result result;                                                 \
    for (int k = 0; k < N; ++k) result[k] = what;                  \
    return result;                                                 \
  }
  DEFINE(Lanes, +, a.v[k] + b.v[k])
  DEFINE(Lanes, -, a.v[k] - b.v[k])
  DEFINE(Lanes, *, a.v[k] * b.v[k])
  DEFINE(Lanes, /, a.v[k] / b.v[k])
  DEFINE(Mask, <, a.v[k] < b.v[k] ? -1 : 0)
  DEFINE(Mask, <=, a.v[k] <= b.v[k] ? -1 : 0)
#undef DEFINE
  friend Lanes operator-(const Lanes& a) { return Lanes(Quad(0)) - a; }
};

template <class Mask, int N>
Lanes<Quad, N> where(Mask condition, Lanes<Quad, N> yes, Lanes<Quad, N> no) {
  for (int k = 0; k < N; ++k) no[k] = condition[k] ? yes[k] : no[k];
  return no;
}

template <int N>
Lanes<Quad, N> abs(Lanes<Quad, N> a) {
  return where(a < Lanes<Quad, N>(Quad(0)), -a, a);
}

}  // namespace OF(code)::cutjoint

namespace core = OF(code)::cutjoint;
namespace code = OF(code);

template <class Subject>
struct InQuad;
template <template <class> class Subject>
struct InQuad<Subject<double>> {
  using type = Subject<Quad>;
};
