// Descriptions of systems.
#pragma once

#include "cutjoint/lagrangian/any_system.hpp"
#include "cutjoint/mechanism.hpp"

namespace cutjoint {

/// The places of the entries of a square sparse matrix: compressed columns, rows ascending.  Of a symmetric matrix the lower triangle.
struct Pattern {
  int size = 0;
  bool symmetric = false;
  std::vector<int> first;  ///< size + 1 offsets: column j has the entries first[j] .. first[j + 1] - 1
  std::vector<int> row;    ///< the row of each entry
};

/// The name of a method, as its failures have it.
constexpr std::string_view name_of(Lagrangian method) {
  switch (method) {
    case Lagrangian::augmented: return "augmented";
    case Lagrangian::classical: return "classical";
    case Lagrangian::recursive_newton: return "recursive-newton";
  }
  return "";
}

/// Everything about a system that does not change in a run: n coordinates, m equations.  Natural coordinates are the integrals of their own speeds and
/// have no charts; relative ones have the names of their speeds.
struct SystemDescription : Description {
  Lagrangian method;
  Pattern pattern;  ///< of the tangent: n and symmetric (augmented) or n + m and whole (classical)
  int factors;      ///< length of the array that `factor` fills

  /// Names of v, vdot and the force residual.
  const std::vector<std::string_view>& unknowns() const { return speeds.empty() ? coordinates : speeds; }
};

}  // namespace cutjoint
