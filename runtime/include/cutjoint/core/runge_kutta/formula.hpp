// Steps of an explicit Runge-Kutta method, and its interpolant.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "cutjoint/core/stepping/coefficients.hpp"

namespace cutjoint::runge_kutta {

/// A method whose last stage is the end of the step, and so the first of the next one (FSAL).
///
/// The interpolant, with s the fraction of the step, is
///
///     y(s) = y + s (d + (1 - s) (b + s (c + (1 - s) (w + s (...)))))      d = end - y,  b = h f(y) - d,  c = d - h f(end) - b
///
/// where w and the following are h times the derivatives weighted by the rows of the table's `dense`.  Stages of the interpolant alone are evaluated when
/// it is used first.
template <class Dynamics, class Table>
class Formula {
 public:
  using Real = typename Dynamics::Real;
  using Vector = typename Dynamics::Vector;

  static constexpr int order = Table::order;

  using Errors = std::array<Vector, Table::errors.size()>;

  explicit Formula(Dynamics& dynamics) : dynamics_(dynamics), at_(dynamics.size()), before_(at_) {
    derivatives_.fill(at_);
    parts_.fill(at_);
  }

  /// Forget the derivative: the state has been changed other than by a step.
  void restart() { begun_ = false; }

  /// The derivative at the beginning of the next step, if known.
  struct Memory {
    Vector derivative;
    long begun;  ///< 0 or 1; a bool would leave bytes of a snapshot to chance
  };

  Memory memory() const { return {derivatives_[0], begun_}; }

  void restore(const Memory& memory) {
    derivatives_[0] = memory.derivative;
    begun_ = memory.begun != 0;
  }

  /// The derivatives with which the accepted step began, and with which the next one does unless it restarts.
  const Vector& first_derivative() const { return derivatives_[Table::stages - 1]; }
  const Vector& last_derivative() const { return derivatives_[0]; }

  /// A step of h from y at t into `end`; error estimates into `errors`. Unless `whole` it ends at a stage that leaves the mode.
  void attempt(Real t, Real h, const Vector& y, Vector& end, Errors& errors, bool whole) {
    if (!begun_) dynamics_.derive(t, y, derivatives_[0]);
    begun_ = true;
    for (std::size_t stage = 1; stage < Table::stages; ++stage) {
      if (stage == Table::stages - 1) before_ = at_;
      at_ = y;
      add_derivatives(h, Table::weights[stage], derivatives_, at_);
      if (!dynamics_.derive(t + Table::nodes[stage].template as<Real>() * h, at_, derivatives_[stage], whole)) return;
    }
    end = at_;
    for (std::size_t i = 0; i < errors.size(); ++i) weigh(h, Table::errors[i], errors[i]);
  }

  /// h times the largest eigenvalue, from the last two stages, both at the end (Hairer, Wanner, Solving Ordinary Differential Equations
  /// II, section IV.2); 0 where the stages agree.
  Real stiffness(Real h, const Vector& end) const {
    using std::sqrt;
    Real above(0), below(0);
    for (std::size_t i = 0; i < end.size(); ++i) {
      const Real derivative = derivatives_[Table::stages - 1][i] - derivatives_[Table::stages - 2][i], shift = end[i] - before_[i];
      above += derivative * derivative;
      below += shift * shift;
    }
    return below > Real(0) ? h * sqrt(above / below) : Real(0);
  }

  /// Accept the attempted step from y at t; its interpolant is valid until the next one is accepted.
  void accept(Real t, Real h, const Vector& y, const Vector& end) {
    const auto &first = derivatives_[0], &last = derivatives_[Table::stages - 1];
    if constexpr (Table::all == Table::stages) weigh_between(h);
    for (std::size_t i = 0; i < y.size(); ++i) {
      const Real shift = end[i] - y[i], quadratic = h * first[i] - shift;
      parts_[0][i] = y[i];
      parts_[1][i] = shift;
      parts_[2][i] = quadratic;
      parts_[3][i] = shift - h * last[i] - quadratic;
    }
    derivatives_[0].swap(derivatives_[Table::stages - 1]);
    accepted_ = {t, h, Table::all > Table::stages};
  }

  /// The accepted step at the fraction s of its length; s slightly above 1 extrapolates.
  void interpolate(Real s, Vector& y) {
    if constexpr (Table::all > Table::stages)
      if (accepted_.lacks_stages) find_stages_between();
    const Real left = Real(1) - s;
    for (std::size_t i = 0; i < y.size(); ++i) {
      Real sum = parts_.back()[i];
      for (std::size_t k = parts_.size() - 2; k > 0; --k) sum = parts_[k][i] + (k % 2 > 0 ? left : s) * sum;
      y[i] = parts_[0][i] + s * sum;
    }
  }

 private:
  /// h times weighted derivatives.
  void weigh(Real h, const typename Table::Row& weights, Vector& sum) const {
    std::fill(sum.begin(), sum.end(), Real(0));
    add_derivatives(h, weights, derivatives_, sum);
  }

  void weigh_between(Real h) {
    for (std::size_t i = 0; i < Table::dense.size(); ++i) weigh(h, Table::dense[i], parts_[4 + i]);
  }

  /// Meanwhile the derivatives at the step's ends are in their own positions.
  void find_stages_between() {
    const auto [t, h, lacks_stages] = accepted_;
    derivatives_[0].swap(derivatives_[Table::stages - 1]);
    for (std::size_t stage = Table::stages; stage < Table::all; ++stage) {
      at_ = parts_[0];
      add_derivatives(h, Table::weights[stage], derivatives_, at_);
      dynamics_.derive_between(t + Table::nodes[stage].template as<Real>() * h, at_, derivatives_[stage]);
    }
    weigh_between(h);
    derivatives_[0].swap(derivatives_[Table::stages - 1]);
    accepted_.lacks_stages = false;
  }

  /// The step of the interpolant, and whether stages of that are not evaluated yet.
  struct Accepted {
    Real t{0}, h{0};
    bool lacks_stages = false;
  };

  Dynamics& dynamics_;
  Vector at_, before_;
  std::array<Vector, Table::all> derivatives_;
  std::array<Vector, 4 + Table::dense.size()> parts_;
  Accepted accepted_;
  bool begun_ = false;
};

}  // namespace cutjoint::runge_kutta
