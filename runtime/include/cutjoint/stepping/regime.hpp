// In which of their formulas forces, guides and drives are, and when they leave them.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <vector>

#include "cutjoint/mechanism.hpp"
#include "cutjoint/core/road.hpp"

namespace cutjoint::stepping {

/// The cell of each switch: between which of its levels its value stands.  Zero is the level of a condition; breaks are those of a road.
///
/// A cell is left when the value is beyond its bounds by more than rounding; where, is then sought without regard to rounding.  A value that
/// stands on a level when a regime begins has no cell until it is off it.  Rounding is that of the value where a step begins, which is small
/// near a level, and a few units of the largest value seen, whose terms may cancel there; a step counts four times as much as the one before,
/// since ratios such as a tyre's slip by its load are without bound for a moment.
template <class Real>
class Regime {
 public:
  Regime(const std::vector<Switch>& switches, const std::vector<Road<Real>>& roads)
      : switches_(switches), roads_(roads), levels_(switches.size(), zero), cells_(switches.size(), undecided),
        sought_(switches.size(), false), values_(switches.size()), start_(values_), previous_(values_), largest_(values_), noise_(values_) {}

  bool empty() const { return switches_.empty(); }

  /// Where the mechanism puts the values of a state.
  Real* values() { return values_.data(); }

  /// The regime of the present values begins.
  void adopt() {
    for (std::size_t i = 0; i < cells_.size(); ++i) {
      if (const auto [element, place, road, across] = switches_[i]; road >= 0)
        levels_[i] = roads_[static_cast<std::size_t>(road)].breaks(across >= 0 ? values_[static_cast<std::size_t>(across)] : Real(0));
      weigh(i);
      cells_[i] = sought_[i] && is_out(i, Real(0)) ? cell_of(i) : decided_cell_of(i);
      sought_[i] = false;
    }
    start_ = values_;
  }

  /// Values on a level when the regime began belong to the cell in which they stand now; the next attempt starts here.
  void advance() {
    for (std::size_t i = 0; i < cells_.size(); ++i) {
      weigh(i);
      if (cells_[i] == undecided) cells_[i] = decided_cell_of(i);
    }
    start_ = values_;
  }

  /// Seek the switches that the present values have out of their cells; whether there are any.
  bool seek() {
    for (std::size_t i = 0; i < cells_.size(); ++i) sought_[i] = is_out(i, noise_[i]);
    return std::find(sought_.begin(), sought_.end(), true) != sought_.end();
  }

  /// The first of those sought that is out of its cell; as many as there are if none is.
  std::size_t found() const {
    std::size_t i = 0;
    while (i < cells_.size() && !(sought_[i] && is_out(i, Real(0)))) ++i;
    return i;
  }

  /// How far the switches sought are out of their cells at most; negative where all are inside.
  Real beyond() const {
    Real most = -std::numeric_limits<Real>::infinity();
    for (std::size_t i = 0; i < cells_.size(); ++i) {
      if (!sought_[i] || cells_[i] == undecided) continue;
      const auto cell = static_cast<std::size_t>(cells_[i]);
      if (cell < levels(i).size()) most = std::max(most, values_[i] - levels(i)[cell]);
      if (cell > 0) most = std::max(most, levels(i)[cell - 1] - values_[i]);
    }
    return most;
  }

  /// An attempt of a step from t begins.
  void begin(Real t) {
    previous_ = start_;
    previous_time_ = t;
    crossing_ = std::numeric_limits<Real>::infinity();
  }

  /// Look whether the attempt leaves the regime up to t, with the present values.
  void look(Real t) {
    if (crossed()) return;
    for (std::size_t i = 0; i < cells_.size(); ++i)
      if (is_reached(i))
        if (const Real crossing = crossing_of(i, t); crossing < crossing_) {
          crossing_ = crossing;
          first_ = i;
        }
  }

  /// The present values are those of a stage at t, from which the next one is looked at.
  void pass(Real t) {
    previous_ = values_;
    previous_time_ = t;
  }

  /// Whether the attempt was seen out of the regime.
  bool crossed() const { return crossing_ < std::numeric_limits<Real>::infinity(); }

  /// About when the regime was left.
  Real crossing() const { return crossing_; }

  /// The switch by which it was left.
  std::size_t first() const { return first_; }

  const Switch& operator[](std::size_t i) const { return switches_[i]; }

 private:
  static constexpr int undecided = -1;
  static inline const Real zero[1] = {Real(0)};

  /// What rounding may do to a value until the next step begins.
  void weigh(std::size_t i) {
    using std::abs;
    largest_[i] = std::max(largest_[i] / 4, abs(values_[i]));
    noise_[i] = std::numeric_limits<Real>::epsilon() * std::max(4096 * std::max(Real(1), abs(values_[i])), 4 * largest_[i]);
  }

  std::span<const Real> levels(std::size_t i) const { return levels_[i]; }

  /// The number of levels up to the value.
  int cell_of(std::size_t i) const {
    return static_cast<int>(std::upper_bound(levels(i).begin(), levels(i).end(), values_[i]) - levels(i).begin());
  }

  int decided_cell_of(std::size_t i) const {
    const auto cell = static_cast<std::size_t>(cell_of(i));
    const bool on_next = cell < levels(i).size() && levels(i)[cell] - values_[i] <= noise_[i];
    const bool on_last = cell > 0 && values_[i] - levels(i)[cell - 1] <= noise_[i];
    return on_next || on_last ? undecided : static_cast<int>(cell);
  }

  bool is_above(std::size_t i, Real by) const {
    const auto cell = static_cast<std::size_t>(cells_[i]);
    return cell < levels(i).size() && values_[i] - levels(i)[cell] > by;
  }

  bool is_out(std::size_t i, Real by) const {
    if (cells_[i] == undecided) return false;
    const auto cell = static_cast<std::size_t>(cells_[i]);
    return is_above(i, by) || (cell > 0 && levels(i)[cell - 1] - values_[i] > by);
  }

  /// Whether a stage meets the end of its cell: where the start was clear of it, as soon as rounding may take it for the other side.
  bool is_reached(std::size_t i) {
    if (!is_out(i, -noise_[i])) return false;
    std::swap(values_[i], start_[i]);
    const bool clear = !is_out(i, -noise_[i]);
    std::swap(values_[i], start_[i]);
    return clear || is_out(i, noise_[i]);
  }

  /// Where the straight line from the stage before to this one leaves the cell.
  Real crossing_of(std::size_t i, Real t) const {
    const auto cell = static_cast<std::size_t>(cells_[i]);
    const Real level = is_above(i, -noise_[i]) ? levels(i)[cell] : levels(i)[cell - 1];
    const Real share = (level - previous_[i]) / (values_[i] - previous_[i]);
    return previous_time_ + (share > Real(0) ? std::min(share, Real(1)) : Real(0)) * (t - previous_time_);
  }

  const std::vector<Switch>& switches_;
  const std::vector<Road<Real>>& roads_;
  std::vector<std::span<const Real>> levels_;
  std::vector<int> cells_;
  std::vector<bool> sought_;
  std::vector<Real> values_, start_, previous_, largest_, noise_;
  Real previous_time_{0}, crossing_{0};
  std::size_t first_ = 0;
};

}  // namespace cutjoint::stepping
