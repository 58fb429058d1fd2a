// Numbers with a derivative side by side.
#pragma once

#include <type_traits>

#include "cutjoint/core/dual.hpp"
#include "cutjoint/core/lanes.hpp"

namespace cutjoint {

/// N numbers that have no vector register.
template <class Number, int N>
struct Side {
  using Mask = typename Lanes<double, N>::Mask;

  Number x[N];

  Number operator[](int k) const { return x[k]; }
  Number& operator[](int k) { return x[k]; }

  /// An operation on each of the numbers.
  template <class Operation>
  static Side of(Operation operation) {
    Side result;
    for (int k = 0; k < N; ++k) result.x[k] = operation(k);
    return result;
  }

  template <class Condition>
  static Mask mask_of(Condition condition) {
    Mask result{};
    for (int k = 0; k < N; ++k) result[k] = condition(k) ? -1 : 0;
    return result;
  }

  friend Side operator-(const Side& a) { return of([&](int k) { return -a.x[k]; }); }
  friend Side operator+(const Side& a, const Side& b) { return of([&](int k) { return a.x[k] + b.x[k]; }); }
  friend Side operator+(const Side& a, Number b) { return of([&](int k) { return a.x[k] + b; }); }
  friend Side operator-(const Side& a, const Side& b) { return of([&](int k) { return a.x[k] - b.x[k]; }); }
  friend Side operator*(const Side& a, const Side& b) { return of([&](int k) { return a.x[k] * b.x[k]; }); }
  friend Side operator/(const Side& a, const Side& b) { return of([&](int k) { return a.x[k] / b.x[k]; }); }
  friend Mask operator<(const Side& a, const Side& b) { return mask_of([&](int k) { return a.x[k] < b.x[k]; }); }
  friend Mask operator<=(const Side& a, const Side& b) { return mask_of([&](int k) { return a.x[k] <= b.x[k]; }); }
};

template <int N>
struct Register<Dual, N> {
  using type = Side<Dual, N>;
};

template <class Mask, class Number, int N>
  requires std::is_same_v<typename Register<Number, N>::type, Side<Number, N>>
Lanes<Number, N> where(Mask condition, Lanes<Number, N> yes, Lanes<Number, N> no) {
  return Side<Number, N>::of([&](int k) { return condition[k] ? yes[k] : no[k]; });
}

template <class Number, int N>
  requires std::is_same_v<typename Register<Number, N>::type, Side<Number, N>>
Lanes<Number, N> abs(Lanes<Number, N> a) {
  return each(a, [](Number x) { return abs(x); });
}

}  // namespace cutjoint
