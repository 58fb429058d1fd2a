// How accelerations change along directions, by the linearised balance of forces.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <utility>

#include "cutjoint/core/arrays.hpp"
#include "cutjoint/core/bordered.hpp"
#include "cutjoint/core/dual.hpp"
#include "cutjoint/core/inputs.hpp"
#include "cutjoint/core/retraction.hpp"
#include "cutjoint/core/stabilisation.hpp"

namespace cutjoint {

/// No balance of forces: accelerations are found over numbers with derivatives.
struct NoBalance {
  static constexpr bool is_there = false;
};

/// The balance of forces and the second rates of loops, r(q, v, vdot, lambda, inputs, parameters) = 0, of a mechanism M, by generated code C of its
/// slopes, whose places are those of T: where each row begins, where its slopes by accelerations and multipliers do, and their columns.  Parameters are
/// in it by values that follow from them alone, as many as are `loaded`.
///
/// At a state the slopes are found once, over plain numbers, and a matrix is decomposed once; each direction takes products and a solution.  Loops
/// give way to multipliers by a share of what their penalties let them, which further solutions take back: equations that depend on each other have the
/// multipliers to which the augmented update leads.  Two states are kept, where a step begins and where it ends.
template <class M, template <class> class C, class T>
class BalanceSlopes {
 public:
  static constexpr bool is_there = true;
  static constexpr std::size_t n = M::sizes.speeds, m = M::sizes.equations, coordinates = M::sizes.coordinates, inputs = numbers_per_input * M::sizes.inputs,
                               given = inputs + M::sizes.held, loaded = T::loaded;
  using Places = T;
  using Changes = Fixed<Along, n + m>;
  using Numbers = Fixed<double, n + m>;
  static constexpr std::size_t first_speed = coordinates, first_input = first_speed + n, first_held = first_input + inputs,
                               first_loaded = first_input + given, first_acceleration = first_loaded + loaded,
                               first_multiplier = first_acceleration + n, width = first_multiplier + m;
  static constexpr bool has_balls = coordinates > M::sizes.joint_speeds();
  using OfSlopes = Fixed<double, T::starts[n + m]>;  ///< by rows

  void drive_by([[maybe_unused]] const InputSource<double>& source) {
    if constexpr (given > 0) plain_.drive_by(source);
  }

  /// Parameters of a simulation as they are, which do not change along directions.
  template <class Simulation>
  void load(Simulation& simulation) {
    [[maybe_unused]] const auto& penalties = simulation.penalties();
    load_mechanism(plain_, simulation.parameters().data(), simulation.roads(), simulation.stabilisation(), penalties);
    for (At& x : at_) x.is_found = false;
    changes_.fill({});
    are_changing_ = false;
    for (std::size_t cut = 0, i = 0; i < m; ++i) {
      while (cut + 1 < M::sizes.cuts && static_cast<std::size_t>(M::cuts[cut + 1]) <= i) ++cut;
      gives_way_[i] = 1e-3 / penalties[cut];
    }
  }

  /// How they change.
  template <class Roads, class Penalties>
  void load_changes([[maybe_unused]] const Dual* parameters, [[maybe_unused]] const Roads* roads, [[maybe_unused]] const StabilisationSettings& stabilisation,
                    [[maybe_unused]] const Penalties& penalties) {
    if constexpr (loaded > 0) {
      const auto changes = [](const Dual& x) {
        double size = 0.0;
        for (std::size_t k = 0; k < directions; ++k) size += std::abs(x.slope[k]);
        return size > 0.0;
      };
      const bool were_changing = std::exchange(are_changing_, std::any_of(parameters, parameters + M::sizes.parameters, changes));
      if (!are_changing_ && !were_changing) return;
      Fixed<Dual, loaded> values;
      load_mechanism(with_changes_, parameters, roads, stabilisation, penalties);
      with_changes_.loaded_values(values.data());
      for (std::size_t i = 0; i < loaded; ++i) changes_[i].slope = values[i].slope;
    }
  }

  /// Go to a state, and find slopes where they are not kept.
  template <class Q, class V, class L, class Inputs>
  void find(double t, const Q& q, const V& v, const V& vdot, const L& lambda, const Inputs& u) {
    const auto is_same = [](const auto& a, const auto& b) { return std::equal(a.begin(), a.end(), b.begin()); };
    const auto is_here = [&](const At& x) {
      return x.is_found && x.t == t && is_same(q, x.q) && is_same(v, x.v) && is_same(vdot, x.vdot) && is_same(lambda, x.lambda) && is_same(u, x.u);
    };
    if (is_here(at_[now_])) return;
    now_ = 1 - now_;
    At& x = at_[now_];
    if (is_here(x)) return;
    x.is_found = true;
    x.t = t;
    std::copy(q.begin(), q.end(), x.q.begin());
    std::copy(v.begin(), v.end(), x.v.begin());
    std::copy(vdot.begin(), vdot.end(), x.vdot.begin());
    std::copy(lambda.begin(), lambda.end(), x.lambda.begin());
    std::copy(u.begin(), u.end(), x.u.begin());
    find(x, x.slope);
    x.decomposed_for = none;
  }

  /// The slopes at a state.
  template <class State>
  void find(const State& x, OfSlopes& slope) {
    plain_.begin_step(x.t, 1.0);
    plain_.balance_slopes(x.q.data(), x.v.data(), x.vdot.data(), x.lambda.data(), slope.data());
  }

  /// What the balance loses by changes of all but accelerations and multipliers, row by row.
  template <class Q, class V, class Inputs, class Held>
  void lose(const OfSlopes& slope, const Q& q, const V& v, const Inputs& du, const Held& held, Along* rows) {
    const auto put = [this](std::size_t first, const auto& numbers) {
      for (std::size_t j = 0; j < numbers.size(); ++j) by_[first + j] = numbers[j].slope;
    };
    put(0, q), put(first_speed, v), put(first_input, du), put(first_held, held), put(first_loaded, changes_);
    for (std::size_t i = 0; i < n + m; ++i) {
      Slopes sum{};
      for (std::size_t k = T::starts[i]; k < T::middles[i]; ++k) sum -= slope[k] * by_[T::columns[k]];
      rows[i].slope = sum;
    }
  }

  /// The solution of matrices over accelerations and multipliers, one behind another, in whose place loops give way to these; what they give way by is taken back.
  /// False where a number is none, or loops stay open.
  template <class Matrix, std::size_t size>
  bool solve(const Matrix& matrix, Fixed<Along, size>& change) const {
    matrix.solve(change);
    Slopes odd{};
    for (const Along& along : change) odd += 0.0 * along.slope;
    double sum = 0.0;
    for (std::size_t k = 0; k < directions; ++k) sum += odd[k];
    return sum == 0.0 && close(matrix, change);
  }

  /// How coordinates or speeds change least, as masses see it, so that gaps of loops close; false where they stay open.
  bool close_gaps(const Fixed<Dual, m>& gaps, Changes& change) {
    At& x = at_[now_];
    for (std::size_t i = 0; i < n; ++i) change[i] = {};
    for (std::size_t i = 0; i < m; ++i) change[n + i].slope = -gaps[i].slope;
    return decompose_plain(x) && solve(x.matrix, change);
  }

  /// The same of transposed matrices, of numbers.
  template <class Matrix, std::size_t size>
  bool solve_transposed(const Matrix& matrix, Fixed<double, size>& x) const {
    matrix.solve_transposed(x);
    Fixed<double, size> more = x;
    double before = std::numeric_limits<double>::infinity();
    for (int iteration = 0; m > 0 && iteration < 16; ++iteration) {
      double share[2]{}, whole[2]{};  // of what accelerations are multiplied by, and of what multipliers are
      for (std::size_t i = 0; i < size; ++i) more[i] *= i % (n + m) < n ? 0.0 : -gives_way_[i % (n + m) - n];
      matrix.solve_transposed(more);
      for (std::size_t i = 0; i < size; ++i) {
        x[i] += more[i];
        const std::size_t of = i % (n + m) < n ? 0 : 1;
        share[of] = std::max(share[of], std::abs(more[i])), whole[of] = std::max(whole[of], std::abs(x[i]));
      }
      const double left = std::max(share[0] / std::max(whole[0], 1e-300), share[1] / std::max(whole[1], 1e-300));
      if (left <= 1e-15 || !(left < before)) break;
      before = left;
    }
    return std::all_of(x.begin(), x.end(), [](double each) { return each - each == 0.0; });
  }

  /// Slopes by gaps of loops, which `close_gaps` has closed, from those by what that moves.
  bool pull_gaps(const Fixed<double, n>& by_move, Fixed<double, m>& by_gap) {
    Numbers x;
    std::copy(by_move.begin(), by_move.end(), x.begin());
    At& at = at_[now_];
    if (!decompose_plain(at) || !solve_transposed(at.matrix, x)) return false;
    for (std::size_t i = 0; i < m; ++i) by_gap[i] = -x[n + i];
    return true;
  }

  /// Slopes by all but accelerations and multipliers of what `lose` takes from rows, added to `by`.
  void pull(const OfSlopes& slope, const double* by_rows, Fixed<double, first_acceleration>& by) const {
    for (std::size_t i = 0; i < n + m; ++i)
      for (std::size_t k = T::starts[i]; k < T::middles[i]; ++k) by[T::columns[k]] -= slope[k] * by_rows[i];
  }

  /// How loaded values change along directions.
  const Fixed<Along, loaded>& changes() const { return changes_; }

  double gives_way(std::size_t equation) const { return gives_way_[equation]; }

  // Columns of coordinates: the speed by whose integral one changes, of a quaternion the first of three, whether it is of one, of which ball, and its place there.
  static constexpr std::size_t balls = coordinates - M::sizes.joint_speeds();
  static std::size_t unknown_of(std::size_t column) { return columns.unknown[column]; }
  static bool turns(std::size_t column) { return columns.turns[column]; }
  static std::array<std::size_t, 2> ball_of(std::size_t column) { return {columns.ball[column], columns.place[column]}; }

  /// How accelerations and multipliers change with all else; false where that is no number, or masses are singular.
  template <class Q, class V, class Inputs, class Held>
  bool solve(const Q& q, const V& v, const Inputs& du, const Held& held, Changes& change) {
    return decompose_plain(at_[now_]) && solve_end(q, v, du, held, change);
  }

  /// The same where they move the state, the end of a trapezoidal step that `decompose_end` has decomposed.
  template <class Q, class V, class Inputs, class Held>
  bool solve_end(const Q& q, const V& v, const Inputs& du, const Held& held, Changes& change) {
    At& x = at_[now_];
    lose(x.slope, q, v, du, held, change.data());
    return solve(x.matrix, change);
  }

  /// Decompose r_vdot + h/2 r_v + h^2/4 r_q of the end of a trapezoidal step, to which `delta` leads from coordinates; false where it is singular.
  bool decompose_end(double h, std::span<const Chart> charts, [[maybe_unused]] const double* from, [[maybe_unused]] const double* delta) {
    At& x = at_[now_];
    if (x.decomposed_for == h) return true;
    const double by_speed = h / 2, by_place = h * h / 4;
    Weights weights;
    std::fill_n(weights.of.begin() + first_speed, n, by_speed);
    for (const Chart& chart : charts) {
      const auto place = static_cast<std::size_t>(chart.q), scalars = static_cast<std::size_t>(chart.scalars);
      std::fill_n(weights.of.begin() + place, scalars, by_place);
      if constexpr (has_balls) {
        if (!chart.ball) continue;
        const auto at = static_cast<std::size_t>(chart.v);
        Dual e[4], theta[3], turned[4];
        for (std::size_t k = 0; k < 4; ++k) e[k] = from[place + scalars + k];
        for (std::size_t k = 0; k < 3; ++k) theta[k] = delta[at + scalars + k], theta[k].slope[k] = by_place;
        turn<Dual>(e, theta, turned);
        for (std::size_t k = 0; k < 3; ++k)
          for (std::size_t c = 0; c < 4; ++c) weights.turns[3 * (place + scalars + c) + k] = turned[c].slope[k];
      }
    }
    return decompose(x, h, weights);
  }

  /// Whether there is the matrix of the end of a step of this length, from which `correct` goes on.
  bool knows(double h) const { return at_[now_].decomposed_for == h; }

  /// Accelerations that are off by this from those to which they lead: the correction takes its place, and that of multipliers is `pull`.
  void correct(Fixed<double, n>& left, Fixed<double, m>& pull) {
    At& x = at_[now_];
    Numbers force;
    for (std::size_t i = 0; i < n + m; ++i)
      for (std::size_t k = T::middles[i]; k < T::starts[i + 1]; ++k)
        if (T::columns[k] < first_multiplier) force[i] += x.slope[k] * left[T::columns[k] - first_acceleration];
    x.matrix.solve(force);
    std::copy_n(force.begin(), n, left.begin());
    std::copy_n(force.begin() + n, m, pull.begin());
  }

 private:
  static constexpr double none = -1.0;

  /// The matrix of a step's end from slopes: the share of each by its column, and of quaternions by each of three speeds.
  struct Weights {
    Weights() { std::fill_n(of.begin() + first_acceleration, n + m, 1.0); }

    Fixed<double, width> of;
    Fixed<double, has_balls ? 3 * coordinates : 0> turns;
  };

  /// Of each column the unknown by whose change it changes, of a quaternion the first of three, and whether it is one.
  struct Columns {
    std::array<std::uint16_t, width> unknown{};
    std::array<bool, width> turns{};
    std::array<std::uint16_t, coordinates> ball{}, place{};

    constexpr Columns() {
      std::uint16_t balls_before = 0;
      for (std::size_t i = 0; i < n; ++i) unknown[first_speed + i] = static_cast<std::uint16_t>(i);
      for (std::size_t i = 0; i < n + m; ++i) unknown[first_acceleration + i] = static_cast<std::uint16_t>(i);
      for (const Chart& chart : M::charts) {
        for (int i = 0; i < chart.scalars; ++i) unknown[static_cast<std::size_t>(chart.q + i)] = static_cast<std::uint16_t>(chart.v + i);
        for (int i = chart.scalars; chart.ball && i < chart.scalars + 4; ++i) {
          unknown[static_cast<std::size_t>(chart.q + i)] = static_cast<std::uint16_t>(chart.v + chart.scalars);
          turns[static_cast<std::size_t>(chart.q + i)] = true;
          ball[static_cast<std::size_t>(chart.q + i)] = balls_before;
          place[static_cast<std::size_t>(chart.q + i)] = static_cast<std::uint16_t>(i - chart.scalars);
        }
        balls_before += chart.ball;
      }
    }
  };
  static constexpr Columns columns{};

  /// The slopes that have a place in the matrix, and their columns; behind `plain` ones those by quaternions, with the place by the first of three speeds.
  struct Entries {
    struct Entry {
      std::uint32_t slope, column, at;
    };
    std::array<Entry, OfSlopes::size()> list{};
    std::size_t plain = 0, all = 0;

    constexpr Entries() {
      for (const bool turns : {false, true}) {
        for (std::size_t i = 0; i < n + m; ++i)
          for (std::size_t k = T::starts[i]; k < T::starts[i + 1]; ++k) {
            const std::size_t column = T::columns[k];
            if ((column >= first_input && column < first_acceleration) || columns.turns[column] != turns) continue;
            list[all++] = {static_cast<std::uint32_t>(k), static_cast<std::uint32_t>(column),
                           static_cast<std::uint32_t>(Bordered<T>::places.of(i, columns.unknown[column]))};
          }
        if (!turns) plain = all;
      }
    }
  };
  static constexpr Entries places{};

  /// A state, the slopes there, and a matrix as L U: of the length of step, or 0, that it is decomposed for.
  struct At {
    bool is_found = false;
    double t = 0.0, decomposed_for = none;
    Fixed<double, coordinates> q;
    Fixed<double, n> v, vdot;
    Fixed<double, m> lambda;
    Fixed<double, given> u;
    OfSlopes slope;
    Bordered<T> matrix;
  };

  bool decompose_plain(At& x) { return x.decomposed_for == 0.0 || decompose(x, 0.0, Weights()); }

  bool decompose(At& x, double h, const Weights& weights) {
    auto& entries = x.matrix.entries();
    entries.fill(0.0);
    for (std::size_t k = 0; k < places.plain; ++k) {
      const auto& entry = places.list[k];
      entries[entry.at] += x.slope[entry.slope] * weights.of[entry.column];
    }
    for (std::size_t k = places.plain; has_balls && k < places.all; ++k) {
      const auto& entry = places.list[k];
      for (std::size_t j = 0; j < 3; ++j) entries[entry.at + j] += x.slope[entry.slope] * weights.turns[3 * entry.column + j];
    }
    for (std::size_t i = 0; i < m; ++i) entries[Bordered<T>::places.of(n + i, n + i)] -= gives_way_[i];
    const bool is_regular = x.matrix.decompose();
    x.decomposed_for = is_regular ? h : none;
    return is_regular;
  }

  /// The largest change along each direction of accelerations, or of multipliers.
  template <std::size_t size>
  static Slopes largest(const Fixed<Along, size>& changes, bool of_multipliers) {
    Slopes most{};
    for (std::size_t i = 0; i < size; ++i)
      if ((i % (n + m) >= n) == of_multipliers) most = larger(larger(changes[i].slope, -changes[i].slope), most);
    return most;
  }

  static double share_of(const Slopes& part, const Slopes& whole) {
    double share = 0.0;
    for (std::size_t k = 0; k < directions; ++k) share = std::max(share, part[k] > 0.0 ? part[k] / whole[k] : 0.0);
    return share;
  }

  /// Take back what loops have given way by, which each solution leaves less of by the share by which multipliers still change; false where that does not
  /// come to an end.
  template <class Matrix, std::size_t size>
  bool close(const Matrix& matrix, Fixed<Along, size>& change) const {
    if constexpr (m > 0) {
      Fixed<Along, size> more = change;
      for (int iteration = 0; iteration < 8; ++iteration) {
        const Slopes pulled = largest(more, true);
        for (std::size_t i = 0; i < size; ++i) more[i] *= i % (n + m) < n ? 0.0 : -gives_way_[i % (n + m) - n];
        matrix.solve(more);
        for (std::size_t i = 0; i < size; ++i) change[i] += more[i];
        if (share_of(largest(more, false), largest(change, false)) * std::min(1.0, share_of(largest(more, true), pulled)) <= 1e-13) return true;
      }
      return false;
    }
    return true;
  }

  C<double> plain_;
  C<Dual> with_changes_;
  At at_[2];
  int now_ = 0;
  Fixed<Along, loaded> changes_;  ///< of loaded values along directions
  bool are_changing_ = false;
  Fixed<Slopes, first_acceleration> by_;  ///< of all but accelerations and multipliers
  Fixed<double, m> gives_way_;  ///< by how much loops do to multipliers in the matrix
};

}  // namespace cutjoint
