// How accelerations change along directions, by the linearised balance of forces.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>
#include <utility>

#include "cutjoint/core/arrays.hpp"
#include "cutjoint/core/dense.hpp"
#include "cutjoint/core/dual.hpp"
#include "cutjoint/core/inputs.hpp"
#include "cutjoint/core/retraction.hpp"

namespace cutjoint {

/// No balance of forces: accelerations are found over numbers with derivatives.
struct NoBalance {
  static constexpr bool is_there = false;
};

/// The balance of forces r(q, v, vdot, inputs, parameters) = 0 of a mechanism M whose loops have no equations, by generated code C of its slopes.
/// Parameters are in it by values that follow from them alone, as many as are `loaded`.
///
/// At a state the slopes are found once, over plain numbers, and a matrix is decomposed once; each direction takes products and one solution.  Two
/// states are kept, where a step begins and where it ends.
template <class M, template <class> class C, std::size_t loaded>
class BalanceSlopes {
 public:
  static constexpr bool is_there = true;
  static constexpr std::size_t n = M::sizes.speeds, coordinates = M::sizes.coordinates, inputs = numbers_per_input * M::sizes.inputs,
                               given = inputs + M::sizes.held;
  using Changes = Fixed<Along, n>;

  void drive_by([[maybe_unused]] const InputSource<double>& source) {
    if constexpr (given > 0) plain_.drive_by(source);
  }

  /// Parameters as they are, which do not change along directions.
  template <class Roads>
  void load(const double* parameters, const Roads* roads) {
    plain_.load(parameters, roads);
    for (At& x : at_) x.is_found = false;
    changes_.fill({});
    are_changing_ = false;
  }

  /// How they change.
  template <class Roads>
  void load_changes([[maybe_unused]] const Dual* parameters, [[maybe_unused]] const Roads* roads) {
    if constexpr (loaded > 0) {
      const auto changes = [](const Dual& x) {
        double size = 0.0;
        for (std::size_t k = 0; k < directions; ++k) size += std::abs(x.slope[k]);
        return size > 0.0;
      };
      const bool were_changing = std::exchange(are_changing_, std::any_of(parameters, parameters + M::sizes.parameters, changes));
      if (!are_changing_ && !were_changing) return;
      Fixed<Dual, loaded> values;
      with_changes_.load(parameters, roads);
      with_changes_.loaded_values(values.data());
      for (std::size_t i = 0; i < loaded; ++i) changes_[i].slope = values[i].slope;
    }
  }

  /// Go to a state, and find slopes where they are not kept.
  template <class Numbers, class Speeds, class Inputs>
  void find(double t, const Numbers& q, const Speeds& v, const Speeds& vdot, const Inputs& u) {
    const auto is_same = [](const auto& a, const auto& b) { return std::equal(a.begin(), a.end(), b.begin()); };
    const auto is_here = [&](const At& x) {
      return x.is_found && x.t == t && is_same(q, x.q) && is_same(v, x.v) && is_same(vdot, x.vdot) && is_same(u, x.u);
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
    std::copy(u.begin(), u.end(), x.u.begin());
    Fixed<double, n> left;
    plain_.begin_step(t, 1.0);
    plain_.balance_slopes(x.q.data(), x.v.data(), x.vdot.data(), left.data(), x.by_q.data(), x.by_v.data(), x.by_vdot.data(), x.by_u.data(),
                          x.by_loaded.data());
    x.decomposed_for = none;
  }

  /// How accelerations change with all else; false where that is no number, or masses are singular.
  template <class Numbers, class Speeds, class Inputs, class Held>
  bool solve(const Numbers& q, const Speeds& v, const Inputs& du, const Held& held, Changes& change) {
    At& x = at_[now_];
    if (x.decomposed_for != 0.0 && !x.decompose(0.0, x.by_vdot)) return false;
    return back(x, q, v, du, held, change);
  }

  /// The same where they move the state, the end of a trapezoidal step that `decompose_end` has decomposed.
  template <class Numbers, class Speeds, class Inputs, class Held>
  bool solve_end(const Numbers& q, const Speeds& v, const Inputs& du, const Held& held, Changes& change) {
    return back(at_[now_], q, v, du, held, change);
  }

  /// Decompose r_vdot + h/2 r_v + h^2/4 r_q of the end of a trapezoidal step, to which `delta` leads from coordinates; false where it is singular.
  bool decompose_end(double h, std::span<const Chart> charts, [[maybe_unused]] const double* from, [[maybe_unused]] const double* delta) {
    At& x = at_[now_];
    if (x.decomposed_for == h) return true;
    const double by_speed = h / 2, by_place = h * h / 4;
    Fixed<double, n * n> matrix;
    for (std::size_t i = 0; i < n * n; ++i) matrix[i] = x.by_vdot[i] + by_speed * x.by_v[i];
    for (const Chart& chart : charts) {
      const auto at = static_cast<std::size_t>(chart.v), place = static_cast<std::size_t>(chart.q), scalars = static_cast<std::size_t>(chart.scalars);
      for (std::size_t k = 0; k < scalars; ++k)
        for (std::size_t i = 0; i < n; ++i) matrix[i * n + at + k] += by_place * x.by_q[i * coordinates + place + k];
      if constexpr (coordinates > M::sizes.joint_speeds()) {
        if (!chart.ball) continue;
        Dual e[4], theta[3], turned[4];
        for (std::size_t k = 0; k < 4; ++k) e[k] = from[place + scalars + k];
        for (std::size_t k = 0; k < 3; ++k) theta[k] = delta[at + scalars + k], theta[k].slope[k] = by_place;
        turn<Dual>(e, theta, turned);
        for (std::size_t i = 0; i < n; ++i)
          for (std::size_t k = 0; k < 3; ++k)
            for (std::size_t c = 0; c < 4; ++c)
              matrix[i * n + at + scalars + k] += x.by_q[i * coordinates + place + scalars + c] * turned[c].slope[k];
      }
    }
    return x.decompose(h, matrix);
  }

  /// Whether there is the matrix of the end of a step of this length, from which `correct` goes on.
  bool knows(double h) const { return at_[now_].decomposed_for == h; }

  /// Accelerations that are off by this from those to which they lead: the correction takes its place.
  void correct(Fixed<double, n>& left) {
    At& x = at_[now_];
    Fixed<double, n> force;
    for (std::size_t i = 0; i < n; ++i)
      for (std::size_t j = 0; j < n; ++j) force[i] += x.by_vdot[i * n + j] * left[j];
    x.solve(force);
    left = force;
  }

 private:
  static constexpr double none = -1.0;

  /// A state, the slopes there, and a matrix as L U: of the length of step, or 0, that it is decomposed for.
  struct At {
    bool is_found = false;
    double t = 0.0, decomposed_for = none;
    Fixed<double, coordinates> q;
    Fixed<double, n> v, vdot;
    Fixed<double, given> u;
    Fixed<double, n * coordinates> by_q;
    Fixed<double, n * n> by_v, by_vdot;
    Fixed<double, n * given> by_u;
    Fixed<double, n * loaded> by_loaded;
    Fixed<double, n * n> factors;  ///< by columns
    Fixed<std::size_t, n> order;

    dense::Triangles<double> triangles() { return {{factors.data(), n, n}, order.data()}; }

    /// Decompose a matrix, which stands by rows.
    bool decompose(double h, const Fixed<double, n * n>& matrix) {
      for (std::size_t i = 0; i < n; ++i)
        for (std::size_t j = 0; j < n; ++j) factors[j * n + i] = matrix[i * n + j];
      const bool is_regular = triangles().decompose();
      decomposed_for = is_regular ? h : none;
      return is_regular;
    }

    template <class Number>
    void solve(Fixed<Number, n>& x) {
      Fixed<Number, n> room;
      triangles().solve(x.data(), room.data());
    }
  };

  /// The solution for the balance's changes by all but accelerations; false where one is no number.
  template <class Numbers, class Speeds, class Inputs, class Held>
  bool back(At& x, const Numbers& q, const Speeds& v, const Inputs& du, const Held& held, Changes& change) const {
    for (std::size_t i = 0; i < n; ++i) {
      Slopes sum{};
      const auto take = [&sum](const double* row, const auto& numbers) {
        for (std::size_t j = 0; j < numbers.size(); ++j) sum -= row[j] * numbers[j].slope;
      };
      take(x.by_q.data() + i * coordinates, q);
      take(x.by_v.data() + i * n, v);
      take(x.by_u.data() + i * given, du);
      take(x.by_u.data() + i * given + inputs, held);
      if (are_changing_) take(x.by_loaded.data() + i * loaded, changes_);
      change[i].slope = sum;
    }
    x.solve(change);
    Slopes odd{};
    for (const Along& along : change) odd += 0.0 * along.slope;
    double sum = 0.0;
    for (std::size_t k = 0; k < directions; ++k) sum += odd[k];
    return sum == 0.0;
  }

  C<double> plain_;
  C<Dual> with_changes_;
  At at_[2];
  int now_ = 0;
  Fixed<Along, loaded> changes_;  ///< of loaded values along directions
  bool are_changing_ = false;
};

}  // namespace cutjoint
