// L U of a matrix whose unknowns fall apart but for a border.
#pragma once

#include <array>
#include <cstddef>

#include "cutjoint/core/arrays.hpp"
#include "cutjoint/core/dense.hpp"

namespace cutjoint {

/// Where the entries of a matrix stand whose unknowns belong to the parts that `T::parts` names, the last of them the border.
template <class T>
struct BorderedPlaces {
  static constexpr std::size_t size = std::size(T::parts);

  std::size_t inner = 0;                     ///< how many parts there are beside the border
  std::array<std::size_t, size + 1> length{}, first{}, inside{}, right{}, below{};  ///< of each part: its unknowns, and where its blocks begin
  std::array<std::size_t, size> place{};     ///< of unknowns in their parts
  std::size_t entries = 0, largest = 0;

  constexpr BorderedPlaces() {
    for (std::size_t i = 0; i < size; ++i) inner = T::parts[i] > inner ? T::parts[i] : inner;
    for (std::size_t i = 0; i < size; ++i) place[i] = length[T::parts[i]]++;
    for (std::size_t p = 0, at = 0; p <= inner; ++p) {
      first[p] = at, at += length[p];
      inside[p] = entries, entries += length[p] * length[p];
      if (length[p] > largest) largest = length[p];
      if (p == inner) break;
      right[p] = entries, entries += length[p] * length[inner];
      below[p] = entries, entries += length[p] * length[inner];
    }
  }

  /// Of a row and a column, one of which is in the border if their parts differ.
  constexpr std::size_t of(std::size_t i, std::size_t j) const {
    const std::size_t p = T::parts[i], r = T::parts[j];
    if (p == r) return inside[p] + place[j] * length[p] + place[i];
    return p == inner ? below[r] + place[j] * length[inner] + place[i] : right[p] + place[j] * length[p] + place[i];
  }
};

/// Such a matrix.  Rows are exchanged within parts.
template <class T>
class Bordered {
 public:
  static constexpr BorderedPlaces<T> places{};
  static constexpr std::size_t size = places.size;

  /// The entries, by `places`, columns of blocks one after another.
  Fixed<double, places.entries>& entries() { return x_; }

  /// Decompose it, which is overwritten; false where a part of it is singular, or no number.
  bool decompose() {
    constexpr std::size_t border = places.length[places.inner];
    for (std::size_t p = 0; p < places.inner; ++p) {
      const std::size_t n = places.length[p];
      if (!triangles(p).decompose()) return false;
      for (std::size_t j = 0; j < border; ++j) {
        double* const column = x_.data() + places.right[p] + j * n;
        double room[places.largest];
        triangles(p).solve(column, room);
        take(p, column, x_.data() + places.inside[places.inner] + j * border);
      }
    }
    return border == 0 || triangles(places.inner).decompose();
  }

  /// x with A x = b, which it takes the place of.
  template <class Number>
  void solve(Fixed<Number, size>& b) {
    constexpr std::size_t border = places.length[places.inner];
    Fixed<Number, size> y;
    Number room[places.largest];
    for (std::size_t i = 0; i < size; ++i) y[places.first[T::parts[i]] + places.place[i]] = b[i];
    Number* const last = y.data() + places.first[places.inner];
    for (std::size_t p = 0; p < places.inner; ++p) {
      Number* const own = y.data() + places.first[p];
      triangles(p).solve(own, room);
      take(p, own, last);
    }
    if constexpr (border > 0) triangles(places.inner).solve(last, room);
    for (std::size_t p = 0; p < places.inner; ++p) {
      const double* const right = x_.data() + places.right[p];
      Number* const own = y.data() + places.first[p];
      for (std::size_t j = 0; j < border; ++j)
        for (std::size_t i = 0; i < places.length[p]; ++i) own[i] -= right[j * places.length[p] + i] * last[j];
    }
    for (std::size_t i = 0; i < size; ++i) b[i] = y[places.first[T::parts[i]] + places.place[i]];
  }

 private:
  dense::Triangles<double> triangles(std::size_t p) {
    return {{x_.data() + places.inside[p], places.length[p], places.length[p]}, order_.data() + places.first[p]};
  }

  /// Take what a part's unknowns bring into the border's rows.
  template <class Number>
  void take(std::size_t p, const Number* own, Number* last) const {
    constexpr std::size_t border = places.length[places.inner];
    const double* const below = x_.data() + places.below[p];
    for (std::size_t j = 0; j < places.length[p]; ++j)
      for (std::size_t i = 0; i < border; ++i) last[i] -= below[j * border + i] * own[j];
  }

  Fixed<double, places.entries> x_;
  Fixed<std::size_t, size> order_;
};

}  // namespace cutjoint
