// The state from which Radau IIA steps continue: its mode, loops and errors.
#pragma once

#include "cutjoint/core/newton/recursive_newton.hpp"
#include "cutjoint/core/radau/table.hpp"
#include "cutjoint/core/stepping/step_control.hpp"
#include "cutjoint/core/stepping/indicator_cells.hpp"

namespace cutjoint::radau {

/// Steps over (delta, v), delta being the displacement from the step's start in the chart of `retract`, so that the order holds for balls too.  The unknown of
/// a stage is its acceleration.  Loops are equations of the accelerations, M vdot + Phi_q^T lambda = Q and Phidd = 0 (index 1), without
/// order reduction.  Violations of Phi and Phid are projected away after steps.
template <class S, class Solver>
class StepStart : public Workspace<S, Solver> {
  using Base = Workspace<S, Solver>;

 public:
  using typename Base::Real;
  using Subject = S;

  static constexpr int order = Table::order;
  static constexpr bool estimates = true;  ///< an error

  /// `other` solves for the accelerations of single states; `indicators` are the event indicators, all or none of the system's, and
  /// `roads` those of its tyres.
  StepStart(S& system, Solver& solver, Solver& other, IndicatorPlaces<S> indicators, const Road<Real>* roads)
      : Base(system, solver), other_(other), single_(system, other, {.dt = 1.0, .penalty = std::nullopt, .tolerance = 1e-6, .iterations = 100, .multiplier_updates = 4}),
        closing_(system), cells_(std::move(indicators), roads), ball_tangents_(unit_ball_tangents(system)), row_(design_state(system)), start_(row_), at_(row_), probe_(row_), pose_(row_.q),
        moved_(pose_), push_(m_), way_(n_), delta_(n_), trial_(n_), rates_(repeat<Table::stages + 1>(delta_)), derivatives_(rates_),
        forces_(repeat<Table::stages + 1>(push_)) {}

  std::size_t size() const { return pose_.size() + n_; }
  using Base::charts;

  /// Take over a start and find its accelerations and multipliers.
  Fault begin(const StateOf<S>& start) {
    start_ = start;
    if (const Fault fault = single_.begin(start_, Real(1))) return fault;
    take_over();
    return {};
  }

  /// Take over a state that has accelerations and multipliers, with weights of the equations of its own.
  void resume(const StateOf<S>& state) {
    start_ = state;
    single_.resume(start_);
    take_over();
  }

  /// Put accelerations and multipliers into a state, without counting evaluations as those of steps.
  Fault complete(StateOf<S>& state) { return single_.begin(state, Real(1)); }

  /// Continue from a state as given.
  Fault go_on(StateOf<S>& state) {
    const Fault fault = single_.go_on(state);
    if (fault) return fault;
    start_ = state;
    take_over();
    return {};
  }

  /// Close the loops of a state away from any step, by moving the masses least.
  Fault assemble(StateOf<S>& state) { return single_.assemble(state); }

  /// Set the largest error of a step; Newton's iteration ends at a hundredth of that.
  void set_tolerances(const stepping::Tolerances<Real>& tolerances) { tolerances_ = tolerances; }

  /// The size of the attempted step's error, 1 being what is allowed; infinite where it is no number.
  Real error(Real h) {
    using std::abs;
    if (estimate(h)) return std::numeric_limits<Real>::infinity();
    Real largest(0);
    for (const Chart& chart : charts())
      for (int i = 0; i < chart.scalars + (chart.ball ? 3 : 0); ++i) {
        const auto q = static_cast<std::size_t>(chart.q + i), v = static_cast<std::size_t>(chart.v + i);
        const Real place = i < chart.scalars ? std::max(abs(start_.q[q]), abs(at_.q[q])) : Real(1);
        note(abs(way_[v]) / tolerances_.of(place, q, size()), v, largest);
        note(abs(x_[v]) / tolerances_.of(std::max(abs(start_.v[v]), abs(at_.v[v])), v, n_), v, largest);
      }
    for (std::size_t i = first_state(charts()); i < n_; ++i) note(abs(x_[i]) / tolerances_.of(std::max(abs(start_.v[i]), abs(at_.v[i])), i, n_), i, largest);
    return largest == largest ? largest : std::numeric_limits<Real>::infinity();
  }

  const StateOf<S>& present() const { return start_; }

  /// Accelerations and multipliers of a state, if guides need them: those of the stages are approximations.
  void accelerate(StateOf<S>& state) {
    if (!system_.description().driven) return;
    row_ = state;
    if (!single_.begin(row_, Real(1))) state = row_;  // a singular pose has none
  }

  /// The displacement by the last step before its end was projected, in the chart of its start.
  const Speeds<S>& moved() const { return delta_; }

  /// Coordinates and speeds of another state, which closes the loops, become those of the present one; `restart` has to follow.
  void go_to(const StateOf<S>& state) {
    start_.t = state.t;
    start_.q = state.q;
    start_.v = state.v;
  }

  /// New accelerations and multipliers of the present state after a jump of forces; discard factors and predictions of stages.
  Fault restart() {
    const long evaluations = single_.evaluations(), factorisations = single_.factorisations();
    if (const Fault fault = single_.begin(start_, Real(1))) return fault;
    evaluations_ += single_.evaluations() - evaluations;
    factorisations_ += single_.factorisations() - factorisations;
    last_h_ = Real(0);
    factored_ = slow_ = false;
    keep_start();
    return {};
  }

  /// Inputs have jumped: if forces may have changed their formulas, accelerations and mode are those of the present state.
  void restart_after_input_jump() {
    if (cells_.empty()) return;
    adopt();
    row_ = start_;
    if (single_.begin(row_, Real(1))) return;  // a singular pose keeps what it has
    start_ = row_;
    last_h_ = Real(0);
    keep_start();
  }

  /// Enter the mode of the present state.
  void adopt() {
    evaluate_at(start_);
    cells_.adopt();
  }

  /// Collect the indicators by which a state has left the mode; return whether there are any.
  bool seek(const StateOf<S>& state) {
    evaluate_at(state);
    return cells_.seek();
  }

  /// The first of them; the number of indicators if there is none.
  std::size_t found(const StateOf<S>& state) {
    evaluate_at(state);
    return cells_.found();
  }

  stepping::IndicatorCells<S>& cells() { return cells_; }

  /// Close the loops of a state, positions first, then speeds.
  Fault project(StateOf<S>& state) {
    residuals_ = {};
    if (m_ == 0) return {};
    if (!has_factors_) return single_.assemble(state);
    time_ = state.t;
    system_.begin_step(state.t, Real(1));
    return this->close_with(state, pose_, alpha_, closing_, way_, moved_, residuals_);
  }

  /// The residuals of the equations after that.
  const Residuals& residuals() const { return residuals_; }

  long iterations() const { return iterations_; }

  /// The values of the last tangent.
  const Entries<S>& tangent() const { return tangent_; }

  // Including those of restarts.
  long evaluations() const { return Base::evaluations() + evaluations_; }
  long factorisations() const { return Base::factorisations() + factorisations_; }

  /// The fault of the last attempt, whose stages were `found` or not, with error `size`, if no shorter step is possible.
  Fault give_up(bool found, bool adaptive, long number, Real size) {
    const Cause cause = is_singular() ? Cause::pose_singular : found ? Cause::tolerance_not_met : adaptive ? Cause::stages_not_found : Cause::stage_not_converged;
    Fault fault = this->fault_in_row(cause, static_cast<int>(worst_), size);
    fault.t = static_cast<double>(start_.t);
    fault.step = number;
    return fault;
  }

  /// Memory for the next steps, with mode and solvers; flags have the size of numbers, so that equal memories have equal bytes.
  struct Memory {
    StateOf<S> start;
    Coordinates<S> pose;
    Entries<S> tangent;
    Real alpha, factored_w, last_h, share, before;
    long has_factors, factored, slow;
    typename stepping::IndicatorCells<S>::Memory cells;
    typename Solver::Memory solver, other;
    typename RecursiveNewton<S, Solver>::Memory single;
  };

  Memory memory() const {
    return {start_, pose_, tangent_, alpha_, factored_w_, last_h_, share_, before_, has_factors_, factored_, slow_, cells_.memory(), solver_.memory(), other_.memory(),
            single_.memory()};
  }

  void restore(const Memory& memory) {
    start_ = memory.start;
    pose_ = memory.pose;
    tangent_ = memory.tangent;
    alpha_ = memory.alpha;
    factored_w_ = memory.factored_w;
    last_h_ = memory.last_h;
    share_ = memory.share;
    before_ = memory.before;
    has_factors_ = memory.has_factors;
    factored_ = memory.factored;
    slow_ = memory.slow;
    cells_.restore(memory.cells);
    single_.restore(memory.single);
    if (has_factors_) solver_.restore(memory.solver, tangent_.data());
    other_.restore(memory.other, single_.tangent().data());
    keep_start();
  }

 protected:
  using Base::f_, Base::lambda_, Base::m_, Base::n_, Base::phi_, Base::phid_, Base::phidd_, Base::solver_, Base::system_, Base::tangent_, Base::time_, Base::x_;

  template <std::size_t count, class Numbers>
  static std::array<Numbers, count> repeat(const Numbers& numbers) {
    std::array<Numbers, count> all;
    all.fill(numbers);
    return all;
  }

  void take_over() {
    alpha_ = single_.step_weights().constraint;
    last_h_ = before_ = Real(0);
    has_factors_ = factored_ = slow_ = false;
    keep_start();
    adopt();
  }

  void keep_start() {
    derivatives_[0] = start_.vdot;
    rates_[0] = start_.v;
    forces_[0] = start_.lambda;
  }

  void evaluate_at(const StateOf<S>& state) {
    if (cells_.empty()) return;
    system_.begin_step(state.t, Real(1));
    look_at(state);
  }

  void look_at(const StateOf<S>& state) {
    if constexpr (stepping::IndicatorCells<S>::has_indicators) system_.events(state.q.data(), state.v.data(), cells_.values());
  }

  void note(Real size, std::size_t speed, Real& largest) {
    if (size <= largest || largest != largest) return;
    largest = size;
    worst_ = speed;
  }

  /// Whether equations nearly depend on each other: then a large part of the loops' force Phi_q^T lambda is by multipliers outside alpha Phi_q A^-1 Phi_q^T lambda,
  /// with the tangent A.  The undetermined component of redundant equations is outside too, but has no force.
  bool is_singular() { return m_ > 0 && has_factors_ && carries_open_part(start_.lambda); }

  /// Put the component of multipliers that redundant equations leave undetermined into push_; return whether it has a tenth of their force.
  bool carries_open_part(const Equations<S>& lambda) {
    std::fill(push_.begin(), push_.end(), Real(0));
    if (this->follow_weight(pose_, pose_, lambda, trial_, push_)) return false;
    for (std::size_t i = 0; i < m_; ++i) push_[i] = lambda[i] - alpha_ * push_[i];
    system_.apply_jacobian_transposed(pose_.data(), push_.data(), trial_.data());
    system_.apply_jacobian_transposed(pose_.data(), lambda.data(), way_.data());
    return largest(trial_) > largest(way_) / 10;
  }

  /// The difference (d, e) of the two orders in delta and v, into way_ and x_, filtered for fast components, which it overestimates
  /// (Hairer, Wanner, section IV.8): (d', e') with e' = A^-1 (M e - w K d) and d' = d + w e', A being the tangent.  The balance of accelerations
  /// vdot + e/w at displacements -d is (M e - w K d)/w, but for what is of second order.
  Fault estimate(Real h) {
    const Real w = Table::gamma.template as<Real>() * h;
    std::fill(way_.begin(), way_.end(), Real(0));
    add_derivatives(h, Table::error, rates_, way_);
    probe_ = at_;
    add_derivatives(h / w, Table::error, derivatives_, probe_.vdot);
    for (std::size_t i = 0; i < n_; ++i) trial_[i] = -way_[i];
    retract<Real>(charts(), at_.q.data(), trial_.data(), probe_.q.data());
    this->dynamic_residual(probe_, Real(0));
    for (std::size_t i = 0; i < n_; ++i) x_[i] = w * f_[i];
    if (const Fault fault = this->solve()) return fault;
    for (std::size_t i = 0; i < n_; ++i) way_[i] += w * x_[i];
    return {};
  }

  Solver& other_;
  RecursiveNewton<S, Solver> single_;
  Closing<S> closing_;
  stepping::IndicatorCells<S> cells_;
  BallTangents<S> ball_tangents_;
  StateOf<S> row_, start_, at_, probe_;  ///< scratch, at the step's start, of a stage and finally the end, and a probe
  Coordinates<S> pose_, moved_;          ///< of the factors
  Equations<S> push_;
  Speeds<S> way_, delta_, trial_;
  std::array<Speeds<S>, Table::stages + 1> rates_, derivatives_;  ///< at the start and of the stages: delta' and accelerations
  std::array<Equations<S>, Table::stages + 1> forces_;       ///< the same of multipliers
  Residuals residuals_;
  stepping::Tolerances<Real> tolerances_;
  Real alpha_{1}, factored_w_{0}, last_h_{0}, share_{0.5}, before_{0};  ///< the last: of a change by the iteration before, and multipliers when their open part was sought
  bool has_factors_ = false;  ///< of a stage since the start
  bool factored_ = false, slow_ = false;  ///< whether these are usable, and whether the iteration was slow
  std::size_t worst_ = 0;
  long iterations_ = 0, evaluations_ = 0, factorisations_ = 0;
};

}  // namespace cutjoint::radau
