// The contract of a system with a tangent between generated code (or the generic solver) and the steps of Newton's iteration.
#pragma once

#include "cutjoint/core/mechanism/mechanism.hpp"

namespace cutjoint {

/// How many rows a tangent has, entries that are not always zero, and numbers in its factors.
struct TangentSizes {
  std::size_t rows = 0, entries = 0, factors = 0;
};

/// Where the entries of a square sparse matrix stand, of a system whose class knows it: compressed columns, rows ascending.  Of a symmetric matrix the
/// lower triangle.
struct FixedPattern {
  int size;
  bool symmetric;
  std::span<const int> first;  ///< size + 1 offsets: column j has the entries first[j] .. first[j + 1] - 1
  std::span<const int> row;    ///< the row of each entry
};

/// The sizes of the tangent if the class knows them, else 0.
template <class S>
constexpr TangentSizes static_tangent() {
  if constexpr (Sized<S>) return {static_cast<std::size_t>(S::pattern.size), S::pattern.row.size(), static_cast<std::size_t>(S::factors)};
  return {};
}

/// Where the entries of a system's tangent stand.
template <class S>
const auto& pattern_of(const S& system) {
  if constexpr (Sized<S>) return S::pattern;
  else return system.description().pattern;
}

/// The type of that.
template <class S>
using PatternOf = std::remove_cvref_t<decltype(pattern_of(std::declval<const S&>()))>;

/// The sizes of a system's tangent.
template <class S>
TangentSizes tangent_of(const S& system) {
  if constexpr (Sized<S>) {
    return static_tangent<S>();
  } else {
    const auto& d = system.description();
    return {static_cast<std::size_t>(d.pattern.size), d.pattern.row.size(), static_cast<std::size_t>(d.factors)};
  }
}

/// The numbers in the matrices of balls, `Weights::ball_tangents`.
constexpr std::size_t size_of_ball_tangents(std::span<const Chart> charts) {
  std::size_t numbers = 0;
  for (const Chart& chart : charts) numbers += chart.ball ? 9 : 0;
  return numbers;
}

template <class S>
constexpr std::size_t static_ball_tangents() {
  if constexpr (Sized<S>) return size_of_ball_tangents(S::charts);
  return 0;
}

/// Arrays with an element for each row or entry of the tangent, its factors, and the matrices of balls.
template <class S>
using Rows = Array<S, static_tangent<S>().rows>;
template <class S>
using Entries = Array<S, static_tangent<S>().entries>;
template <class S>
using Factors = Array<S, static_tangent<S>().factors>;
template <class S>
using BallTangents = Array<S, static_ball_tangents<S>()>;

/// The turns of a pose that is not stepped to, unit matrices.
template <class S>
BallTangents<S> unit_ball_tangents(const S& system) {
  using Real = typename S::real_type;
  BallTangents<S> ball_tangents(size_of_ball_tangents(charts_of(system)));
  for (std::size_t i = 0; i < ball_tangents.size(); ++i) ball_tangents[i] = Real(i % 9 % 4 == 0 ? 1 : 0);
  return ball_tangents;
}

}  // namespace cutjoint
