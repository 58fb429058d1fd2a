// The stages of a diagonally implicit step, by Newton's iteration on the accelerations.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <span>
#include <utility>

#include "cutjoint/core/arrays.hpp"
#include "cutjoint/core/fault.hpp"
#include "cutjoint/core/mechanism.hpp"
#include "cutjoint/core/newton/closing.hpp"
#include "cutjoint/core/newton/recursive_newton.hpp"
#include "cutjoint/core/newton/system.hpp"
#include "cutjoint/core/newton/workspace.hpp"
#include "cutjoint/core/retraction.hpp"
#include "cutjoint/core/road.hpp"
#include "cutjoint/core/sdirk/table.hpp"
#include "cutjoint/core/state.hpp"
#include "cutjoint/core/stepping/switch_cells.hpp"
#include "cutjoint/core/stepping/step_control.hpp"

namespace cutjoint::sdirk {

using stepping::Tolerances;

/// The unknown of a stage is its acceleration, from which follow, with w = h gamma and the sums hat over the stages before,
///
///     v = v_hat + w vdot         delta = delta_hat + w T(delta)^-1 v         q = retract(q_0, delta)
///
/// where delta is the displacement from the step's start: the method integrates (delta, v), so that its order holds on balls too.  Loops are
/// equations of the accelerations, M vdot + Phi_q^T lambda = Q and Phidd = 0: a differential equation, whose order does not suffer.  The iteration
///
///     (M + w C + w^2 K + alpha Phi_q^T Phi_q) dvdot = -(M vdot + Phi_q^T lambda - Q + alpha Phi_q^T Phidd),    lambda += alpha (Phidd + Phi_q dvdot)
///
/// keeps its factors over stages and steps while they serve.  What steps leave of Phi and Phid is projected away.
template <class S, class Solver>
class Stages : public Workspace<S, Solver> {
  using Base = Workspace<S, Solver>;

  template <std::size_t count, class Numbers>
  static std::array<Numbers, count> repeat(const Numbers& numbers) {
    std::array<Numbers, count> all;
    all.fill(numbers);
    return all;
  }

 public:
  using typename Base::Real;
  using Subject = S;

  static constexpr int order = Table::order;
  static constexpr bool estimates = true;  ///< an error

  /// `other` solves for the accelerations of single states; `switches` are where those stand at which steps end, all or none of the system's, and
  /// `roads` those of its tyres.
  Stages(S& system, Solver& solver, Solver& other, SwitchPlaces<S> switches, const Road<Real>* roads)
      : Base(system, solver), other_(other), single_(system, other, {.dt = 1.0, .penalty = std::nullopt, .tolerance = 1e-6, .iterations = 100, .multiplier_updates = 4}),
        closing_(system), cells_(std::move(switches), roads), turns_(unit_turns(system)), row_(design_state(system)), start_(row_), at_(row_), probe_(row_), pose_(row_.q),
        moved_(pose_), push_(m_), way_(n_), v_hat_(n_), delta_hat_(n_), delta_(n_), trial_(n_), guess_(n_),
        rates_(repeat<Table::stages + 1>(delta_)), slopes_(rates_), forces_(repeat<Table::stages + 1>(push_)), middle_(repeat<2>(delta_)),
        middle_forces_(repeat<2>(push_)) {}

  std::size_t size() const { return pose_.size() + n_; }
  using Base::charts;

  /// Take over a start, whose accelerations and multipliers are found.
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

  /// Put accelerations and multipliers into a state; what that takes is no part of a step.
  Fault complete(StateOf<S>& state) { return single_.begin(state, Real(1)); }

  /// Go on from a state as it is, which is taken over.
  Fault go_on(StateOf<S>& state) {
    const Fault fault = single_.go_on(state);
    if (fault) return fault;
    start_ = state;
    take_over();
    return {};
  }

  /// Close the loops of a state away from any step, by moving the masses least.
  Fault assemble(StateOf<S>& state) { return single_.assemble(state); }

  /// Set the largest error of a step; Newton's iteration ends where it leaves a hundredth of that.
  void set_tolerances(const Tolerances<Real>& tolerances) { tolerances_ = tolerances; }

  /// Try a step of length h from the present state; whether its stages were found.  Unless it shall be `whole`, it ends where it leaves the regime.
  bool attempt(Real h, bool whole, long number) {
    this->number_ = number;
    whole_ = whole;
    cells_.begin(start_.t);
    for (std::size_t stage = 1; stage <= Table::stages; ++stage) {
      bool found = false;
      if (try_stage(stage, h, found)) {  // no factors, or no finite value
        factored_ = false;
        leaves_early(h);
        return false;
      }
      if (!found) {
        leaves_early(h);
        return false;
      }
      if (leaves()) return false;
      cells_.pass(time_);
    }
    at_.lambda = lambda_;
    return true;
  }

  /// The size of the attempted step's error, 1 being what is allowed; infinite where it is no number.
  Real error(Real h) {
    using std::abs;
    if (estimate(h)) return std::numeric_limits<Real>::infinity();
    Real largest(0);
    for (const Chart& chart : charts())
      for (int i = 0; i < chart.scalars + (chart.ball ? 3 : 0); ++i) {
        const auto q = static_cast<std::size_t>(chart.q + i), v = static_cast<std::size_t>(chart.v + i);
        const Real place = i < chart.scalars ? std::max(abs(start_.q[q]), abs(at_.q[q])) : Real(1);
        note(abs(way_[v]) / tolerances_.of(place), v, largest);
        note(abs(x_[v]) / tolerances_.of(std::max(abs(start_.v[v]), abs(at_.v[v]))), v, largest);
      }
    for (std::size_t i = first_state(charts()); i < n_; ++i) note(abs(x_[i]) / tolerances_.of(std::max(abs(start_.v[i]), abs(at_.v[i]))), i, largest);
    return largest == largest ? largest : std::numeric_limits<Real>::infinity();
  }

  /// The attempted step counts: its end becomes the present state, and `before` the one before it.
  Fault accept(Real h, StateOf<S>& before) {
    at_.t = start_.t + h;
    if (const Fault fault = project(at_)) return fault;
    last_h_ = h;
    middle_[0].swap(slopes_[4]);
    middle_[1].swap(slopes_[2]);
    middle_forces_[0].swap(forces_[4]);
    middle_forces_[1].swap(forces_[2]);
    std::swap(before, start_);
    std::swap(start_, at_);
    keep_start();
    return {};
  }

  const StateOf<S>& present() const { return start_; }

  /// Accelerations and multipliers of a state, where guides need them: those of the stages only come near to them.
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

  /// Accelerations and multipliers of the present state, which forces that jump change; factors and what stages are guessed by are forgotten.
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

  /// Inputs have jumped: where forces may have changed their formulas, accelerations and regime are those of the present state.
  void restart_after_input_jump() {
    if (cells_.empty()) return;
    adopt();
    row_ = start_;
    if (single_.begin(row_, Real(1))) return;  // a singular pose keeps what it has
    start_ = row_;
    last_h_ = Real(0);
    keep_start();
  }

  /// Go over to the regime of the present state.
  void adopt() {
    if (cells_.empty()) return;
    switch_at(start_);
    cells_.adopt();
  }

  /// Seek the switches that a state has out of the regime; whether there are any.
  bool seek(const StateOf<S>& state) {
    if (cells_.empty()) return false;
    switch_at(state);
    return cells_.seek();
  }

  /// The first of them that a state has out of the regime; as many as there are switches if there is none.
  std::size_t found(const StateOf<S>& state) {
    if (cells_.empty()) return 0;
    switch_at(state);
    return cells_.found();
  }

  stepping::SwitchCells<S>& cells() { return cells_; }

  /// Close the loops of a state, positions first, then speeds.
  Fault project(StateOf<S>& state) {
    residuals_ = {};
    if (m_ == 0) return {};
    if (!has_factors_) return single_.assemble(state);
    time_ = state.t;
    system_.begin_step(state.t, Real(1));
    return this->close_with(state, pose_, alpha_, closing_, way_, moved_, residuals_);
  }

  /// The residuals of the equations after it.
  const Residuals& residuals() const { return residuals_; }

  long iterations() const { return iterations_; }

  /// The values of the last tangent.
  const Entries<S>& tangent() const { return tangent_; }

  // With what restarts take.
  long evaluations() const { return Base::evaluations() + evaluations_; }
  long factorisations() const { return Base::factorisations() + factorisations_; }

  /// Why the last attempt, whose stages were `found` or not, is not taken in a shorter step; `size` is that of its error.
  Fault give_up(bool found, bool adaptive, long number, Real size) const {
    const Cause cause = found ? Cause::tolerance_not_met : adaptive ? Cause::stages_not_found : Cause::stage_not_converged;
    Fault fault = this->fault_in_row(cause, static_cast<int>(worst_), size);
    fault.t = static_cast<double>(start_.t);
    fault.step = number;
    return fault;
  }

  /// Memory of the next steps, that of the regime and the solvers included; flags are as long as numbers, so that equal ones have equal bytes.
  struct Memory {
    StateOf<S> start;
    std::array<Speeds<S>, 2> middle;
    std::array<Equations<S>, 2> middle_forces;
    Coordinates<S> pose;
    Entries<S> tangent;
    Real alpha, factored_w, last_h, share;
    long has_factors, factored, slow;
    typename stepping::SwitchCells<S>::Memory cells;
    typename Solver::Memory solver, other;
    typename RecursiveNewton<S, Solver>::Memory single;
  };

  Memory memory() const {
    return {start_, middle_, middle_forces_, pose_, tangent_, alpha_, factored_w_, last_h_, share_, has_factors_, factored_, slow_, cells_.memory(),
            solver_.memory(), other_.memory(), single_.memory()};
  }

  void restore(const Memory& memory) {
    start_ = memory.start;
    middle_ = memory.middle;
    middle_forces_ = memory.middle_forces;
    pose_ = memory.pose;
    tangent_ = memory.tangent;
    alpha_ = memory.alpha;
    factored_w_ = memory.factored_w;
    last_h_ = memory.last_h;
    share_ = memory.share;
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
  using Base::system_;

 private:
  using Base::f_, Base::lambda_, Base::m_, Base::n_, Base::phi_, Base::phid_, Base::phidd_, Base::solver_, Base::tangent_, Base::time_,
      Base::x_;

  void take_over() {
    alpha_ = single_.step_weights().constraint;
    last_h_ = Real(0);
    has_factors_ = factored_ = slow_ = false;
    keep_start();
    adopt();
  }

  void keep_start() {
    slopes_[0] = start_.vdot;
    forces_[0] = start_.lambda;
  }

  void switch_at(const StateOf<S>& state) {
    system_.begin_step(state.t, Real(1));
    look_at(state);
  }

  void look_at(const StateOf<S>& state) {
    if constexpr (stepping::SwitchCells<S>::can_switch) system_.events(state.q.data(), state.v.data(), cells_.values());
  }

  /// Whether the attempt leaves the regime with the stage as it is, and shall end there.
  bool leaves() {
    if (cells_.empty()) return false;
    look_at(at_);
    cells_.look(time_);
    return cells_.crossed() && !whole_;
  }

  /// Whether a stage leaves the regime that is not found, or slowly: as it is, or as it was guessed.  The guess is where the regime before
  /// would lead.
  bool leaves_early(Real h) {
    if (leaves()) return true;
    const Real w = Table::gamma.as<Real>() * h;
    at_.vdot.swap(guess_);
    follow(w);
    const bool out = leaves();
    at_.vdot.swap(guess_);
    follow(w);
    return out;
  }

  void note(Real size, std::size_t speed, Real& largest) {
    if (size <= largest || largest != largest) return;
    largest = size;
    worst_ = speed;
  }

  /// The difference (d, e) of the two orders in delta and v, into way_ and x_, without what is fast beside a step, which it overstates
  /// (Hairer, Wanner, section IV.8): (d', e') with e' = A^-1 (M e - w K d) and d' = d + w e', A being the tangent.  The balance of accelerations
  /// vdot + e/w at displacements -d is (M e - w K d)/w, but for what is of second order.
  Fault estimate(Real h) {
    const Real w = Table::gamma.as<Real>() * h;
    std::fill(way_.begin(), way_.end(), Real(0));
    add_slopes(h, Table::error, rates_, way_);
    probe_ = at_;
    add_slopes(h / w, Table::error, slopes_, probe_.vdot);
    for (std::size_t i = 0; i < n_; ++i) trial_[i] = -way_[i];
    retract<Real>(charts(), at_.q.data(), trial_.data(), probe_.q.data());
    this->dynamic_residual(probe_, Real(0));
    for (std::size_t i = 0; i < n_; ++i) x_[i] = w * f_[i];
    if (const Fault fault = this->solve()) return fault;
    for (std::size_t i = 0; i < n_; ++i) way_[i] += w * x_[i];
    return {};
  }

  /// Whether a stage is `found`; a fault where an iteration has no factors.
  Fault try_stage(std::size_t stage, Real h, bool& found) {
    time_ = at_.t = start_.t + Table::nodes[stage].template as<Real>() * h;
    system_.begin_step(time_, Real(1));
    v_hat_ = start_.v;
    add_slopes(h, Table::weights[stage], slopes_, v_hat_);
    std::fill(delta_hat_.begin(), delta_hat_.end(), Real(0));
    add_slopes(h, Table::weights[stage], rates_, delta_hat_);
    delta_ = delta_hat_;
    if (stage == 1) {
      extrapolate(h, slopes_[0], middle_, at_.vdot);
      extrapolate(h, forces_[0], middle_forces_, lambda_);
    } else {
      guess(stage, slopes_, at_.vdot);
      guess(stage, forces_, lambda_);
    }
    guess_ = at_.vdot;
    if (const Fault fault = iterate(h, found); fault || !found) return fault;
    chart_rates<Real>(charts(), delta_.data(), at_.v.data(), rates_[stage].data());
    copy_states(charts(), at_.v, rates_[stage].begin());
    slopes_[stage] = at_.vdot;
    forces_[stage] = lambda_;
    return {};
  }

  template <class Numbers>
  static void guess(std::size_t stage, const std::array<Numbers, Table::stages + 1>& known, Numbers& values) {
    std::fill(values.begin(), values.end(), Real(0));
    add_slopes(Real(1), Table::guess[stage], known, values);
  }

  /// The first stage's: on the parabola through the last step's half, three quarters and end, unless that is far behind.
  template <class Numbers>
  void extrapolate(Real h, const Numbers& end, const std::array<Numbers, 2>& middle, Numbers& values) const {
    const Real s = last_h_ > Real(0) && h <= 2 * last_h_ ? h / last_h_ : Real(0);
    for (std::size_t i = 0; i < values.size(); ++i)
      values[i] = s * (s + 1) / 2 * middle[0][i] - s * (s + 2) * middle[1][i] + (s + 1) * (s + 2) / 2 * end[i];
  }

  /// Newton's iteration for a stage; whether it is `found`.  The first change is judged by the share that a stage before left of one, less and less
  /// trusted (Hairer, Wanner, section IV.8).  Where it goes slowly it may have met a stiff force that begins in this step.
  Fault iterate(Real h, bool& found) {
    using std::pow;
    const Real w = Table::gamma.as<Real>() * h;
    const Real infinity = std::numeric_limits<Real>::infinity();
    Real last = infinity, smallest = infinity, move(0);
    bool renew = !factored_ || slow_ || !(w < factored_w_ * Real(1.25) && w > factored_w_ * Real(0.8));
    slow_ = false;
    for (int iteration = 1, idle = 0; iteration <= most_iterations && follow(w); ++iteration) {
      if (const Fault fault = correct(renew, w)) return fault;
      const Real change = size_of_change(w, move), share = iteration > 1 ? change / last : renew ? Real(0.5) : pow(share_, Real(0.8));
      if (!this->finite(change) || change > Real(1e3) * smallest) return {};
      share_ = std::clamp(share, Real(0.01), Real(0.99));
      idle = change < smallest / 2 ? 0 : idle + 1;
      smallest = std::min(smallest, change);
      const Real digits = (idle >= 3 ? 4096 : 64) * std::numeric_limits<Real>::epsilon();
      const bool rounding = idle > 0 && move <= digits * (Real(1) + largest(at_.v));
      if (rounding || (share < Real(1) && change * share / (1 - share) <= Real(0.001))) {
        found = follow(w);
        return {};
      }
      renew = iteration > 1 && share > Real(0.3);
      if (renew && leaves_early(h)) return {};
      slow_ = slow_ || renew;
      last = change;
    }
    return {};
  }

  /// An iteration.  Gaps of the equations are corrected along their directions in the pose of the tangent, Phi_q.  So are the multipliers,
  /// by alpha (Phidd + Phi_q dvdot): where Phi_q has turned, the new Phidd is another one, and alpha would enlarge the difference.
  Fault correct(bool renew, Real w) {
    this->constraint_residual(at_);
    if (renew) {
      this->linearise(at_, Real(0), {w, w * w, alpha_, turns_.data()});
      pose_ = at_.q;
      if (const Fault fault = this->factor()) return fault;
      has_factors_ = factored_ = true;
      factored_w_ = w;
    } else {
      this->dynamic_residual(at_, Real(0));
    }
    for (std::size_t i = 0; i < m_; ++i) push_[i] = alpha_ * phidd_[i];
    system_.apply_jacobian_transposed(pose_.data(), push_.data(), x_.data());
    for (std::size_t i = 0; i < n_; ++i) x_[i] = -f_[i] - x_[i];
    if (const Fault fault = this->solve()) return fault;
    system_.apply_jacobian(pose_.data(), x_.data(), push_.data());
    for (std::size_t i = 0; i < m_; ++i) lambda_[i] += alpha_ * (phidd_[i] + push_[i]);
    for (std::size_t i = 0; i < n_; ++i) at_.vdot[i] += x_[i];
    ++iterations_;
    return {};
  }

  /// Speeds and coordinates of the stage's accelerations; false where a ball turns too far for its chart.
  bool follow(Real w) {
    using std::abs;
    for (std::size_t i = 0; i < n_; ++i) at_.v[i] = v_hat_[i] + w * at_.vdot[i];
    Real change(1);
    for (int pass = 0; pass < 40 && change > 4 * std::numeric_limits<Real>::epsilon(); ++pass) {
      chart_rates<Real>(charts(), delta_.data(), at_.v.data(), trial_.data());
      copy_states(charts(), at_.v, trial_.begin());
      change = Real(0);
      for (std::size_t i = 0; i < n_; ++i) {
        const Real next = delta_hat_[i] + w * trial_[i];
        change = std::max(change, abs(next - delta_[i]) / (Real(1) + abs(next)));
        delta_[i] = next;
      }
      if (turns_.empty()) change = Real(0);
    }
    retract<Real>(charts(), start_.q.data(), delta_.data(), at_.q.data());
    return change <= 64 * std::numeric_limits<Real>::epsilon();
  }

  /// The largest change of a speed by an iteration beside what its error may be; without that measure, `move`.
  Real size_of_change(Real w, Real& move) {
    using std::abs;
    Real largest(0);
    for (std::size_t i = 0; i < n_; ++i) note(w * abs(x_[i]) / tolerances_.of(abs(start_.v[i])), i, largest);
    move = w * cutjoint::largest(x_);
    return largest;
  }

  static constexpr int most_iterations = 25;

  Solver& other_;
  RecursiveNewton<S, Solver> single_;
  Closing<S> closing_;
  stepping::SwitchCells<S> cells_;
  Turns<S> turns_;
  StateOf<S> row_, start_, at_, probe_;  ///< room, at the step's start, of a stage, and beside it
  Coordinates<S> pose_, moved_;          ///< that of the factors
  Equations<S> push_;
  Speeds<S> way_, v_hat_, delta_hat_, delta_, trial_, guess_;
  std::array<Speeds<S>, Table::stages + 1> rates_, slopes_;  ///< at the start and of the stages: delta' and accelerations
  std::array<Equations<S>, Table::stages + 1> forces_;       ///< the same of multipliers
  std::array<Speeds<S>, 2> middle_;                          ///< the last two at a half and three quarters of the step before
  std::array<Equations<S>, 2> middle_forces_;
  Residuals residuals_;
  Tolerances<Real> tolerances_;
  Real alpha_{1}, factored_w_{0}, last_h_{0}, share_{0.5};  ///< the last: of a change by the iteration before
  bool has_factors_ = false;  ///< of a stage since the start
  bool factored_ = false, slow_ = false, whole_ = false;  ///< the first: whether these serve
  std::size_t worst_ = 0;
  long iterations_ = 0, evaluations_ = 0, factorisations_ = 0;
};

}  // namespace cutjoint::sdirk
