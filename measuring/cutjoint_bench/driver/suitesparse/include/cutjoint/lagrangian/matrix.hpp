// Whole sparse matrices from lower triangles.
#pragma once

#include "cutjoint/lagrangian/any_system.hpp"

namespace cutjoint {

/// The whole matrix of a pattern: of a symmetric one the triangle and its mirror image, of any other a copy.
class WholeMatrix {
 public:
  explicit WholeMatrix(const Pattern& pattern) {
    const auto size = static_cast<std::size_t>(pattern.size);
    std::vector<int> first(size + 1, 0);
    visit(pattern, [&](int, int column, int) { ++first[static_cast<std::size_t>(column) + 1]; });
    for (std::size_t j = 0; j < size; ++j) first[j + 1] += first[j];
    std::vector<int> row_of(static_cast<std::size_t>(first[size])), next(first.begin(), first.end() - 1);
    source_.resize(row_of.size());
    visit(pattern, [&](int row, int column, int entry) {
      const auto at = static_cast<std::size_t>(next[static_cast<std::size_t>(column)]++);
      row_of[at] = row;
      source_[at] = entry;
    });
    whole_ = {.size = pattern.size, .symmetric = false, .first = first, .row = row_of};
  }

  const Pattern& pattern() const { return whole_; }

  /// The whole matrix's values from those of the pattern it was made from.
  template <class Real>
  void fill(const Real* values, Real* whole) const {
    for (std::size_t i = 0; i < source_.size(); ++i) whole[i] = values[source_[i]];
  }

 private:
  /// Row, column and entry of all entries of the whole matrix.  Columns of the triangle are visited in ascending order, so that
  /// the rows of each whole column ascend: first those above the diagonal, which come from earlier columns, then its own.
  static void visit(const Pattern& pattern, auto visitor) {
    for (int column = 0, entry = 0; column < pattern.size; ++column)
      for (; entry < pattern.first[static_cast<std::size_t>(column) + 1]; ++entry) {
        const int row = pattern.row[static_cast<std::size_t>(entry)];
        visitor(row, column, entry);
        if (pattern.symmetric && row != column) visitor(column, row, entry);
      }
  }

  Pattern whole_;
  std::vector<int> source_;
};

}  // namespace cutjoint
