// The pattern of a tangent as its parts ask for it, and where their entries stand in it.
#pragma once

#include <algorithm>
#include <set>
#include <span>
#include <vector>

#include "cutjoint/lagrangian/any_system.hpp"

namespace cutjoint::generic::natural {

/// Collects entries; of a symmetric matrix those above the diagonal are left out.
class Places {
 public:
  Places(int size, bool symmetric) : symmetric_(symmetric), columns_(static_cast<std::size_t>(size)) {}

  void add(int row, int column) {
    if (row >= column || !symmetric_) columns_[static_cast<std::size_t>(column)].insert(row);
  }

  Pattern pattern() const {
    std::vector<int> first{0}, row;
    for (const std::set<int>& rows : columns_) {
      row.insert(row.end(), rows.begin(), rows.end());
      first.push_back(static_cast<int>(row.size()));
    }
    return {static_cast<int>(columns_.size()), symmetric_, first, row};
  }

 private:
  bool symmetric_;
  std::vector<std::set<int>> columns_;
};

/// The entry of a pattern at a row and column; -1 where it has none.
inline int entry_of(const Pattern& pattern, int row, int column) {
  const auto begin = pattern.row.begin() + pattern.first[static_cast<std::size_t>(column)];
  const auto end = pattern.row.begin() + pattern.first[static_cast<std::size_t>(column) + 1];
  const auto found = std::lower_bound(begin, end, row);
  return found != end && *found == row ? static_cast<int>(found - pattern.row.begin()) : -1;
}

/// Adds a dense matrix over some scalars, stored by columns, to the entries of a tangent.
class Scatter {
 public:
  static void enter(Places& places, std::span<const int> scalars) {
    for (const int column : scalars)
      for (const int row : scalars) places.add(row, column);
  }

  void find_entries(const Pattern& pattern, std::span<const int> scalars) {
    int from = 0;
    for (const int column : scalars) {
      for (const int row : scalars) {
        const int to = entry_of(pattern, row, column);
        if (to >= 0) moves_.push_back({from, to});
        ++from;
      }
    }
  }

  template <class Real>
  void add(const Real* matrix, Real* values) const {
    for (const Move move : moves_) values[move.to] += matrix[move.from];
  }

 private:
  struct Move {
    int from, to;
  };

  std::vector<Move> moves_;
};

}  // namespace cutjoint::generic::natural
