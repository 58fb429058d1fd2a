// In which of their formulas forces, guides and drives are, and when they leave them.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <limits>
#include <span>
#include <utility>

#include "cutjoint/core/numbers/arrays.hpp"
#include "cutjoint/core/mechanism/mechanism.hpp"
#include "cutjoint/core/roads/road.hpp"

namespace cutjoint::stepping {

/// The cell of each indicator: between which of its levels its value stands.  Zero is the level of a condition; breaks are those of a road.
///
/// A cell is left when the value is beyond its bounds by more than rounding; where, is then sought without regard to rounding.  A value
/// that stands on a level when a regime begins has no cell until it is off it.  Rounding is that of the value where a step begins, small
/// near a level, and a few units of the largest value seen: its terms may cancel there.  A step counts four times as much as the one
/// before, since ratios such as a tyre's slip by its load are without bound for a moment.
template <class M>
class IndicatorCells {
  template <class T>
  using Indicators = Array<M, static_sizes<M>().indicators, T>;

 public:
  using Real = typename M::real_type;

  /// Whether there can be any indicators.
  static constexpr bool has_indicators = !Sized<M> || static_sizes<M>().indicators > 0;

  /// Whether there are indicators at whose zeros forces only get another derivative.
  static constexpr bool has_continuous = [] {
    if constexpr (!Sized<M>) return false;
    else return std::any_of(std::begin(M::indicators), std::end(M::indicators), [](const IndicatorPlace& place) { return place.is_continuous; });
  }();

  /// `roads` are those of the tyres.
  IndicatorCells(IndicatorPlaces<M> places, const Road<Real>* roads) : places_(std::move(places)), roads_(roads), now_(places_.size()), shift_(places_.size()) {}

  std::size_t size() const { return places_.size(); }
  bool empty() const { return places_.empty(); }

  /// Where the mechanism puts the values of a state.
  Real* values() { return now_.values.data(); }

  /// The regime of the present values begins.
  void adopt() {
    for (std::size_t i = 0; i < now_.cells.size(); ++i) {
      if (places_[i].road >= 0) now_.sides[i] = places_[i].across >= 0 ? now_.values[static_cast<std::size_t>(places_[i].across)] : Real(0);
      weigh(i);
      enter(i, now_.sought[i] && is_out(i, Real(0)) ? cell_of(i) : decided_cell_of(i));
      now_.sought[i] = 0;
    }
    now_.start = now_.values;
  }

  /// Values on a level when the regime began belong to the cell in which they stand now; the next attempt starts here.
  void advance() {
    for (std::size_t i = 0; i < now_.cells.size(); ++i) {
      weigh(i);
      if (now_.cells[i] == undecided) enter(i, decided_cell_of(i));
    }
    now_.start = now_.values;
  }

  /// Seek the indicators that the present values have out of their cells; whether there are any.
  bool seek() {
    using std::abs;
    for (std::size_t i = 0; i < now_.cells.size(); ++i) {
      now_.sought[i] = is_out(i, now_.noise[i]);
      shift_[i] = std::max(abs(now_.values[i] - now_.start[i]), std::numeric_limits<Real>::min());
    }
    return std::find(now_.sought.begin(), now_.sought.end(), 1) != now_.sought.end();
  }

  /// Whether an indicator is one of those sought, and out of its cell.
  bool is_sought_out(std::size_t i) const { return now_.sought[i] && is_out(i, Real(0)); }

  /// The first of those sought that is out of its cell; as many as there are if none is.
  std::size_t found() const {
    std::size_t i = 0;
    while (i < now_.cells.size() && !is_sought_out(i)) ++i;
    return i;
  }

  bool is_continuous(std::size_t i) const { return i < places_.size() && places_[i].is_continuous; }

  /// How many of those sought are out of their cells.
  std::size_t count_out() const {
    std::size_t count = 0;
    for (std::size_t i = 0; i < now_.cells.size(); ++i) count += is_sought_out(i);
    return count;
  }

  /// How far the indicators sought are out of their cells at most, in shares of their ways from the start to where they were sought; negative where all
  /// are inside.  Indicators that meet the ends of their cells together, in whatever units, so are smooth there.
  Real beyond() const {
    Real most = -std::numeric_limits<Real>::infinity();
    for (std::size_t i = 0; i < now_.cells.size(); ++i)
      if (now_.sought[i]) most = std::max(most, std::max(now_.values[i] - now_.upper[i], now_.lower[i] - now_.values[i]) / shift_[i]);
    return most;
  }

  /// An attempt of a step from t begins.
  void begin(Real t) {
    now_.previous = now_.start;
    now_.previous_time = t;
    now_.crossing = std::numeric_limits<Real>::infinity();
  }

  /// Visual whether the attempt leaves the regime up to t, with the present values.
  void look(Real t) {
    if (crossed()) return;
    for (std::size_t i = 0; i < now_.cells.size(); ++i)
      if (is_reached(i))
        if (const Real crossing = crossing_of(i, t); crossing < now_.crossing) {
          now_.crossing = crossing;
          now_.first = i;
        }
  }

  /// The present values are those of a stage at t, from which the next one is looked at.
  void pass(Real t) {
    now_.previous = now_.values;
    now_.previous_time = t;
  }

  /// Whether the attempt was seen out of the regime.
  bool crossed() const { return now_.crossing < std::numeric_limits<Real>::infinity(); }

  /// About when the regime was left.
  Real crossing() const { return now_.crossing; }

  /// The indicator by which it was left.
  std::size_t first() const { return now_.first; }

  /// Memory of the next steps.
  struct Memory {
    Indicators<int> cells;
    Indicators<unsigned char> sought;
    Indicators<Real> sides, values, start, previous, largest, noise;  ///< the first: places across the road, where it has one
    Indicators<Real> lower, upper;                                    ///< the levels at which cells end
    Real previous_time{0}, crossing{0};
    std::size_t first = 0;

    explicit Memory(std::size_t n) : cells(n, undecided), sought(n), sides(n), values(n), start(n), previous(n), largest(n), noise(n),
        lower(n, -unbounded), upper(n, unbounded) {}
  };

  const Memory& memory() const { return now_; }
  void restore(const Memory& memory) { now_ = memory; }

 private:
  static constexpr int undecided = -1;
  static constexpr Real unbounded = std::numeric_limits<Real>::infinity();
  static constexpr Real zero[1] = {Real(0)};

  /// Bound the change of a value by rounding until the next step begins.
  void weigh(std::size_t i) {
    using std::abs;
    now_.largest[i] = std::max(now_.largest[i] / 4, abs(now_.values[i]));
    now_.noise[i] = std::numeric_limits<Real>::epsilon() * std::max(4096 * std::max(Real(1), abs(now_.values[i])), 4 * now_.largest[i]);
  }

  std::span<const Real> levels(std::size_t i) const {
    return places_[i].road < 0 ? std::span<const Real>(zero) : roads_[places_[i].road].breaks(now_.sides[i]);
  }

  /// The number of levels up to the value.
  int cell_of(std::size_t i) const {
    return static_cast<int>(std::upper_bound(levels(i).begin(), levels(i).end(), now_.values[i]) - levels(i).begin());
  }

  int decided_cell_of(std::size_t i) const {
    const auto cell = static_cast<std::size_t>(cell_of(i));
    const bool on_next = cell < levels(i).size() && levels(i)[cell] - now_.values[i] <= now_.noise[i];
    const bool on_last = cell > 0 && now_.values[i] - levels(i)[cell - 1] <= now_.noise[i];
    return on_next || on_last ? undecided : static_cast<int>(cell);
  }

  /// A indicator gets a cell, and the levels at which it ends.
  void enter(std::size_t i, int cell) {
    const auto number = static_cast<std::size_t>(cell);
    const bool bounded = cell != undecided;
    now_.cells[i] = cell;
    now_.lower[i] = bounded && cell > 0 ? levels(i)[number - 1] : -unbounded;
    now_.upper[i] = bounded && number < levels(i).size() ? levels(i)[number] : unbounded;
  }

  bool is_above(std::size_t i, Real by) const { return now_.values[i] - now_.upper[i] > by; }
  bool is_out(std::size_t i, Real by) const { return is_above(i, by) || now_.lower[i] - now_.values[i] > by; }

  /// Whether a stage meets the end of its cell: where the start was clear of it, as soon as rounding may take it for the other side.
  bool is_reached(std::size_t i) {
    if (!is_out(i, -now_.noise[i])) return false;
    std::swap(now_.values[i], now_.start[i]);
    const bool clear = !is_out(i, -now_.noise[i]);
    std::swap(now_.values[i], now_.start[i]);
    return clear || is_out(i, now_.noise[i]);
  }

  /// Where the straight line from the stage before to this one leaves the cell.
  Real crossing_of(std::size_t i, Real t) const {
    const Real level = is_above(i, -now_.noise[i]) ? now_.upper[i] : now_.lower[i];
    const Real share = (level - now_.previous[i]) / (now_.values[i] - now_.previous[i]);
    return now_.previous_time + (share > Real(0) ? std::min(share, Real(1)) : Real(0)) * (t - now_.previous_time);
  }

  IndicatorPlaces<M> places_;
  const Road<Real>* roads_;
  Memory now_;
  Indicators<Real> shift_;  ///< of each value from where the step began to where indicators were sought
};

}  // namespace cutjoint::stepping
