// Whole sparse matrices from lower triangles.
#pragma once

#include "cutjoint/lagrangian/system.hpp"

namespace cutjoint {

/// The whole matrix of a pattern: of a symmetric one the triangle and its mirror image, of any other a copy.
class WholeMatrix {
 public:
  explicit WholeMatrix(const Pattern& pattern) {
    const auto size = static_cast<std::size_t>(pattern.size);
    whole_.size = pattern.size;
    whole_.first.assign(size + 1, 0);
    visit(pattern, [&](int, int column, int) { ++whole_.first[static_cast<std::size_t>(column) + 1]; });
    for (std::size_t j = 0; j < size; ++j) whole_.first[j + 1] += whole_.first[j];
    whole_.row.resize(static_cast<std::size_t>(whole_.first[size]));
    source_.resize(whole_.row.size());
    std::vector<int> next(whole_.first.begin(), whole_.first.end() - 1);
    visit(pattern, [&](int row, int column, int entry) {
      const auto at = static_cast<std::size_t>(next[static_cast<std::size_t>(column)]++);
      whole_.row[at] = row;
      source_[at] = entry;
    });
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
