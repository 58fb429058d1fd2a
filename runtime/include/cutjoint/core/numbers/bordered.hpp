// L U of a bordered block-diagonal matrix.
#pragma once

#include <array>
#include <cstdint>
#include <iterator>

#include "cutjoint/core/numbers/arrays.hpp"
#include "cutjoint/core/numbers/dual.hpp"

namespace cutjoint {

/// A SIMD pack of one, two or four doubles, one of each block of a matrix, with the alignment of doubles.
template <std::size_t side>
struct Beside;

#define CUTJOINT_OPERATION(operation)                                                                                          \
  [[gnu::always_inline]] friend Beside operator operation(const Beside& a, const Beside& b) { return {a.v operation b.v}; } \
  [[gnu::always_inline]] friend Beside operator operation(const Beside& a, double b) { return {a.v operation b}; }          \
  [[gnu::always_inline]] friend Beside operator operation(double a, const Beside& b) { return {a operation b.v}; }
#define CUTJOINT_BESIDE(side, one, total, ...)                                                                \
  template <>                                                                                                 \
  struct Beside<side> {                                                                                       \
    one v;                                                                                                    \
                                                                                                              \
    template <class Each>                                                                                     \
    [[gnu::always_inline]] static Beside of([[maybe_unused]] Each each) {                                     \
      return {one{__VA_ARGS__}};                                                                              \
    }                                                                                                         \
    [[gnu::always_inline]] double operator[](std::size_t l) const { return reinterpret_cast<const double*>(&v)[l]; } \
    [[gnu::always_inline]] double sum() const { return total; }                                               \
    [[gnu::always_inline]] Beside size() const { return larger(*this, {-v}); }                                \
    [[gnu::always_inline]] Beside& operator+=(const Beside& b) { return v += b.v, *this; }                    \
    [[gnu::always_inline]] Beside& operator-=(const Beside& b) { return v -= b.v, *this; }                    \
    [[gnu::always_inline]] Beside& operator*=(const Beside& b) { return v *= b.v, *this; }                    \
    CUTJOINT_OPERATION(-)                                                                                     \
    CUTJOINT_OPERATION(*)                                                                                     \
    CUTJOINT_OPERATION(/)                                                                                     \
    [[gnu::always_inline]] friend Beside larger(const Beside& a, const Beside& b) { return {a.v > b.v ? a.v : b.v}; } \
  };
typedef double TwoBeside __attribute__((vector_size(16), aligned(alignof(double))));
typedef double FourBeside __attribute__((vector_size(32), aligned(alignof(double))));
CUTJOINT_BESIDE(1, double, v, each(0))
CUTJOINT_BESIDE(2, TwoBeside, v[0] + v[1], each(0), each(1))
CUTJOINT_BESIDE(4, FourBeside, (v[0] + v[2]) + (v[1] + v[3]), each(0), each(1), each(2), each(3))
#undef CUTJOINT_BESIDE
#undef CUTJOINT_OPERATION

/// A pack of numbers of each block, to be multiplied with factors of each.
template <std::size_t side, class Number, class Each = std::make_index_sequence<side>>
struct Sides {
  Beside<side> x;

  [[gnu::always_inline]] static Sides of(auto each) { return {Beside<side>::of(each)}; }
  [[gnu::always_inline]] void subtract(const Beside<side>& factor, const Sides& b) { x -= factor * b.x; }
  [[gnu::always_inline]] void subtract(const Beside<side>& factor, const Number& b) { x -= factor * b; }
  [[gnu::always_inline]] void scale(const Beside<side>& factor) { x *= factor; }
  [[gnu::always_inline]] double sum() const { return x.sum(); }
};

template <std::size_t side, std::size_t... l>
struct Sides<side, DualPart, std::index_sequence<l...>> {
  DualPart x[side];

  [[gnu::always_inline]] static Sides of(auto each) { return {{each(l)...}}; }
  [[gnu::always_inline]] void subtract(const Beside<side>& factor, const Sides& b) { ((x[l].derivative -= factor[l] * b.x[l].derivative), ...); }
  [[gnu::always_inline]] void subtract(const Beside<side>& factor, const DualPart& b) { ((x[l].derivative -= factor[l] * b.derivative), ...); }
  [[gnu::always_inline]] void scale(const Beside<side>& factor) { ((x[l].derivative *= factor[l]), ...); }
  [[gnu::always_inline]] DualPart sum() const {
    DualPart total = x[0];
    for (std::size_t k = 1; k < side; ++k) total += x[k];
    return total;
  }
};

/// The layout of a matrix whose unknowns belong to the blocks `T::parts`, the last of them the border.  Sets of `T::beside` blocks with the same
/// sparsity are packed in SIMD lanes.  Each set has a front: the rows of its own unknowns, and below them those of the border.
template <class T>
struct BorderedPlaces {
  static constexpr std::size_t size = std::size(T::parts), sets = std::size(T::beside);

  std::array<std::size_t, sets> length{}, border{};                             ///< of each set: unknowns per block, and of the border
  std::array<std::size_t, sets> first{}, front{}, part{}, row{}, lines{}, pivot{};  ///< first unknown, entry, block, row, scale and pivot
  std::array<std::size_t, size> set{}, place{};                                       ///< of unknowns: their sets, and indices in their blocks
  std::size_t entries = 0, rows = 0, scales = 0, pivots = 0, largest = 0;

  constexpr BorderedPlaces() {
    for (std::size_t s = 1; s < sets; ++s) part[s] = part[s - 1] + T::beside[s - 1];
    std::array<std::size_t, size + 1> count{};
    for (std::size_t i = 0; i < size; ++i) {
      while (set[i] + 1 < sets && part[set[i] + 1] <= T::parts[i]) ++set[i];
      place[i] = count[T::parts[i]]++;
    }
    for (std::size_t s = 0, next = 0; s < sets; ++s) {
      length[s] = count[part[s]];
      border[s] = s + 1 < sets ? count[part[sets - 1]] : 0;
      const std::size_t all = length[s] + border[s];
      first[s] = next, next += length[s] * T::beside[s];
      front[s] = entries, entries += all * all * T::beside[s];
      row[s] = rows, rows += all;
      lines[s] = scales, scales += all * T::beside[s];
      pivot[s] = pivots, pivots += length[s];
      if (all > largest) largest = all;
    }
  }

  /// The position of an unknown in the packed order.
  constexpr std::size_t slot(std::size_t i) const { return first[set[i]] + place[i] * T::beside[set[i]] + T::parts[i] - part[set[i]]; }

  /// The position of an entry by row and column, one of which is in the border if their blocks differ.
  constexpr std::size_t of(std::size_t i, std::size_t j) const {
    const std::size_t p = T::parts[i] < T::parts[j] ? T::parts[i] : T::parts[j], s = T::parts[i] < T::parts[j] ? set[i] : set[j];
    const std::size_t down = T::parts[i] == p ? place[i] : length[s] + place[i], along = T::parts[j] == p ? place[j] : length[s] + place[j];
    return front[s] + (down * (length[s] + border[s]) + along) * T::beside[s] + p - part[s];
  }
};

/// Such a matrix with the sparsity `pattern`.  Pivots are chosen by least fill (Markowitz) among those not small in their columns, with rows
/// scaled by their largest entries.  Further matrices reuse the pivots as long as these stay large enough.
template <class T>
class Bordered {
 public:
  static constexpr BorderedPlaces<T> places{};
  static constexpr std::size_t size = places.size;
  using Pattern = std::array<bool, places.entries>;

  /// The entries, in the order of `places`.
  Fixed<double, places.entries>& entries() { return x_; }

  void clear() {
    for (std::size_t s = 0; s < places.sets; ++s) {
      const std::size_t all = places.length[s] + places.border[s], width = all * T::beside[s];
      for (std::size_t i = 0; i < all; ++i) std::fill_n(x_.data() + places.front[s] + i * width, width, 0.0);
    }
  }

  /// The pattern of a full matrix.
  static constexpr Pattern everywhere = [] {
    Pattern all{};
    all.fill(true);
    return all;
  }();

  /// Decompose the matrix in place; false if reused pivots have become small, or new ones are not finite.
  bool decompose(const Pattern& pattern) {
    bool is_regular = true;
    for (std::size_t s = 0; s < places.sets && is_regular; ++s)
      with_side(s, [&]<std::size_t side>() {
        is_regular = is_ordered_ ? this->template eliminate<side>(s) : this->template choose<side>(s, pattern);
        const std::size_t n = places.length[s], number = places.border[s];
        double* const rest = x_.data() + places.front[places.sets - 1];
        for (std::size_t i = 0; i < number; ++i)
          for (std::size_t j = 0; j < number; ++j) rest[i * number + j] += this->template row<side>(s, n + i)[n + j].sum();
      });
    is_ordered_ = is_regular;
    return is_regular;
  }

  /// Solve A x = b in place, in the order of `places`.
  template <class Number>
  void solve(Number* b) const {
    std::array<Number, size> room;
    for (std::size_t s = 0; s < places.sets; ++s)
      with_side(s, [&]<std::size_t side>() { this->template forward_substitute<side, Number>(s, b, room.data()); });
    for (std::size_t s = places.sets; s-- > 0;)
      with_side(s, [&]<std::size_t side>() { this->template back_substitute<side, Number>(s, b, room.data()); });
  }

  /// Solve A^T x = b in place.
  void solve_transposed(double* b) const {
    std::array<double, size> room;
    for (std::size_t s = 0; s < places.sets; ++s)
      with_side(s, [&]<std::size_t side>() { this->template forward_substitute_transposed<side>(s, b, room.data()); });
    for (std::size_t s = places.sets; s-- > 0;)
      with_side(s, [&]<std::size_t side>() { this->template back_substitute_transposed<side>(s, b, room.data()); });
  }

 private:
  using Index = std::uint16_t;
  static constexpr double least = 0.1, too_small = 1e-3;  ///< fractions of the columns' largest entries, for new pivots and reused ones

  static constexpr bool has_side(std::size_t side) { return std::find(std::begin(T::beside), std::end(T::beside), side) != std::end(T::beside); }

  static void with_side(std::size_t s, auto use) {
    if (has_side(4) && T::beside[s] == 4) return use.template operator()<has_side(4) ? 4 : 1>();
    if (has_side(2) && T::beside[s] == 2) return use.template operator()<has_side(2) ? 2 : 1>();
    use.template operator()<1>();
  }

  template <std::size_t side>
  Beside<side>* row(std::size_t s, std::size_t i) {
    return reinterpret_cast<Beside<side>*>(x_.data() + places.front[s] + i * (places.length[s] + places.border[s]) * side);
  }
  template <std::size_t side>
  const Beside<side>* row(std::size_t s, std::size_t i) const { return const_cast<Bordered*>(this)->template row<side>(s, i); }
  template <std::size_t side>
  Beside<side>& scale(std::size_t s, std::size_t i) { return reinterpret_cast<Beside<side>&>(scales_[places.lines[s] + i * side]); }
  /// Row and column of a pivot, and the rows and columns of its update.
  struct Pivot {
    Index row, column, rows = 0, columns = 0;
    Index row_list[places.largest], column_list[places.largest];
  };

  /// Columns of L by row.
  struct Line {
    Index number = 0;
    Index columns[places.largest];
  };

  /// Eliminate the unknowns of a set with known pivots; false if one is small.
  template <std::size_t side>
  bool eliminate(std::size_t s) {
    const Beside<side> none = Beside<side>::of([](std::size_t) { return 0.0; });
    Beside<side> most = none, odd = none;
    for (std::size_t k = 0; k < places.length[s]; ++k) {
      const Pivot& pivot = pivots_[places.pivot[s] + k];
      const Beside<side>* const from = row<side>(s, pivot.row);
      const Beside<side> inverse = 1.0 / from[pivot.column];
      Beside<side> worst = none;
      for (std::size_t i = 0; i < pivot.rows; ++i) {
        const std::size_t line = pivot.row_list[i];
        const Beside<side> share = subtract<side>(s, pivot, from, inverse, line);
        worst = larger((share * scale<side>(s, line)).size(), worst);
      }
      most = larger(worst / scale<side>(s, pivot.row), most);
      odd += inverse - inverse;
      row<side>(s, pivot.row)[pivot.column] = inverse;
    }
    bool is_regular = odd.sum() == 0.0;
    for (std::size_t l = 0; l < side; ++l) is_regular = is_regular && most[l] <= 1.0 / too_small;
    return is_regular;
  }

  template <std::size_t side>
  [[gnu::always_inline]] Beside<side> subtract(std::size_t s, const Pivot& pivot, const Beside<side>* from, const Beside<side>& inverse, std::size_t line) {
    Beside<side>* const to = row<side>(s, line);
    const Beside<side> share = to[pivot.column] *= inverse;
#pragma GCC unroll 4
    for (std::size_t j = 0; j < pivot.columns; ++j) to[pivot.column_list[j]] -= share * from[pivot.column_list[j]];
    return share;
  }

  /// The same, choosing pivots.
  template <std::size_t side>
  bool choose(std::size_t s, const Pattern& pattern) {
    const std::size_t n = places.length[s], all = n + places.border[s];
    static constexpr std::size_t most = places.largest;
    bool there[most][most], is_left[2][most];
    for (std::size_t i = 0; i < all; ++i) {
      is_left[0][i] = is_left[1][i] = true;
      lines_[places.row[s] + i].number = 0;
      Beside<side> largest = Beside<side>::of([](std::size_t) { return 0.0; });
      for (std::size_t j = 0; j < all; ++j) {
        there[i][j] = s + 1 == places.sets;
        for (std::size_t l = 0; l < side; ++l) there[i][j] = there[i][j] || pattern[places.front[s] + (i * all + j) * side + l];
        largest = larger(row<side>(s, i)[j].size(), largest);
      }
      scale<side>(s, i) = Beside<side>::of([&](std::size_t l) { return largest[l] > 0.0 ? 1.0 / largest[l] : 1.0; });
    }
    for (std::size_t k = 0; k < n; ++k) {
      Pivot& pivot = pivots_[places.pivot[s] + k];
      if (!find_pivot<side>(s, there, is_left, pivot)) return false;
      is_left[0][pivot.row] = is_left[1][pivot.column] = false;
      pivot.rows = pivot.columns = 0;
      for (std::size_t i = 0; i < all; ++i) {
        if (is_left[0][i] && there[i][pivot.column]) pivot.row_list[pivot.rows++] = static_cast<Index>(i);
        if (is_left[1][i] && there[pivot.row][i]) pivot.column_list[pivot.columns++] = static_cast<Index>(i);
      }
      const Beside<side>* const from = row<side>(s, pivot.row);
      const Beside<side> inverse = 1.0 / from[pivot.column];
      for (std::size_t i = 0; i < pivot.rows; ++i) {
        const std::size_t at = pivot.row_list[i];
        subtract<side>(s, pivot, from, inverse, at);
        Line& line = lines_[places.row[s] + at];
        line.columns[line.number++] = pivot.column;
        for (std::size_t j = 0; j < pivot.columns; ++j) there[at][pivot.column_list[j]] = true;
      }
      if (!((inverse - inverse).sum() == 0.0)) return false;
      row<side>(s, pivot.row)[pivot.column] = inverse;
    }
    return true;
  }

  /// Choose the pivot that changes fewest entries among those large enough in all blocks, else the largest; false if none is finite.
  template <std::size_t side, class There, class Left>
  bool find_pivot(std::size_t s, const There& there, const Left& is_left, Pivot& pivot) {
    const std::size_t n = places.length[s], all = n + places.border[s];
    std::size_t in_row[places.largest]{}, in_column[places.largest]{}, cost = 0;
    for (std::size_t i = 0; i < all; ++i)
      for (std::size_t j = 0; j < all; ++j)
        if (is_left[0][i] && is_left[1][j] && there[i][j]) ++in_row[i], ++in_column[j];
    double best = 0.0;
    for (std::size_t j = 0; j < n; ++j) {
      if (!is_left[1][j]) continue;
      Beside<side> largest = Beside<side>::of([](std::size_t) { return 0.0; });
      const auto share = [&](std::size_t i) { return (row<side>(s, i)[j] * scale<side>(s, i)).size(); };
      for (std::size_t i = 0; i < n; ++i)
        if (is_left[0][i]) largest = larger(share(i), largest);
      for (std::size_t i = 0; i < n; ++i) {
        if (!is_left[0][i] || !there[i][j]) continue;
        const Beside<side> shares = share(i) / largest;
        double smallest = 1.0;
        for (std::size_t l = 0; l < side; ++l)
          if (!(shares[l] >= smallest)) smallest = shares[l];
        const std::size_t changes = (in_row[i] - 1) * (in_column[j] - 1);
        if (!(smallest > 0.0) || smallest < std::min(best, least) || (best >= least && (changes > cost || (changes == cost && smallest <= best)))) continue;
        best = smallest, cost = changes;
        pivot.row = static_cast<Index>(i), pivot.column = static_cast<Index>(j);
      }
    }
    return best > 0.0;
  }

  /// L y = b of a set; its part of the border's rows is subtracted from b.
  template <std::size_t side, class Number>
  void forward_substitute(std::size_t s, Number* b, Number* room) const {
    const std::size_t n = places.length[s];
    auto* const y = reinterpret_cast<Sides<side, Number>*>(room + places.first[s]);
    const auto* const known = reinterpret_cast<const Sides<side, Number>*>(b + places.first[s]);
    for (std::size_t k = 0; k < n; ++k) {
      const Pivot& pivot = pivots_[places.pivot[s] + k];
      auto x = known[pivot.row];
      subtract_lower<side>(s, pivot.row, y, x);
      y[pivot.column] = x;
    }
    for (std::size_t i = 0; i < places.border[s]; ++i) {
      auto x = Sides<side, Number>::of([](std::size_t) { return Number{}; });
      subtract_lower<side>(s, n + i, y, x);
      b[places.first[places.sets - 1] + i] += x.sum();
    }
  }

  template <std::size_t side, class Number>
  [[gnu::always_inline]] void subtract_lower(std::size_t s, std::size_t i, const Sides<side, Number>* y, Sides<side, Number>& x) const {
    const Line& line = lines_[places.row[s] + i];
    const Beside<side>* const factors = row<side>(s, i);
    for (std::size_t k = 0; k < line.number; ++k) x.subtract(factors[line.columns[k]], y[line.columns[k]]);
  }

  /// U x = y of a set.
  template <std::size_t side, class Number>
  void back_substitute(std::size_t s, Number* b, const Number* room) const {
    const std::size_t n = places.length[s];
    const auto* const y = reinterpret_cast<const Sides<side, Number>*>(room + places.first[s]);
    auto* const found = reinterpret_cast<Sides<side, Number>*>(b + places.first[s]);
    std::array<Sides<side, Number>, places.largest> x;
    for (std::size_t i = 0; i < places.border[s]; ++i) x[n + i] = Sides<side, Number>::of([&](std::size_t) { return b[places.first[places.sets - 1] + i]; });
    for (std::size_t k = n; k-- > 0;) {
      const Pivot& pivot = pivots_[places.pivot[s] + k];
      const Beside<side>* const factors = row<side>(s, pivot.row);
      auto sum = y[pivot.column];
      for (std::size_t j = 0; j < pivot.columns; ++j) sum.subtract(factors[pivot.column_list[j]], x[pivot.column_list[j]]);
      sum.scale(factors[pivot.column]);
      found[pivot.column] = x[pivot.column] = sum;
    }
  }

  /// U^T y = b of a set; its part of the border's columns is subtracted from b.
  template <std::size_t side>
  void forward_substitute_transposed(std::size_t s, double* b, double* room) const {
    const std::size_t n = places.length[s];
    auto* const known = reinterpret_cast<Beside<side>*>(b + places.first[s]);
    auto* const y = reinterpret_cast<Beside<side>*>(room + places.first[s]);
    for (std::size_t k = 0; k < n; ++k) {
      const Pivot& pivot = pivots_[places.pivot[s] + k];
      const Beside<side>* const factors = row<side>(s, pivot.row);
      const Beside<side> x = known[pivot.column] * factors[pivot.column];
      for (std::size_t j = 0; j < pivot.columns; ++j) {
        const std::size_t column = pivot.column_list[j];
        if (column < n) known[column] -= factors[column] * x;
        else b[places.first[places.sets - 1] + column - n] -= (factors[column] * x).sum();
      }
      y[pivot.column] = x;
    }
  }

  /// L^T x = y of a set.
  template <std::size_t side>
  void back_substitute_transposed(std::size_t s, double* b, double* room) const {
    const std::size_t n = places.length[s];
    auto* const y = reinterpret_cast<Beside<side>*>(room + places.first[s]);
    auto* const found = reinterpret_cast<Beside<side>*>(b + places.first[s]);
    const auto push = [&](std::size_t i, const auto& x) {
      const Line& line = lines_[places.row[s] + i];
      const Beside<side>* const factors = row<side>(s, i);
      for (std::size_t k = 0; k < line.number; ++k) y[line.columns[k]] -= factors[line.columns[k]] * x;
    };
    for (std::size_t i = 0; i < places.border[s]; ++i) push(n + i, b[places.first[places.sets - 1] + i]);
    for (std::size_t k = n; k-- > 0;) {
      const Pivot& pivot = pivots_[places.pivot[s] + k];
      const Beside<side> x = y[pivot.column];
      found[pivot.row] = x;
      push(pivot.row, x);
    }
  }

  Fixed<double, places.entries> x_;
  Fixed<double, places.scales> scales_;  ///< of rows, for comparing their entries
  Pivot pivots_[places.pivots];
  Line lines_[places.rows];
  bool is_ordered_ = false;
};

}  // namespace cutjoint
