// Inputs over the time of a run, and what changes with their numbers.
#pragma once

#include <limits>

#include "cutjoint/core/numbers/arrays.hpp"
#include "cutjoint/core/inputs/inputs.hpp"

namespace cutjoint {

/// An input over time in pieces that begin at `times`; the first one also holds before. Each has the value and its first three derivatives at its beginning.
/// If it `jumps` between pieces, steps end at these times and restart.
struct InputTrajectory {
  int input = 0, jumps = 0;
  long pieces = 0;
  const double *times = nullptr, *numbers = nullptr;
  const double* changes = nullptr;  ///< of these numbers along seeds (seeds, pieces, 4)
  double* derivatives = nullptr;         ///< of objectives with respect to these numbers (objectives, pieces, 4)
};

/// Trajectories of at most `n` inputs.  Within a substep the piece of its beginning holds from there on, and the piece of its end up to there.
template <std::size_t n>
class InputTrajectories {
 public:
  static constexpr std::size_t orders = 4;

  /// Which numbers of trajectories depend on the seeds.
  enum class Seeded { nothing, changes, piece };

  std::size_t number() const { return number_; }

  /// Whether the input of one satisfies a condition.
  bool any_of(auto is) const {
    return std::any_of(trajectories_.begin(), trajectories_.begin() + number_, [is](const InputTrajectory& x) { return is(static_cast<std::size_t>(x.input)); });
  }

  void clear() { number_ = 0; }

  void add(const InputTrajectory& trajectory) {
    pieces_[number_] = 0;
    trajectories_[number_++] = trajectory;
  }

  /// Begin a run at a time, with steps of length dt.
  void begin(double t, double dt) {
    select_pieces_within(t, std::numeric_limits<double>::infinity());
    rounding_ = 1e-9 * dt;
    jumps_ = false;
    seeded_ = Seeded::nothing;
  }

  /// Begin a substep; return whether an input trajectory may jump there.
  bool begin_substep(double t) {
    select_pieces_within(t, std::numeric_limits<double>::infinity());
    jumps_ = false;
    for (std::size_t i = 0; i < number_; ++i) {
      const std::size_t now = find(i, t);
      jumps_ = jumps_ || (trajectories_[i].jumps && now > 0 && trajectories_[i].times[now] > t - rounding_);
    }
    return jumps_;
  }

  /// The time of the next possible jump, or infinity.
  double next_jump() const {
    double next = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < number_; ++i)
      if (trajectories_[i].jumps && pieces_[i] + 1 < static_cast<std::size_t>(trajectories_[i].pieces)) next = std::min(next, trajectories_[i].times[pieces_[i] + 1]);
    return next;
  }

  void end_substep(double until) { until_ = until; }

  /// Whether the substep that begins at this time restarted with new accelerations.
  bool begins_anew(double t) const { return jumps_ && t == from_; }

  /// Select the pieces of a substep; a time by itself belongs to the substep that ends there.
  void select_pieces_within(double from, double until) {
    from_ = from;
    until_ = until;
  }
  void select_pieces_until(double t) { select_pieces_within(-std::numeric_limits<double>::infinity(), t); }

  /// Fill in value, rate and acceleration of each at a time.
  void fill(double t, double* input) {
    for (std::size_t i = 0; i < number_; ++i) {
      const InputTrajectory& trajectory = trajectories_[i];
      since_[i] = t - trajectory.times[find(i, t)];
      evaluate(trajectory.numbers + orders * pieces_[i], since_[i], [&](std::size_t order, double x) { input[place(trajectory) + order] = x; });
    }
  }

  /// The third derivative, at the time last filled in, of the input at this index of the array; a null pointer without a trajectory.
  const double* jerk(std::size_t at) const {
    for (std::size_t i = 0; i < number_; ++i)
      if (place(trajectories_[i]) == at) return trajectories_[i].numbers + orders * pieces_[i] + 3;
    return nullptr;
  }

  /// Let seeds be those of the host, or the numbers of one piece.
  void change_seeds(Seeded seeded) { seeded_ = seeded; }
  void change_piece(std::size_t trajectory, std::size_t piece) {
    seeded_ = Seeded::piece;
    trajectory_ = trajectory;
    piece_ = piece;
  }

  /// Add derivatives of inputs, at the time last filled in, along seeds from `first` on.
  void add_changes(std::size_t first, std::size_t number, auto& du) const {
    if (seeded_ == Seeded::piece) {
      for (std::size_t k = 0; k < number && pieces_[trajectory_] == piece_; ++k) {
        double unit[orders] = {};
        unit[k] = 1.0;
        evaluate(unit, since_[trajectory_], [&](std::size_t order, double x) { du[place(trajectories_[trajectory_]) + order].derivative[k] += x; });
      }
    } else if (seeded_ == Seeded::changes) {
      for (std::size_t i = 0; i < number_; ++i)
        for (std::size_t k = 0; k < number && trajectories_[i].changes; ++k) {
          const double* const row = trajectories_[i].changes + orders * ((first + k) * static_cast<std::size_t>(trajectories_[i].pieces) + pieces_[i]);
          evaluate(row, since_[i], [&](std::size_t order, double x) { du[place(trajectories_[i]) + order].derivative[k] += x; });
        }
    }
  }

  /// From derivatives of an objective with respect to inputs, at the time last filled in, add those with respect to numbers of trajectories.
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

  /// Derivatives of an objective with respect to the numbers of a piece.
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

  static void evaluate(const double* x, double since, auto put) {
    put(0, x[0] + since * (x[1] + since / 2 * (x[2] + since / 3 * x[3])));
    put(1, x[1] + since * (x[2] + since / 2 * x[3]));
    put(2, x[2] + since * x[3]);
  }

  std::size_t number_ = 0;
  Fixed<InputTrajectory, n> trajectories_;
  Fixed<std::size_t, n> pieces_;  ///< at the time last filled in
  Fixed<double, n> since_;        ///< their beginning
  double from_ = 0.0, until_ = 0.0, rounding_ = 0.0;
  bool jumps_ = false;
  Seeded seeded_ = Seeded::nothing;
  std::size_t trajectory_ = 0, piece_ = 0;
};

}  // namespace cutjoint
