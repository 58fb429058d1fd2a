// L U of a matrix whose unknowns fall apart but for a border.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <utility>

#include "cutjoint/core/arrays.hpp"
#include "cutjoint/core/dual.hpp"

namespace cutjoint {

/// Where the entries of a matrix stand whose unknowns belong to the parts that `T::parts` names, the last of them the border.  Each part has a front,
/// rows of its own unknowns and below them of the border's, of as many columns and some that fill registers.
template <class T>
struct BorderedPlaces {
  static constexpr std::size_t size = std::size(T::parts);

  std::size_t last = 0;  ///< the border
  std::array<std::size_t, size + 1> length{}, border{}, first{}, front{}, stride{};  ///< of each part: its unknowns, the border's beside them, and its front
  std::array<std::size_t, size> place{};                                             ///< of unknowns in their parts
  std::size_t entries = 0, largest = 0;

  constexpr BorderedPlaces() {
    for (std::size_t i = 0; i < size; ++i) last = T::parts[i] > last ? T::parts[i] : last;
    for (std::size_t i = 0; i < size; ++i) place[i] = length[T::parts[i]]++;
    for (std::size_t p = 0, at = 0; p <= last; ++p) {
      border[p] = p < last ? length[last] : 0;
      const std::size_t rows = length[p] + border[p];
      first[p] = at, at += length[p];
      stride[p] = (rows + register_length - 1) / register_length * register_length;
      front[p] = entries, entries += rows * stride[p];
      if (rows > largest) largest = rows;
    }
  }

  /// Of a row and a column, one of which is in the border if their parts differ.
  constexpr std::size_t of(std::size_t i, std::size_t j) const {
    const std::size_t p = T::parts[i] < T::parts[j] ? T::parts[i] : T::parts[j];
    const std::size_t row = T::parts[i] == p ? place[i] : length[p] + place[i], column = T::parts[j] == p ? place[j] : length[p] + place[j];
    return front[p] + row * stride[p] + column;
  }
};

/// Such a matrix.  Rows are exchanged within parts.
template <class T>
class Bordered {
 public:
  static constexpr BorderedPlaces<T> places{};
  static constexpr std::size_t size = places.size;

  /// The entries, by `places`.
  Fixed<double, places.entries>& entries() { return x_; }

  /// Decompose it, which is overwritten; false where a part of it is singular, or no number.
  bool decompose() {
    for (std::size_t p = 0; p <= places.last; ++p) {
      if (!eliminate(p)) return false;
      const std::size_t n = places.length[p];
      for (std::size_t i = 0; i < places.border[p]; ++i)
        for (std::size_t j = 0; j < places.border[p]; ++j) row(places.last, i)[j] += row(p, n + i)[n + j];
    }
    return true;
  }

  /// x with A x = b, which it takes the place of.
  template <class Number>
  void solve(Fixed<Number, size>& b) const {
    Fixed<Number, size> y;
    for (std::size_t i = 0; i < size; ++i) y[places.first[T::parts[i]] + places.place[i]] = b[i];
    Number* const beside = y.data() + places.first[places.last];
    Number room[places.largest];
    for (std::size_t p = 0; p <= places.last; ++p) {
      const std::size_t n = places.length[p];
      Number* const own = y.data() + places.first[p];
      for (std::size_t i = 0; i < n; ++i) room[i] = less(own[order_[places.first[p] + i]], line(p, i), room, i);
      for (std::size_t i = 0; i < places.border[p]; ++i) beside[i] = less(beside[i], row(p, n + i), room, n);
      for (std::size_t i = 0; i < n; ++i) own[i] = room[i];
    }
    for (std::size_t p = places.last + 1; p-- > 0;) {
      const std::size_t n = places.length[p], all = n + places.border[p];
      Number* const own = y.data() + places.first[p];
      for (std::size_t i = n; i < all; ++i) room[i] = beside[i - n];
      for (std::size_t i = n; i-- > 0;) {
        const double* const of = line(p, i);
        room[i] = less(own[i], of + i + 1, room + i + 1, all - i - 1);
        own[i] = room[i] /= of[i];
      }
    }
    for (std::size_t i = 0; i < size; ++i) b[i] = y[places.first[T::parts[i]] + places.place[i]];
  }

  /// x with A^T x = b, which it takes the place of.
  void solve_transposed(Fixed<double, size>& b) const {
    Fixed<double, size> y;
    for (std::size_t i = 0; i < size; ++i) y[places.first[T::parts[i]] + places.place[i]] = b[i];
    double* const beside = y.data() + places.first[places.last];
    for (std::size_t p = 0; p <= places.last; ++p) {
      const std::size_t n = places.length[p], all = n + places.border[p];
      double* const own = y.data() + places.first[p];
      for (std::size_t i = 0; i < n; ++i) {
        const double* const of = line(p, i);
        const double x = own[i] /= of[i];
        for (std::size_t j = i + 1; j < n; ++j) own[j] -= of[j] * x;
        for (std::size_t j = n; j < all; ++j) beside[j - n] -= of[j] * x;
      }
    }
    double room[places.largest];
    for (std::size_t p = places.last + 1; p-- > 0;) {
      const std::size_t n = places.length[p];
      double* const own = y.data() + places.first[p];
      for (std::size_t i = 0; i < places.border[p]; ++i)
        for (std::size_t j = 0; j < n; ++j) own[j] -= row(p, n + i)[j] * beside[i];
      for (std::size_t i = n; i-- > 0;)
        for (std::size_t j = 0; j < i; ++j) own[j] -= line(p, i)[j] * own[i];
      for (std::size_t i = 0; i < n; ++i) room[order_[places.first[p] + i]] = own[i];
      std::copy_n(room, n, own);
    }
    for (std::size_t i = 0; i < size; ++i) b[i] = y[places.first[T::parts[i]] + places.place[i]];
  }

 private:
  double* row(std::size_t p, std::size_t i) { return x_.data() + places.front[p] + i * places.stride[p]; }
  const double* row(std::size_t p, std::size_t i) const { return x_.data() + places.front[p] + i * places.stride[p]; }

  /// A row as rows are exchanged.
  const double* line(std::size_t p, std::size_t i) const { return row(p, order_[places.first[p] + i]); }

  /// b less a sum of products.
  template <class Number>
  static Number less(Number b, const double* factors, const Number* numbers, std::size_t n) {
    for (std::size_t k = 0; k < n; ++k) b -= factors[k] * numbers[k];
    return b;
  }

  /// Take a part's unknowns out of its front; false where they are not determined.
  bool eliminate(std::size_t p) {
    const std::size_t n = places.length[p], all = n + places.border[p], stride = places.stride[p];
    double* rows[places.largest]{};
    for (std::size_t i = 0; i < all; ++i) rows[i] = row(p, i);
    for (std::size_t k = 0; k < n; ++k) {
      std::size_t largest = k;
      for (std::size_t i = k + 1; i < n; ++i)
        if (std::abs(rows[i][k]) > std::abs(rows[largest][k])) largest = i;
      std::swap(rows[k], rows[largest]);
      const double* const pivot = rows[k];
      const double inverse = 1.0 / pivot[k];
      if (!(inverse - inverse == 0.0)) return false;
      for (std::size_t i = k + 1; i < all; ++i) {
        double* const changed = rows[i];
        if (changed[k] == 0.0) continue;
        const double share = changed[k] *= inverse;
        std::size_t j = k + 1;
        for (; j % register_length != 0; ++j) changed[j] -= share * pivot[j];
        for (; j < stride; j += register_length) reinterpret_cast<Part&>(changed[j]) -= share * reinterpret_cast<const Part&>(pivot[j]);
      }
    }
    for (std::size_t i = 0; i < n; ++i) order_[places.first[p] + i] = static_cast<std::size_t>(rows[i] - row(p, 0)) / stride;
    return true;
  }

  Fixed<double, places.entries> x_;
  Fixed<std::size_t, size> order_;
};

}  // namespace cutjoint
