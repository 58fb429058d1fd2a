// An explicit Runge-Kutta method as a scheme of steps.
#pragma once

#include "cutjoint/core/stepping/coefficients.hpp"
#include "cutjoint/core/mechanism/state.hpp"
#include "cutjoint/core/stepping/stepper.hpp"

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

/// The scheme of stepping/stepper.hpp for y' = f(t, y); a table without an estimate takes one step a row.
template <class Dynamics, class Table>
class Scheme {
 public:
  using Real = typename Dynamics::Real;
  using Subject = typename Dynamics::Subject;
  using Vector = typename Dynamics::Vector;
  using Attempt = stepping::Attempt<Real>;

  static constexpr int order = Table::order;
  static constexpr bool reaches_beyond = Table::all == Table::stages, divides = false;

  Scheme(Dynamics& dynamics, const stepping::Tolerances<Real>& tolerances)
      : dynamics_(dynamics), formula_(dynamics), tolerances_(tolerances), y_(dynamics.size()), end_(y_), trial_(y_), unsettled_(y_) {
    errors_.fill(y_);
  }

  static constexpr bool adaptive() { return Table::adaptive; }
  Real time() const { return t_; }
  auto& cells() { return dynamics_.cells(); }
  const auto& formula() const { return formula_; }

  /// Start and length of the last accepted step.
  std::pair<Real, Real> last_step() const { return {before_, h_last_}; }

  Real begin(Real t, const Vector& y, Real left) {
    t_ = t;
    y_ = y;
    return adaptive() ? first_length(left) : left;
  }

  /// Take over another y at t.
  void go_to(Real t, const Vector& y) {
    t_ = t;
    y_ = y;
    formula_.restart();
  }

  Attempt attempt(Real h, bool whole, long) {
    dynamics_.begin_attempt(t_);
    formula_.attempt(t_, h, y_, end_, errors_, whole);
    return {cells().crossed() ? Real(0) : error_size()};
  }

  void advance(Real h) {
    if constexpr (adaptive()) stiff_ += formula_.stiffness(h, end_) > Real(Table::stiff);
    dynamics_.advance(t_ + h);
  }

  Fault accept(Real h) {
    formula_.accept(t_, h, y_, end_);
    before_ = t_;
    h_last_ = h;
    trial_ = end_;
    trial_time_ = t_ + h;
    return finish();
  }

  Real follow(Real s) {
    formula_.interpolate(s, trial_);
    return trial_time_ = before_ + s * h_last_;
  }

  void follow_to(Real t) {
    follow((t - before_) / h_last_);
    trial_time_ = t;
  }

  bool seek() { return dynamics_.seek(trial_time_, trial_); }
  std::size_t found() { return dynamics_.found(trial_time_, trial_); }

  Fault finish() {
    t_ = trial_time_;
    unsettled_ = trial_;
    const Fault fault = dynamics_.project(t_, trial_);
    y_ = trial_;
    return fault;
  }

  Fault restart() {
    formula_.restart();
    return {};
  }

  Fault adopt() {
    dynamics_.adopt(t_, y_);
    return restart();
  }

  const Real* pose() const { return y_.data(); }

  void read_struck(Real t, StateOf<Subject>& state) {
    std::copy(y_.begin(), y_.begin() + middle(), unsettled_.begin());
    std::copy(y_.begin(), y_.begin() + middle(), state.q.begin());
    std::copy(unsettled_.begin() + middle(), unsettled_.end(), state.v.begin());
    state.t = t;
  }

  void complete_struck(StateOf<Subject>& state) { dynamics_.inspect(state.t, unsettled_, state); }

  void take_speeds(const Speeds<Subject>& v) { std::copy(v.begin(), v.end(), y_.begin() + middle()); }

  void read_end(StateOf<Subject>& state) { dynamics_.inspect(t_, y_, state); }

  void read_between(Real t, StateOf<Subject>& state) {
    follow_to(t);
    dynamics_.inspect(t, trial_, state);
  }

  Fault read(Real t, bool lies_between, Vector& y) {
    y = y_;
    if (!lies_between) return {};
    formula_.interpolate((t - before_) / h_last_, y);
    return dynamics_.project(t, y);
  }

  Real length(Real, Real allowed) const { return allowed; }

  /// Steps whose length stability limited, not accuracy.
  long stiff() const { return stiff_; }

  Fault give_up(const Attempt& attempt, long steps, long number) const {
    const Cause cause = !adaptive() ? Cause::accelerations_not_finite : stiff_ > steps / 2 ? Cause::stiff : Cause::tolerance_not_met;
    const std::size_t coordinates = sizes_of(dynamics_.subject()).coordinates;
    const bool is_speed = worst_ >= coordinates;
    return {.cause = cause, .list = is_speed ? FaultList::speeds : FaultList::coordinates,
            .index = static_cast<int>(is_speed ? worst_ - coordinates : worst_), .t = static_cast<double>(t_), .step = number,
            .value = static_cast<double>(attempt.size)};
  }

  /// Memory for the next steps, with the mode.
  struct Memory {
    typename Dynamics::Memory dynamics;
    typename Formula<Dynamics, Table>::Memory formula;
    Vector y;
    Real t;
    long stiff;
  };

  Memory memory() const { return {.dynamics = dynamics_.memory(), .formula = formula_.memory(), .y = y_, .t = t_, .stiff = stiff_}; }

  void restore(const Memory& memory) {
    dynamics_.restore(memory.dynamics);
    formula_.restore(memory.formula);
    y_ = memory.y;
    t_ = memory.t;
    stiff_ = memory.stiff;
  }

 private:
  /// The size of the error; of two estimates of it the second, of lower order, guards the first against chance (Hairer, Norsett, Wanner, Solving Ordinary
  /// Differential Equations I, section II.10).
  Real error_size() {
    if constexpr (Table::errors.size() == 1) return size_of(errors_[0]);
    using std::sqrt;
    const Real guard = size_of(errors_.back()), size = size_of(errors_[0]);
    const Real both = sqrt(size * size + Real(0.01) * guard * guard);
    return size > Real(0) && both < std::numeric_limits<Real>::infinity() ? size * (size / both) : size;
  }

  /// The largest error by its allowed size; infinite where one is no number.
  Real size_of(const Vector& error) {
    using std::abs;
    Real largest(0);
    for (std::size_t i = 0; i < y_.size(); ++i) {
      const Real size = (abs(error[i]) + Real(0) * end_[i]) / tolerances_.of(std::max(abs(y_[i]), abs(end_[i])), i, y_.size());
      if (size <= largest) continue;
      largest = size;
      worst_ = i;
      if (!(size == size)) return std::numeric_limits<Real>::infinity();
    }
    return largest;
  }

  /// A first step (Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, section II.4), with the mechanism's unit of time.
  Real first_length(Real left) {
    using std::abs, std::pow;
    auto largest = [this](const Vector& values) {
      Real result(0);
      for (std::size_t i = 0; i < values.size(); ++i) result = std::max(result, abs(values[i]) / tolerances_.of(y_[i], i, y_.size()));
      return result;
    };
    dynamics_.derive(t_, y_, end_);
    const Real unit = tolerances_.time(), value = largest(y_), derivative = unit * largest(end_);
    const Real short_(1e-5), guess = value < short_ || derivative < short_ ? Real(1e-6) : Real(0.01) * value / derivative;
    const Real probe = std::min(unit * guess, left);
    for (std::size_t i = 0; i < y_.size(); ++i) trial_[i] = y_[i] + probe * end_[i];
    Vector& change = errors_[0];
    dynamics_.derive(t_ + probe, trial_, change);
    for (std::size_t i = 0; i < y_.size(); ++i) change[i] -= end_[i];
    const Real largest_derivative = std::max(derivative, unit * unit * largest(change) / probe);
    const Real by_second_derivative = largest_derivative <= Real(1e-15) ? std::max(unit * Real(1e-6), probe * Real(1e-3)) : unit * pow(Real(0.01) / largest_derivative, Real(1) / Real(Table::order));
    return std::min(Real(100) * probe, by_second_derivative);
  }

  std::ptrdiff_t middle() const { return static_cast<std::ptrdiff_t>(sizes_of(dynamics_.subject()).coordinates); }

  Dynamics& dynamics_;
  Formula<Dynamics, Table> formula_;
  stepping::Tolerances<Real> tolerances_;
  Real t_{0}, before_{0}, h_last_{1}, trial_time_{0};
  typename Formula<Dynamics, Table>::Errors errors_;
  Vector y_, end_, trial_, unsettled_;  ///< the last: before the loops of a trial state were closed
  std::size_t worst_ = 0;
  long stiff_ = 0;
};

}  // namespace cutjoint::runge_kutta
