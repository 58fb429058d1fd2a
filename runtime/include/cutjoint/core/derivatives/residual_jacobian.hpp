// Derivatives of accelerations by the linearised force residual.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <limits>
#include <span>
#include <type_traits>
#include <utility>

#include "cutjoint/core/numbers/arrays.hpp"
#include "cutjoint/core/numbers/bordered.hpp"
#include "cutjoint/core/numbers/dual.hpp"
#include "cutjoint/core/inputs/inputs.hpp"
#include "cutjoint/core/mechanism/retraction.hpp"
#include "cutjoint/core/constraints/stabilisation.hpp"
#include "cutjoint/core/mechanism/transposed_charts.hpp"

namespace cutjoint {

/// No force residual: accelerations are found over dual numbers.
struct NoResidual {
  static constexpr bool is_there = false;
};

/// The force residual and the second rates of loops, r(q, v, vdot, lambda, inputs, parameters) = 0, of a mechanism M, with the Jacobian by
/// generated code C and its sparsity by T: starts of rows, of their derivatives with respect to accelerations and multipliers, columns, and positions in the output,
/// those of SIMD groups first.  Parameters enter by `loaded` values that depend on them alone.
///
/// At a state the Jacobian is evaluated and a matrix decomposed once; each seed takes products and a solution.  Constraints have a small compliance,
/// a fraction of that of their penalties, which iterative refinement removes: dependent equations get the multipliers of the augmented update.
/// Two states are cached, the beginning and the end of a step.
template <class M, template <class> class C, class T>
class ResidualJacobian {
 public:
  static constexpr bool is_there = true;
  static constexpr std::size_t n = M::sizes.speeds, m = M::sizes.equations, coordinates = M::sizes.coordinates, inputs = numbers_per_input * M::sizes.inputs,
                               given = inputs + M::sizes.discrete, loaded = T::loaded;
  using Places = T;
  using Changes = std::array<DualPart, n + m>;
  using Numbers = Fixed<double, n + m>;
  static constexpr std::size_t first_speed = coordinates, first_input = first_speed + n, first_discrete = first_input + inputs,
                               first_loaded = first_input + given, first_acceleration = first_loaded + loaded,
                               first_multiplier = first_acceleration + n, width = first_multiplier + m;
  static std::span<const Chart> charts() { return M::charts; }
  static constexpr bool has_balls = coordinates > M::sizes.joint_speeds();
  using JacobianEntries = Fixed<double, T::starts[n + m]>;  ///< in the order of the output

  void drive_by([[maybe_unused]] const InputSource<double>& source) {
    if constexpr (given > 0) plain_.drive_by(source);
  }

  /// The parameters of a simulation, with zero derivatives.
  template <class Simulation>
  void load(Simulation& simulation) {
    [[maybe_unused]] const auto& penalties = simulation.penalties();
    load_mechanism(plain_, simulation.parameters().data(), simulation.roads(), simulation.stabilisation(), penalties);
    for (At& x : at_) x.is_found = false;
    leaves_out_ = false;
    changes_.fill({});
    are_changing_ = false;
    for (std::size_t cut = 0, i = 0; i < m; ++i) {
      while (cut + 1 < M::sizes.cuts && static_cast<std::size_t>(M::cuts[cut + 1]) <= i) ++cut;
      compliance_[order[n + i]] = 1e-3 / penalties[cut];
    }
    std::fill_n(weights_.begin() + first_acceleration, n + m, 1.0);
  }

  /// Their derivatives.
  template <class Roads, class Penalties>
  void load_changes([[maybe_unused]] const Dual* parameters, [[maybe_unused]] const Roads* roads, [[maybe_unused]] const StabilisationSettings& stabilisation,
                    [[maybe_unused]] const Penalties& penalties) {
    if constexpr (loaded > 0) {
      const auto changes = [](const Dual& x) {
        double size = 0.0;
        for (std::size_t k = 0; k < seeds_at_once; ++k) size += std::abs(x.derivative[k]);
        return size > 0.0;
      };
      const bool were_changing = std::exchange(are_changing_, std::any_of(parameters, parameters + M::sizes.parameters, changes));
      if (!are_changing_ && !were_changing) return;
      Fixed<Dual, loaded> values;
      load_mechanism(with_changes_, parameters, roads, stabilisation, penalties);
      with_changes_.loaded_values(values.data());
      for (std::size_t i = 0; i < loaded; ++i) changes_[i].derivative = values[i].derivative;
    }
  }

  /// Go to a state, and evaluate the Jacobian unless it is cached.
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
    find(x, x.derivative);
    x.decomposed_for = none;
  }

  /// The Jacobian at a state.
  template <class State>
  void find(const State& x, JacobianEntries& derivative) {
    plain_.begin_step(x.t, 1.0);
    plain_.residual_jacobian(x.q.data(), x.v.data(), x.vdot.data(), x.lambda.data(), derivative.data());
    for (std::size_t k = 0; leaves_out_ && k < length; ++k)
      if (!(derivative[k] - derivative[k] == 0.0)) derivative[k] = 0.0, is_left_out_[sources.column[k]] = true;
  }

  /// From now on leave out infinite derivatives: seeds must not change their variables.  False if they were left out before.
  bool leave_out_infinite() {
    for (At& x : at_) x.is_found = false, x.decomposed_for = none, x.derivative.fill(0.0);
    is_left_out_.fill(false);
    return !std::exchange(leaves_out_, true);
  }

  /// Minus the Jacobian's product with derivatives of all but accelerations and multipliers, row by row.
  template <class Q, class V, class Inputs, class Discrete>
  void subtract_jvp(const JacobianEntries& derivative, const Q& q, const V& v, const Inputs& du, const Discrete& discrete, DualPart* rows) {
    Changes found;
    subtract_jvp_in_slots(derivative, q, v, du, discrete, found);
    for (std::size_t i = 0; i < n + m; ++i) rows[i] = found[order[i]];
  }

  /// Solve with one or several stacked matrices over accelerations and multipliers, in place, and refine for the compliance of constraints.
  /// False if a number is not finite, or loops stay open.
  template <class Matrix, class Unknowns>
  bool solve(const Matrix& matrix, Unknowns& change) const {
    std::array<DualPart, Matrix::size> found;
    for (std::size_t i = 0; i < found.size(); ++i) found[places_of<Matrix>[i]] = change[i];
    const bool is_found = solve_in_places(matrix, found);
    for (std::size_t i = 0; i < found.size(); ++i) change[i] = found[places_of<Matrix>[i]];
    return is_found;
  }

  /// Derivatives of the smallest displacement or velocity change, in the metric of the masses, that removes violations; false if they remain.
  bool close_violations(const Fixed<Dual, m>& violations, Changes& change) {
    At& x = at_[now_];
    for (std::size_t i = 0; i < n; ++i) change[i] = {};
    for (std::size_t i = 0; i < m; ++i) change[n + i].derivative = -violations[i].derivative;
    return decompose_plain(x) && solve(x.matrix, change);
  }

  /// The same for transposed matrices and plain numbers.
  template <class Matrix, std::size_t size>
  bool solve_transposed(const Matrix& matrix, Fixed<double, size>& x) const {
    const auto solve = [&matrix](Fixed<double, size>& unknowns) {
      std::array<double, size> found;
      for (std::size_t i = 0; i < size; ++i) found[places_of<Matrix>[i]] = unknowns[i];
      matrix.solve_transposed(found.data());
      for (std::size_t i = 0; i < size; ++i) unknowns[i] = found[places_of<Matrix>[i]];
    };
    solve(x);
    Fixed<double, size> more = x;
    double before = 1.0;
    for (int iteration = 0; m > 0 && iteration < 16; ++iteration) {
      double share[2]{}, whole[2]{};  // of the adjoints of the equations of motion, and of those of constraints
      for (std::size_t i = 0; i < size; ++i) more[i] *= i % (n + m) < n ? 0.0 : -compliance(i % (n + m) - n);
      solve(more);
      for (std::size_t i = 0; i < size; ++i) {
        x[i] += more[i];
        const std::size_t of = i % (n + m) < n ? 0 : 1;
        share[of] = std::max(share[of], std::abs(more[i])), whole[of] = std::max(whole[of], std::abs(x[i]));
      }
      const double left = std::max(share[0] / std::max(whole[0], 1e-300), share[1] / std::max(whole[1], 1e-300));
      if (left * std::min(1.0, left / before) <= 1e-15 || (iteration > 0 && !(left < before))) break;
      before = left;
    }
    return std::all_of(x.begin(), x.end(), [](double each) { return each - each == 0.0; });
  }

  /// From derivatives with respect to the result of `close_violations` to those with respect to the violations.
  bool violations_vjp(const Fixed<double, n>& by_move, Fixed<double, m>& by_violation) {
    Numbers x;
    std::copy(by_move.begin(), by_move.end(), x.begin());
    At& at = at_[now_];
    if (!decompose_plain(at) || !solve_transposed(at.matrix, x)) return false;
    for (std::size_t i = 0; i < m; ++i) by_violation[i] = -x[n + i];
    return true;
  }

  /// The transpose of `subtract_jvp`, added to `by`.
  void vjp(const JacobianEntries& derivative, const double* by_rows, Fixed<double, first_acceleration>& by) const {
    for (std::size_t i = 0; i < n + m; ++i)
      for (std::size_t k = T::starts[i]; k < T::middles[i]; ++k) by[T::columns[k]] -= derivative[T::derivatives[k]] * by_rows[i];
  }

  /// Visit each derivative of some rows with respect to accelerations and multipliers: the row, the derivative's position, and the unknown.
  template <class Use>
  static void visit_unknowns(std::size_t first, std::size_t end, Use use) {
    for (std::size_t i = first; i < end; ++i)
      for (std::size_t k = T::middles[i]; k < T::starts[i + 1]; ++k) use(i, T::derivatives[k], T::columns[k] - first_acceleration);
  }

  /// Add the entries of the first rows in a stage to a matrix over unknowns of all stages: the row, the unknown's stage, the unknown, and the value.
  template <class Formula, class Add>
  static void gather_entries(const Formula& formula, std::size_t stage, const JacobianEntries& derivative, std::size_t rows, Add add) {
    for (std::size_t i = 0; i < rows; ++i)
      for (std::size_t k = T::starts[i]; k < T::middles[i]; ++k)
        for (std::size_t j = 0; T::columns[k] < first_input && j < Formula::stages; ++j)
          formula.template visit_weights<ResidualJacobian>(T::columns[k], stage, j, [&](std::size_t unknown, double share) { add(i, j, unknown, share * derivative[T::derivatives[k]]); });
    visit_unknowns(0, rows, [&](std::size_t i, std::size_t k, std::size_t unknown) { add(i, stage, unknown, derivative[k]); });
  }

  /// Derivatives of loaded values.
  const Fixed<DualPart, loaded>& changes() const { return changes_; }

  double compliance(std::size_t equation) const { return compliance_[order[n + equation]]; }

  // Columns of coordinates: the velocity whose integral one is (the first of three for a quaternion), whether it is of a quaternion, of which ball, and its index there.
  static constexpr std::size_t balls = coordinates - M::sizes.joint_speeds();
  static std::size_t unknown_of(std::size_t column) { return columns.unknown[column]; }
  static bool is_quaternion(std::size_t column) { return columns.stride[column] > 0; }
  static std::array<std::size_t, 2> ball_of(std::size_t column) { return {columns.ball[column], columns.place[column]}; }

  /// Derivatives of accelerations and multipliers at a state; false if one is not finite, or the mass matrix is singular.
  template <class Q, class V, class Inputs, class Discrete>
  bool solve(const Q& q, const V& v, const Inputs& du, const Discrete& discrete, Changes& change) {
    return decompose_plain(at_[now_]) && solve_end(q, v, du, discrete, change);
  }

  /// The same at the end of a trapezoidal step, whose state depends on them; after `decompose_end`.
  template <class Q, class V, class Inputs, class Discrete>
  bool solve_end(const Q& q, const V& v, const Inputs& du, const Discrete& discrete, Changes& change) {
    At& x = at_[now_];
    Changes found;
    subtract_jvp_in_slots(x.derivative, q, v, du, discrete, found);
    const bool is_found = solve_in_places(x.matrix, found);
    for (std::size_t i = 0; i < n + m; ++i) change[i] = found[order[i]];
    return is_found;
  }

  /// The transpose of `solve_end`: the solution replaces `by_end`, and derivatives with respect to all that `subtract_jvp` reads are added to `by`.
  bool end_vjp(Numbers& by_end, Fixed<double, first_acceleration>& by) const {
    if (!solve_transposed(at_[now_].matrix, by_end)) return false;
    vjp(at_[now_].derivative, by_end.data(), by);
    return true;
  }

  /// The same of `solve`.
  bool accelerations_vjp(Numbers& by_accelerations, Fixed<double, first_acceleration>& by) { return decompose_plain(at_[now_]) && end_vjp(by_accelerations, by); }

  /// Decompose r_vdot + h/2 r_v + h^2/4 r_q of the end of a trapezoidal step, with the weights of its formula; false if it is singular.
  template <class Formula>
  bool decompose_end(double h, const Formula& formula) {
    At& x = at_[now_];
    if (x.decomposed_for == h) return true;
    for (std::size_t column = 0; column < first_input; ++column) {
      std::size_t place = columns.share[column];
      formula.template visit_weights<ResidualJacobian>(column, 0, 0, [&](std::size_t, double share) { weights_[place] = share, place += columns.stride[column]; });
    }
    return decompose(x, h);
  }

  /// Whether `correct` has a matrix for the end of a step of this length.
  bool has_matrix_for(double h) const { return at_[now_].decomposed_for == h; }

  /// Corrections of accelerations, in place of their errors `left`, and of multipliers, `vjp`.
  void correct(Fixed<double, n>& left, Fixed<double, m>& vjp) {
    At& x = at_[now_];
    double by[n + m], force[n + m];
    for (std::size_t i = 0; i < n; ++i) by[slots[first_acceleration + i]] = left[i];
    find_products<true>(x.derivative.data(), by, force);
    x.matrix.solve(force);
    for (std::size_t i = 0; i < n; ++i) left[i] = -force[order[i]];
    for (std::size_t i = 0; i < m; ++i) vjp[i] = -force[order[n + i]];
  }

 private:
  static constexpr double none = -1.0;
  static constexpr std::size_t length = T::starts[n + m];

  /// The unknown that each column depends on, and the position of its weight; for a quaternion the first of three of both.  The three weights of
  /// one are a stride apart, beside those of its SIMD group.
  struct Columns {
    std::array<std::uint32_t, width> unknown{}, share{}, stride{};
    std::array<std::uint32_t, coordinates> ball{}, place{};

    constexpr Columns() {
      constexpr auto& places = Bordered<T>::places;
      for (std::size_t i = 0; i < width; ++i) share[i] = static_cast<std::uint32_t>(i);
      for (std::size_t i = 0; i < n; ++i) unknown[first_speed + i] = static_cast<std::uint32_t>(i);
      for (std::size_t i = 0; i < n + m; ++i) unknown[first_acceleration + i] = static_cast<std::uint32_t>(i);
      std::array<std::size_t, n + m> first{};
      std::size_t next = width;
      std::uint32_t balls_before = 0;
      for (const Chart& chart : M::charts) {
        for (int i = 0; i < chart.scalars; ++i) unknown[static_cast<std::size_t>(chart.q + i)] = static_cast<std::uint32_t>(chart.v + i);
        if (!chart.ball) continue;
        const auto speed = static_cast<std::size_t>(chart.v + chart.scalars);
        const std::size_t side = T::beside[places.set[speed]], lane = (places.slot(speed) - places.first[places.set[speed]]) % side;
        if (lane == 0) first[places.slot(speed)] = next, next += 12 * side;
        for (std::size_t i = 0; i < 4; ++i) {
          const std::size_t column = static_cast<std::size_t>(chart.q + chart.scalars) + i;
          unknown[column] = static_cast<std::uint32_t>(speed);
          share[column] = static_cast<std::uint32_t>(first[places.slot(speed) - lane] + 3 * side * i + lane);
          stride[column] = static_cast<std::uint32_t>(side);
          ball[column] = balls_before;
          place[column] = static_cast<std::uint32_t>(i);
        }
        balls_before += chart.ball;
      }
    }
  };
  static constexpr Columns columns{};

  /// The row and column of each derivative in the order of the output.
  struct Sources {
    std::array<std::uint32_t, length> row{}, column{};

    constexpr Sources() {
      for (std::size_t i = 0; i < n + m; ++i)
        for (std::size_t k = T::starts[i]; k < T::starts[i + 1]; ++k)
          row[T::derivatives[k]] = static_cast<std::uint32_t>(i), column[T::derivatives[k]] = static_cast<std::uint32_t>(T::columns[k]);
    }

    /// Whether the derivatives of a group belong to one row, and to one column.
    constexpr bool share_row(std::size_t first, std::size_t side) const { return side > 1 && row[first] == row[first + side - 1]; }
    constexpr bool share_column(std::size_t first, std::size_t side) const { return side > 1 && column[first] == column[first + side - 1]; }
  };
  static constexpr Sources sources{};

  /// Visit the first derivative of each group of `side`.
  template <std::size_t side, class Use>
  static constexpr void visit_groups(Use use) {
    std::size_t first = 0;
    for (std::size_t s = 0; s < std::size(T::groups); first += T::groups[s] * T::beside[s], ++s)
      for (std::size_t k = first; T::beside[s] == side && k < first + T::groups[s] * side; k += side) use(k);
    for (std::size_t k = first; side == 1 && k < length; ++k) use(k);
  }

  /// The positions of derivatives of columns, groups first, and of unknowns.
  static constexpr auto slots = [] {
    std::array<std::uint32_t, width> found{};
    for (const auto& range : {std::pair{std::size_t{0}, first_acceleration}, std::pair{first_acceleration, width}}) {
      const std::size_t begin = range.first, end = range.second;
      std::array<bool, width> is_placed{};
      std::size_t next = 0;
      const auto place = [&](std::size_t column) {
        if (!is_placed[column] && column >= begin && column < end) found[column] = static_cast<std::uint32_t>(next++), is_placed[column] = true;
      };
      const auto place_groups = [&]<std::size_t side>() {
        visit_groups<side>([&](std::size_t k) {
          for (std::size_t l = 0; l < side && !sources.share_column(k, side); ++l) place(sources.column[k + l]);
        });
      };
      place_groups.template operator()<4>(), place_groups.template operator()<2>();
      for (std::size_t column = begin; column < end; ++column) place(column);
    }
    return found;
  }();
  static constexpr auto order = [] {
    std::array<std::uint32_t, n + m> found{};
    for (std::size_t i = 0; i < n + m; ++i) found[i] = static_cast<std::uint32_t>(Bordered<T>::places.slot(i));
    return found;
  }();

  struct Factor {
    std::uint32_t derivative, place;
  };

  /// Factors of a row, or of a group of rows: first those of a column shared by all.
  struct Line {
    std::uint32_t place, first, shared, end;
    bool is_shared, adds;
  };

  /// Products of groups with accelerations, or with all but accelerations and multipliers.
  template <bool by_accelerations, std::size_t side>
  struct Products {
    template <class Use>
    static constexpr void visit(Use use) {
      visit_groups<side>([&](std::size_t k) {
        const std::size_t column = sources.column[k];
        if (by_accelerations ? column >= first_acceleration && column < first_multiplier : column < first_acceleration) use(k);
      });
    }
    static constexpr std::pair<std::size_t, std::size_t> sizes = [] {
      std::size_t number = 0, rows = 0, last = n + m;
      visit([&](std::size_t k) { ++number, rows += sources.row[k] != last, last = sources.row[k]; });
      return std::pair{number, rows};
    }();
    std::array<Factor, sizes.first> factors{};
    std::array<Line, sizes.second> lines{};

    constexpr Products() {
      std::uint32_t number = 0;
      std::size_t rows = 0, last = n + m;
      visit([&](std::size_t k) {
        const std::size_t row = sources.row[k];
        if (row != last) lines[rows++] = {order[row], number, number, number, sources.share_row(k, side), side < widest<by_accelerations>[row]};
        last = row;
        factors[number++] = {static_cast<std::uint32_t>(k), slots[sources.column[k]]};
        lines[rows - 1].end = number;
        if (sources.share_column(k, side)) lines[rows - 1].shared = number;
      });
    }
  };

  /// The widest group of products of each row; 8 for a row whose products are added to zero.
  template <bool by_accelerations>
  static constexpr auto widest = [] {
    std::array<std::uint16_t, n + m> found{};
    const auto take = [&]<std::size_t side>() {
      Products<by_accelerations, side>::visit([&](std::size_t k) {
        for (std::size_t l = 0; l < side; ++l) found[sources.row[k + l]] = sources.share_row(k, side) ? 8 : std::max<std::uint16_t>(found[sources.row[k + l]], side);
      });
    };
    take.template operator()<1>(), take.template operator()<2>(), take.template operator()<4>();
    for (std::uint16_t& most : found) most = most == 0 ? 8 : most;
    return found;
  }();

  /// Minus the products with derivatives in the order `slots`, in the order `order`.
  template <bool by_accelerations, class Number>
  static void find_products(const double* derivatives, const Number* by, Number* found) {
    for (std::size_t i = 0; i < n + m; ++i)
      if (widest<by_accelerations>[i] == 8) found[order[i]] = Number{};
    subtract_products<by_accelerations, 4>(derivatives, by, found);
    subtract_products<by_accelerations, 2>(derivatives, by, found);
    subtract_products<by_accelerations, 1>(derivatives, by, found);
  }

  template <bool by_accelerations, std::size_t side, class Number>
  static void subtract_products(const double* derivatives, const Number* by, Number* found) {
    if constexpr (has_side(side)) {
      static constexpr Products<by_accelerations, side> products{};
      for (const Line& line : products.lines) {
        auto& place = reinterpret_cast<Sides<side, Number>&>(found[line.place]);
        auto sum = line.adds && !line.is_shared ? place : Sides<side, Number>::of([](std::size_t) { return Number{}; });
        const Factor* factor = products.factors.data() + line.first;
        const auto derivative = [&]() -> const Beside<side>& { return reinterpret_cast<const Beside<side>&>(derivatives[factor->derivative]); };
        for (; factor < products.factors.data() + line.shared; ++factor) sum.subtract(derivative(), by[factor->place]);
        for (; factor < products.factors.data() + line.end; ++factor) sum.subtract(derivative(), reinterpret_cast<const Sides<side, Number>&>(by[factor->place]));
        if (line.is_shared) found[line.place] += sum.sum();
        else place = sum;
      }
    }
  }

  static constexpr bool has_side(std::size_t side) { return side == 1 || std::find(std::begin(T::beside), std::end(T::beside), side) != std::end(T::beside); }

  /// Visit the groups of derivatives in the matrix: the first derivative, its weight and its position, for a quaternion by each of three velocities.
  /// Those with equal weights come first.
  template <std::size_t side, class Use>
  static constexpr void visit_entries(bool are_apart, Use use) {
    constexpr auto& places = Bordered<T>::places;
    visit_groups<side>([&](std::size_t k) {
      const std::size_t column = sources.column[k], stride = columns.stride[column], unknown = columns.unknown[column];
      if ((column >= first_input && column < first_acceleration) || (stride > 0 && side > 1 && !sources.share_column(k, side)) != are_apart) return;
      for (std::size_t j = 0; j < (stride > 0 ? 3 : 1); ++j) use(k, columns.share[column] + j * stride, places.of(sources.row[k], unknown + j));
    });
  }

  struct Entry {
    std::uint32_t derivative, share, at;
  };

  /// All of them, those after `same` with weights of their own.
  template <std::size_t side>
  struct Entries {
    static constexpr std::size_t count(bool are_apart) {
      std::size_t number = 0;
      visit_entries<side>(are_apart, [&](std::size_t, std::size_t, std::size_t) { ++number; });
      return number;
    }
    static constexpr std::size_t same = count(false), all = same + count(true);
    std::array<Entry, all> list{};

    constexpr Entries() {
      std::size_t number = 0;
      for (const bool are_apart : {false, true})
        visit_entries<side>(are_apart, [&](std::size_t derivative, std::size_t share, std::size_t at) {
          list[number++] = {static_cast<std::uint32_t>(derivative), static_cast<std::uint32_t>(share), static_cast<std::uint32_t>(at)};
        });
    }
  };

  /// A state, the Jacobian there, and a matrix as L U for the step length, or 0, `decomposed_for`.
  struct At {
    bool is_found = false;
    double t = 0.0, decomposed_for = none;
    Fixed<double, coordinates> q;
    Fixed<double, n> v, vdot;
    Fixed<double, m> lambda;
    Fixed<double, given> u;
    JacobianEntries derivative;
    Bordered<T> matrix;
  };

  /// The sparsity of the matrix.
  static constexpr auto pattern = [] {
    typename Bordered<T>::Pattern found{};
    const auto mark = [&]<std::size_t side>() {
      for (const bool are_apart : {false, true})
        visit_entries<side>(are_apart, [&](std::size_t, std::size_t, std::size_t at) { found[at] = true; });
    };
    mark.template operator()<1>(), mark.template operator()<2>(), mark.template operator()<4>();
    for (std::size_t i = n; i < n + m; ++i) found[Bordered<T>::places.of(i, i)] = true;
    return found;
  }();

  bool decompose_plain(At& x) {
    if (x.decomposed_for == 0.0) return true;
    std::fill_n(weights_.begin(), first_input, 0.0);
    std::fill(weights_.begin() + width, weights_.end(), 0.0);
    return decompose(x, 0.0);
  }

  bool decompose(At& x, double h) {
    const auto fill = [&] {
      x.matrix.clear();
      gather_entries<1>(x), gather_entries<2>(x), gather_entries<4>(x);
      for (std::size_t i = 0; i < m; ++i) x.matrix.entries()[Bordered<T>::places.of(n + i, n + i)] -= compliance_[order[n + i]];
      return x.matrix.decompose(pattern);
    };
    const bool is_regular = fill() || fill();  // with other pivots if those of an earlier matrix have become small
    x.decomposed_for = is_regular ? h : none;
    return is_regular;
  }

  template <std::size_t side>
  void gather_entries(At& x) const {
    if constexpr (has_side(side)) {
      static constexpr Entries<side> entries{};
      using Sides = Beside<side>;
      const auto derivative = [&](const Entry& entry) -> const Sides& { return reinterpret_cast<const Sides&>(x.derivative[entry.derivative]); };
      const auto place = [&](const Entry& entry) -> Sides& { return reinterpret_cast<Sides&>(x.matrix.entries()[entry.at]); };
      for (std::size_t k = 0; k < entries.same; ++k) place(entries.list[k]) += derivative(entries.list[k]) * weights_[entries.list[k].share];
      for (std::size_t k = entries.same; k < entries.all; ++k)
        place(entries.list[k]) += derivative(entries.list[k]) * reinterpret_cast<const Sides&>(weights_[entries.list[k].share]);
    }
  }

  /// The position of each stacked unknown in the matrix.
  template <class Matrix>
  static constexpr auto places_of = [] {
    std::array<std::uint32_t, Matrix::size> found{};
    for (std::size_t i = 0; i < Matrix::size; ++i) found[i] = static_cast<std::uint32_t>(Matrix::places.slot(i));
    return found;
  }();
  template <class Matrix>
  static constexpr auto own_places = [] {
    std::array<std::uint32_t, Matrix::size> found{};
    for (std::size_t i = 0; i < Matrix::size; ++i) found[places_of<Matrix>[i]] = order[i % (n + m)];
    return found;
  }();

  /// The solution in the order of positions; false if a number is not finite, or loops stay open.
  template <class Matrix, std::size_t size>
  bool solve_in_places(const Matrix& matrix, std::array<DualPart, size>& found) const {
    matrix.solve(found.data());
    Tangents odd{};
    for (const DualPart& along : found) odd += 0.0 * along.derivative;
    double sum = 0.0;
    for (std::size_t k = 0; k < seeds_at_once; ++k) sum += odd[k];
    return sum == 0.0 && close(matrix, found) && (!leaves_out_ || left_out_stay<Matrix>(found));
  }

  /// Whether the variables of left-out derivatives are constant.
  template <class Matrix, std::size_t size>
  bool left_out_stay(const std::array<DualPart, size>& found) const {
    const auto stays = [](const DualPart& x) {
      for (std::size_t k = 0; k < seeds_at_once; ++k)
        if (x.derivative[k] != 0.0) return false;
      return true;
    };
    for (std::size_t c = 0; c < width; ++c)
      if (is_left_out_[c]) {
        if (c < first_acceleration && !stays(by_[slots[c]])) return false;
        for (std::size_t j = 0; (c < first_input || c >= first_acceleration) && j < (is_quaternion(c) ? 3 : 1); ++j)
          for (std::size_t i = columns.unknown[c] + j; i < size; i += n + m)
            if (!stays(found[places_of<Matrix>[i]])) return false;
      }
    return true;
  }

  /// `subtract_jvp` in the order of positions.
  template <class Q, class V, class Inputs, class Discrete>
  void subtract_jvp_in_slots(const JacobianEntries& derivative, const Q& q, const V& v, const Inputs& du, const Discrete& discrete, Changes& found) {
    const auto put = [this](std::size_t first, const auto& numbers) {
      for (std::size_t j = 0; j < numbers.size(); ++j) by_[slots[first + j]].derivative = numbers[j].derivative;
    };
    put(0, q), put(first_speed, v), put(first_input, du), put(first_discrete, discrete), put(first_loaded, changes_);
    find_products<false>(derivative.data(), by_.data(), found.data());
  }

  /// The largest derivative of accelerations, or of multipliers, along each seed.
  template <class Matrix, std::size_t size>
  static Tangents largest(const std::array<DualPart, size>& changes, bool of_multipliers) {
    Tangents most{};
    for (std::size_t i = 0; i < size; ++i)
      if ((i % (n + m) >= n) == of_multipliers) {
        const Tangents& derivative = changes[places_of<Matrix>[i]].derivative;
        most = larger(larger(derivative, -derivative), most);
      }
    return most;
  }

  static double share_of(const Tangents& part, const Tangents& whole) {
    double share = 0.0;
    for (std::size_t k = 0; k < seeds_at_once; ++k) share = std::max(share, part[k] > 0.0 ? part[k] / whole[k] : 0.0);
    return share;
  }

  /// Refine for the compliance of constraints, whose error decreases as the changes of multipliers do; false if that does not
  /// converge.
  template <class Matrix, std::size_t size>
  bool close(const Matrix& matrix, std::array<DualPart, size>& change) const {
    if constexpr (m > 0) {
      std::array<DualPart, size> more;
      const std::array<DualPart, size>* last = &change;
      for (int iteration = 0; iteration < 8; ++iteration) {
        const Tangents pulled = largest<Matrix>(*last, true);
        for (std::size_t i = 0; i < size; ++i) more[i].derivative = (*last)[i].derivative * -compliance_[own_places<Matrix>[i]];
        matrix.solve(more.data());
        for (std::size_t i = 0; i < size; ++i) change[i] += more[i];
        if (share_of(largest<Matrix>(more, false), largest<Matrix>(change, false)) * std::min(1.0, share_of(largest<Matrix>(more, true), pulled)) <= 1e-13) return true;
        last = &more;
      }
      return false;
    }
    return true;
  }

  C<double> plain_;
  C<Dual> with_changes_;
  At at_[2];
  int now_ = 0;
  Fixed<DualPart, loaded> changes_;  ///< derivatives of loaded values
  bool are_changing_ = false, leaves_out_ = false;
  Fixed<bool, width> is_left_out_;  ///< columns of left-out derivatives
  Fixed<DualPart, first_acceleration> by_;  ///< of all but accelerations and multipliers
  Fixed<double, n + m> compliance_;  ///< of constraints, in the matrix
  Fixed<double, width + (has_balls ? 3 * coordinates : 0)> weights_;  ///< of columns in the matrix, for quaternions by each of three velocities
};

}  // namespace cutjoint
