// A static factorisation by index data.
#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <vector>

#include "cutjoint/core/newton/static_factor.hpp"
#include "cutjoint/interpreter/program.hpp"

namespace cutjoint::interpreter {

/// The data of a factorisation (core/newton/static_factor.hpp), with all indices checked.
class Factorisation {
 public:
  /// For a matrix with `size` rows and `entries` entries, and an array of `factors` numbers.
  Factorisation(const Json& tables, bool symmetric, int size, int entries, int factors) : symmetric_(symmetric), factors_(factors) {
    for (const auto& [pivots, diagonal, reciprocals, uppers, lowers, sweeps] : read<6>(tables.at("steps")))
      steps_.push_back({pivots, diagonal, reciprocals, uppers, lowers, sweeps});
    for (const auto& [columns, source, multipliers, blocks] : read<4>(tables.at("sweeps")))
      sweeps_.push_back({columns, source, multipliers, blocks});
    for (const auto& [value, place] : read<2>(tables.at("entries"))) entries_.push_back({value, place});
    for (const auto& [row, column, place] : read<3>(tables.at("pivots"))) pivots_.push_back({row, column, place});
    targets_ = tables.at("targets").get<std::vector<int>>();
    others_ = tables.at("others").get<std::vector<int>>();
    check(size, entries);
    room_.resize(4 * steps_.size());
  }

  int factor(const double* tangent, double* factors) const;  ///< as AnySystem has it
  void solve(const double* factors, double* x) const;

 private:
  template <std::size_t n>
  static std::vector<std::array<int, n>> read(const Json& list) {
    return list.get<std::vector<std::array<int, n>>>();
  }

  /// Rejects an index from which an array has too few numbers.
  static void require(int first, int count, std::size_t end) {
    if (first < 0 || count < 0 || static_cast<std::size_t>(first) + static_cast<std::size_t>(count) > end)
      refuse("its factorisation has no place " + std::to_string(first));
  }

  void check(int size, int entries) const {
    const auto end = static_cast<std::size_t>(factors_), room = 4 * steps_.size();
    std::size_t sweep = 0, target = 0, other = 0;
    for (const static_factor::Step& step : steps_) {
      if (step.pivots < 1 || step.pivots > 4) refuse("a tile has " + std::to_string(step.pivots) + " pivots");
      for (const int count : {step.uppers, step.lowers, step.sweeps}) require(0, count, end);
      if (symmetric_ && step.uppers != step.lowers) refuse("a symmetric tile has other blocks below than right of it");
      require(step.diagonal, 4 * step.pivots, end);
      require(step.diagonal + 4 * step.pivots, 4 * step.pivots * step.uppers, end);
      require(step.diagonal + 4 * step.pivots * (1 + step.uppers), 4 * step.pivots * step.lowers, end);
      require(step.reciprocals, step.pivots, end);
      for (int i = 0; i < step.sweeps; ++i, ++sweep) {
        if (sweep >= sweeps_.size()) refuse("a sweep is missing");
        const static_factor::Sweep& s = sweeps_[sweep];
        if (s.columns < 1 || s.columns > 4) refuse("a sweep has " + std::to_string(s.columns) + " columns");
        require(0, s.blocks, end);
        require(s.source, 4 * step.pivots * s.blocks, end);
        require(s.multipliers, 4 * step.pivots, end);
        for (int k = 0; k < s.blocks; ++k, ++target) {
          if (target >= targets_.size()) refuse("a target is missing");
          require(targets_[target], 4 * s.columns, end);
        }
      }
      other += static_cast<std::size_t>(step.uppers + step.lowers);
    }
    if (other != others_.size()) refuse("its factorisation has a wrong number of tiles");
    for (const int place : others_) require(place, 4, room);
    for (const static_factor::Entry& e : entries_) require(e.value, 1, static_cast<std::size_t>(entries)), require(e.place, 1, end);
    for (const static_factor::Pivot& p : pivots_) {
      require(p.row, 1, static_cast<std::size_t>(size));
      require(p.column, 1, static_cast<std::size_t>(size));
      require(p.place, 1, room);
    }
    require(0, static_cast<int>(pivots_.size()), end);
  }

  bool symmetric_;
  int factors_;
  std::vector<static_factor::Step> steps_;
  std::vector<static_factor::Sweep> sweeps_;
  std::vector<static_factor::Entry> entries_;
  std::vector<static_factor::Pivot> pivots_;
  std::vector<int> targets_, others_;
  mutable std::vector<double> room_;  ///< four numbers a tile
};

}  // namespace cutjoint::interpreter
