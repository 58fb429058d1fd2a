// Inputs over the time of a run, and what changes with their numbers.
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>

#include "cutjoint/core/numbers/arrays.hpp"
#include "cutjoint/core/inputs/inputs.hpp"

namespace cutjoint {

/// An input over time in pieces that begin at `times`, the first of which holds before, too: of each the value and its first three derivatives where it begins.
/// Where it `jumps` from piece to piece, steps end at these times and begin anew.
struct InputTrajectory {
  int input = 0, jumps = 0;
  long pieces = 0;
  const double *times = nullptr, *numbers = nullptr;
  const double* changes = nullptr;  ///< of these numbers along directions (directions, pieces, 4)
  double* derivatives = nullptr;         ///< of objectives by these numbers (objectives, pieces, 4)
};

/// Courses of inputs, `n` at most.  Within a part of a step the piece where it begins holds from its beginning on, and the piece where it ends to its end.
template <std::size_t n>
class InputTrajectories {
 public:
  static constexpr std::size_t orders = 4;

  /// What numbers of trajectories change along directions.
  enum class Along { nothing, changes, piece };

  std::size_t number() const { return number_; }

  /// Whether the input of one is such.
  template <class Is>
  bool any_of(Is is) const {
    return std::any_of(trajectories_.begin(), trajectories_.begin() + number_, [is](const InputTrajectory& x) { return is(static_cast<std::size_t>(x.input)); });
  }

  void clear() { number_ = 0; }

  void add(const InputTrajectory& trajectory) {
    pieces_[number_] = 0;
    trajectories_[number_++] = trajectory;
  }

  /// A run begins at a time, with steps of a length.
  void begin(double t, double dt) {
    be_within(t, std::numeric_limits<double>::infinity());
    rounding_ = 1e-9 * dt;
    jumps_ = false;
    along_ = Along::nothing;
  }

  /// A part of a step begins; whether an input trajectory may jump there.
  bool begin_part(double t) {
    be_within(t, std::numeric_limits<double>::infinity());
    jumps_ = false;
    for (std::size_t i = 0; i < number_; ++i) {
      const std::size_t now = find(i, t);
      jumps_ = jumps_ || (trajectories_[i].jumps && now > 0 && trajectories_[i].times[now] > t - rounding_);
    }
    return jumps_;
  }

  /// Where one may jump next, infinity where none does.
  double next_jump() const {
    double next = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < number_; ++i)
      if (trajectories_[i].jumps && pieces_[i] + 1 < static_cast<std::size_t>(trajectories_[i].pieces)) next = std::min(next, trajectories_[i].times[pieces_[i] + 1]);
    return next;
  }

  void end_part(double until) { until_ = until; }

  /// Whether accelerations were found anew at a time, where the present part begins.
  bool begins_anew(double t) const { return jumps_ && t == from_; }

  /// Be in a part of a step; a time by itself belongs to the part that ends there.
  void be_within(double from, double until) {
    from_ = from;
    until_ = until;
  }
  void be_behind(double t) { be_within(-std::numeric_limits<double>::infinity(), t); }

  /// Value, rate and acceleration of each at a time, among those of all inputs.
  void fill(double t, double* input) {
    for (std::size_t i = 0; i < number_; ++i) {
      const InputTrajectory& trajectory = trajectories_[i];
      since_[i] = t - trajectory.times[find(i, t)];
      evaluate(trajectory.numbers + orders * pieces_[i], since_[i], [&](std::size_t order, double x) { input[place(trajectory) + order] = x; });
    }
  }

  /// The third derivative of the input at a place among numbers of inputs, where it was filled in last; a null pointer without an input trajectory.
  const double* jerk(std::size_t at) const {
    for (std::size_t i = 0; i < number_; ++i)
      if (place(trajectories_[i]) == at) return trajectories_[i].numbers + orders * pieces_[i] + 3;
    return nullptr;
  }

  /// Directions from one on, so many, are those of the host, or the numbers of one piece.
  void change_along(Along along) { along_ = along; }
  void change_piece(std::size_t trajectory, std::size_t piece) {
    along_ = Along::piece;
    trajectory_ = trajectory;
    piece_ = piece;
  }

  /// Add how inputs change along directions from one on where they were filled in last.
  template <class Numbers>
  void add_changes(std::size_t first, std::size_t number, Numbers& du) const {
    if (along_ == Along::piece) {
      for (std::size_t k = 0; k < number && pieces_[trajectory_] == piece_; ++k) {
        double unit[orders] = {};
        unit[k] = 1.0;
        evaluate(unit, since_[trajectory_], [&](std::size_t order, double x) { du[place(trajectories_[trajectory_]) + order].derivative[k] += x; });
      }
    } else if (along_ == Along::changes) {
      for (std::size_t i = 0; i < number_; ++i)
        for (std::size_t k = 0; k < number && trajectories_[i].changes; ++k) {
          const double* const row = trajectories_[i].changes + orders * ((first + k) * static_cast<std::size_t>(trajectories_[i].pieces) + pieces_[i]);
          evaluate(row, since_[i], [&](std::size_t order, double x) { du[place(trajectories_[i]) + order].derivative[k] += x; });
        }
    }
  }

  /// Add derivatives of an objective by inputs where they were filled in last to those by numbers of trajectories.
  void vjp(std::size_t objective, const double* by_input) const {
    for (std::size_t i = 0; i < number_; ++i) {
      const double *by = by_input + place(trajectories_[i]), since = since_[i];
      double* const derivatives = derivatives_of(objective, i, pieces_[i]);
      if (!derivatives) continue;
      derivatives[0] += by[0];
      derivatives[1] += by[1] + since * by[0];
      derivatives[2] += by[2] + since * (by[1] + since / 2 * by[0]);
      derivatives[3] += since * (by[2] + since / 2 * (by[1] + since / 3 * by[0]));
    }
  }

  /// Derivatives of an objective by the numbers of a piece.
  double* derivatives_of(std::size_t objective, std::size_t trajectory, std::size_t piece) const {
    const InputTrajectory& x = trajectories_[trajectory];
    return x.derivatives ? x.derivatives + orders * (objective * static_cast<std::size_t>(x.pieces) + piece) : nullptr;
  }

  void clear_derivatives(std::size_t objective) const {
    for (std::size_t i = 0; i < number_; ++i)
      if (double* const derivatives = derivatives_of(objective, i, 0)) std::fill_n(derivatives, orders * static_cast<std::size_t>(trajectories_[i].pieces), 0.0);
  }

  /// The piece of an input trajectory at a time.
  std::size_t find(std::size_t trajectory, double t) {
    const InputTrajectory& x = trajectories_[trajectory];
    const double at = t <= from_ + rounding_ ? from_ + rounding_ : t >= until_ - rounding_ ? until_ - rounding_ : t;
    std::size_t& piece = pieces_[trajectory];
    while (piece + 1 < static_cast<std::size_t>(x.pieces) && x.times[piece + 1] <= at) ++piece;
    while (piece > 0 && x.times[piece] > at) --piece;
    return piece;
  }

 private:
  static std::size_t place(const InputTrajectory& trajectory) { return numbers_per_input * static_cast<std::size_t>(trajectory.input); }

  template <class Put>
  static void evaluate(const double* x, double since, Put put) {
    put(0, x[0] + since * (x[1] + since / 2 * (x[2] + since / 3 * x[3])));
    put(1, x[1] + since * (x[2] + since / 2 * x[3]));
    put(2, x[2] + since * x[3]);
  }

  std::size_t number_ = 0;
  Fixed<InputTrajectory, n> trajectories_;
  Fixed<std::size_t, n> pieces_;  ///< that hold where inputs were filled in last
  Fixed<double, n> since_;        ///< their beginning
  double from_ = 0.0, until_ = 0.0, rounding_ = 0.0;
  bool jumps_ = false;
  Along along_ = Along::nothing;
  std::size_t trajectory_ = 0, piece_ = 0;
};

}  // namespace cutjoint
