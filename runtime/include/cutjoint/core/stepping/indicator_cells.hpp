// Modes of forces, guides and drives: which of their formulas are in force, and when that changes.
#pragma once

#include <iterator>

#include "cutjoint/core/mechanism/mechanism.hpp"
#include "cutjoint/core/roads/road.hpp"

namespace cutjoint::stepping {

/// The cell of each indicator: the interval between two of its levels that contains its value. Levels are zeros of conditions and breaks of roads.
///
/// The cells together are the mode. A cell is left when the value passes its bounds by more than rounding; the time is then located without
/// that margin. A value that stands on a level when a mode begins has no cell until it moves off. Rounding is estimated from the value at
/// the start of the step, which is small near a level, and from the largest value seen, since its terms may cancel. A step weighs four
/// times as much as the one before, since ratios such as a tyre's slip over its load may be unbounded for a moment.
template <class M>
class IndicatorCells {
  template <class T>
  using Indicators = Array<M, static_sizes<M>().indicators, T>;

 public:
  using Real = typename M::real_type;

  /// Whether the model has indicators.
  static constexpr bool has_indicators = !Sized<M> || static_sizes<M>().indicators > 0;

  /// Whether some indicators mark points where forces are continuous but their derivatives are not.
  static constexpr bool has_continuous = [] {
    if constexpr (!Sized<M>) return false;
    else return std::any_of(std::begin(M::indicators), std::end(M::indicators), [](const IndicatorPlace& place) { return place.is_continuous; });
  }();

  /// `roads` are the roads of the tyres.
  IndicatorCells(IndicatorPlaces<M> places, const Road<Real>* roads) : places_(std::move(places)), roads_(roads), now_(places_.size()), shift_(places_.size()) {}

  std::size_t size() const { return places_.size(); }
  bool empty() const { return places_.empty(); }

  /// Where the mechanism stores the values for a state.
  Real* values() { return now_.values.data(); }

  /// Whether a value stands on a level, and has no cell yet.
  bool is_undecided() const { return std::find(now_.cells.begin(), now_.cells.end(), undecided) != now_.cells.end(); }

  /// Begin the mode of the present values.
  void adopt() {
    for (std::size_t i = 0; i < now_.cells.size(); ++i) {
      if (places_[i].road >= 0) now_.sides[i] = places_[i].across >= 0 ? now_.values[static_cast<std::size_t>(places_[i].across)] : Real(0);
      weigh(i);
      enter(i, now_.sought[i] && is_out(i, Real(0)) ? cell_of(i) : decided_cell_of(i));
      now_.sought[i] = 0;
    }
    now_.start = now_.values;
  }

  /// Assign cells to values that stood on a level when the mode began; the next attempt starts here.
  void advance() {
    for (std::size_t i = 0; i < now_.cells.size(); ++i) {
      weigh(i);
      if (now_.cells[i] == undecided) enter(i, decided_cell_of(i));
    }
    now_.start = now_.values;
  }

  /// Collect the indicators whose present values have left their cells; return whether there are any.
  bool seek() {
    using std::abs;
    for (std::size_t i = 0; i < now_.cells.size(); ++i) {
      now_.sought[i] = is_out(i, now_.noise[i]);
      shift_[i] = std::max(abs(now_.values[i] - now_.start[i]), std::numeric_limits<Real>::min());
    }
    return std::find(now_.sought.begin(), now_.sought.end(), 1) != now_.sought.end();
  }

  /// Whether an indicator is sought and has left its cell.
  bool is_sought_out(std::size_t i) const { return now_.sought[i] && is_out(i, Real(0)); }

  /// The first sought indicator that has left its cell; the number of indicators if there is none.
  std::size_t found() const {
    std::size_t i = 0;
    while (i < now_.cells.size() && !is_sought_out(i)) ++i;
    return i;
  }

  bool is_continuous(std::size_t i) const { return i < places_.size() && places_[i].is_continuous; }

  /// How many sought indicators have left their cells.
  std::size_t count_out() const {
    std::size_t count = 0;
    for (std::size_t i = 0; i < now_.cells.size(); ++i) count += is_sought_out(i);
    return count;
  }

  /// By how much sought indicators have left their cells at most, relative to their change since the start; negative if none has. Smooth if several leave together.
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

  /// Return whether the attempt leaves the mode up to t, with the present values.
  void look(Real t) {
    if (crossed()) return;
    for (std::size_t i = 0; i < now_.cells.size(); ++i)
      if (is_reached(i))
        if (const Real crossing = crossing_of(i, t); crossing < now_.crossing) {
          now_.crossing = crossing;
          now_.first = i;
        }
  }

  /// The present values are those of a stage at t, from which the next stage is checked.
  void pass(Real t) {
    now_.previous = now_.values;
    now_.previous_time = t;
  }

  /// Whether the attempt has left the mode.
  bool crossed() const { return now_.crossing < std::numeric_limits<Real>::infinity(); }

  /// Estimated time at which the mode was left.
  Real crossing() const { return now_.crossing; }

  /// The indicator that ended the mode.
  std::size_t first() const { return now_.first; }

  /// Memory for the next steps.
  struct Memory {
    Indicators<int> cells;
    Indicators<unsigned char> sought;
    Indicators<Real> sides, values, start, previous, largest, noise;  ///< `sides`: lateral positions on the road, if it has a profile on each side
    Indicators<Real> lower, upper;                                    ///< bounds of the cells
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

  /// Bound the rounding error of a value until the next step begins.
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

  /// Assign a cell to an indicator, with the levels that bound it.
  void enter(std::size_t i, int cell) {
    const auto number = static_cast<std::size_t>(cell);
    const bool bounded = cell != undecided;
    now_.cells[i] = cell;
    now_.lower[i] = bounded && cell > 0 ? levels(i)[number - 1] : -unbounded;
    now_.upper[i] = bounded && number < levels(i).size() ? levels(i)[number] : unbounded;
  }

  bool is_above(std::size_t i, Real by) const { return now_.values[i] - now_.upper[i] > by; }
  bool is_out(std::size_t i, Real by) const { return is_above(i, by) || now_.lower[i] - now_.values[i] > by; }

  /// Whether a stage reaches the end of its cell: from a start well inside, as soon as rounding may place it outside.  A value that has come near
  /// is not well inside: it may approach the level without end.
  bool is_reached(std::size_t i) {
    if (!is_out(i, -now_.noise[i])) return false;
    std::swap(now_.values[i], now_.start[i]);
    const bool clear = !is_out(i, -4 * now_.noise[i]);
    std::swap(now_.values[i], now_.start[i]);
    return clear || is_out(i, now_.noise[i]);
  }

  /// Where linear interpolation from the previous stage to this one leaves the cell.
  Real crossing_of(std::size_t i, Real t) const {
    const Real level = is_above(i, -now_.noise[i]) ? now_.upper[i] : now_.lower[i];
    const Real share = (level - now_.previous[i]) / (now_.values[i] - now_.previous[i]);
    return now_.previous_time + (share > Real(0) ? std::min(share, Real(1)) : Real(0)) * (t - now_.previous_time);
  }

  IndicatorPlaces<M> places_;
  const Road<Real>* roads_;
  Memory now_;
  Indicators<Real> shift_;  ///< change of each value from the start of the step to where indicators were sought
};

}  // namespace cutjoint::stepping
