// Factorisations by index data, compiled as the operations are.
#include "cutjoint/interpreter/system.hpp"

namespace cutjoint::interpreter {

namespace {

template <class Item>
static_factor::Table<Item> table(const std::vector<Item>& items) {
  static constexpr Item none[1] = {};
  static_factor::Table<Item> found(none);
  found.first = items.data();
  found.count = static_cast<int>(items.size());
  return found;
}

}  // namespace

int Factorisation::factor(const double* tangent, double* factors) const {
  const static_factor::Tables tables{.steps = table(steps_), .sweeps = table(sweeps_), .targets = table(targets_), .others = table(others_),
                                     .entries = table(entries_), .pivots = table(pivots_), .factors = factors_};
  if (symmetric_) {
    static_factor::eliminate<true>(tables, tangent, factors);
    return static_factor::find_unusable<true>(factors, tables.pivots.first, tables.pivots.count);
  }
  static_factor::eliminate<false>(tables, tangent, factors);
  return static_factor::find_unusable<false>(factors, tables.pivots.first, tables.pivots.count);
}

void Factorisation::solve(const double* factors, double* x) const {
  const static_factor::Tables tables{.steps = table(steps_), .sweeps = table(sweeps_), .targets = table(targets_), .others = table(others_),
                                     .entries = table(entries_), .pivots = table(pivots_), .factors = factors_};
  static_factor::substitute(tables, factors, room_.data(), x);
}

}  // namespace cutjoint::interpreter
