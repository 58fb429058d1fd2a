// The stages of a diagonally implicit step, by Newton's iteration on the accelerations.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "cutjoint/core/newton/closing.hpp"
#include "cutjoint/core/newton/recursive_newton.hpp"
#include "cutjoint/lagrangian/solver.hpp"
#include "cutjoint/state.hpp"
#include "cutjoint/core/road.hpp"
#include "cutjoint/sdirk/table.hpp"
#include "cutjoint/core/stepping/regime.hpp"
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
template <class S>
class Stages : public Workspace<S, LinearSolver<typename S::real_type>> {
  using Solver = LinearSolver<typename S::real_type>;
  using Base = Workspace<S, Solver>;

 public:
  using typename Base::Real;
  using Subject = S;

  static constexpr int order = Table::order;
  static constexpr bool estimates = true;  ///< an error

  /// `other` solves for the accelerations of single states; `switches` are those at which steps end, all or none of the system's.
  Stages(S& system, LinearSolver<Real>& solver, LinearSolver<Real>& other, const std::vector<Switch>& switches,
         const std::vector<Road<Real>>& roads)
      : Base(system, solver), d_(system.description()),
        single_(system, other, {.dt = 1.0, .penalty = std::nullopt, .tolerance = 1e-6, .iterations = 100, .multiplier_updates = 4}), closing_(system),
        places_(places_of(switches)), regime_(places_, roads.data()),
        turns_(unit_turns(system)), row_(d_.coordinates.size(), n_, m_), start_(row_), at_(row_), probe_(row_), pose_(start_.q), moved_(pose_), push_(m_),
        way_(n_), v_hat_(n_), delta_hat_(n_), delta_(n_), trial_(n_), guess_(n_), rates_(Table::stages + 1, delta_), slopes_(rates_),
        forces_(Table::stages + 1, push_), middle_(2, delta_), middle_forces_(2, push_) {}

  std::size_t size() const { return pose_.size() + n_; }
  std::span<const Chart> charts() const { return d_.charts; }

  /// Take over a start in relative coordinates.
  std::vector<Real> begin(const State<Real>& start) {
    system_.begin_step(start.t, Real(1));
    system_.initial_coordinates(start.q.data(), start.v.data(), start_.q.data(), start_.v.data());
    start_.t = start.t;
    require_none(single_.begin(start_, Real(1)), d_, "recursive-newton");
    alpha_ = single_.step_weights().constraint;
    last_h_ = Real(0);
    keep_start();
    adopt();
    std::vector<Real> y(start_.q);
    y.insert(y.end(), start_.v.begin(), start_.v.end());
    return y;
  }

  /// The state with its accelerations and multipliers; what that takes is no part of a step.
  const State<Real>& complete(Real t, const std::vector<Real>& y) {
    row_.t = t;
    const auto middle = y.begin() + static_cast<std::ptrdiff_t>(row_.q.size());
    std::copy(y.begin(), middle, row_.q.begin());
    std::copy(middle, y.end(), row_.v.begin());
    require_none(single_.begin(row_, Real(1)), d_, "recursive-newton");
    return row_;
  }

  /// What the error of a step may be; Newton's iteration ends where it leaves a hundredth of that.
  void set_tolerances(const Tolerances<Real>& tolerances) { tolerances_ = tolerances; }

  /// Try a step of length h from the present state; whether its stages were found.  Unless it shall be `whole`, it ends where it leaves the regime.
  bool attempt(Real h, bool whole, long number) {
    this->number_ = number;
    whole_ = whole;
    regime_.begin(start_.t);
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
      regime_.pass(time_);
    }
    at_.lambda = lambda_;
    return true;
  }

  /// The size of the attempted step's error, 1 being what is allowed; infinite where it is no number.
  Real error(Real h) {
    using std::abs;
    estimate(h);
    Real largest(0);
    for (const Chart& chart : d_.charts)
      for (int i = 0; i < chart.scalars + (chart.ball ? 3 : 0); ++i) {
        const auto q = static_cast<std::size_t>(chart.q + i), v = static_cast<std::size_t>(chart.v + i);
        const Real place = i < chart.scalars ? std::max(abs(start_.q[q]), abs(at_.q[q])) : Real(1);
        note(abs(way_[v]) / tolerances_.of(place), v, largest);
        note(abs(x_[v]) / tolerances_.of(std::max(abs(start_.v[v]), abs(at_.v[v]))), v, largest);
      }
    return largest == largest ? largest : std::numeric_limits<Real>::infinity();
  }

  /// The attempted step counts: its end becomes the present state, and `before` the one before it.
  void accept(Real h, State<Real>& before) {
    at_.t = start_.t + h;
    project(at_);
    last_h_ = h;
    middle_[0].swap(slopes_[4]);
    middle_[1].swap(slopes_[2]);
    middle_forces_[0].swap(forces_[4]);
    middle_forces_[1].swap(forces_[2]);
    std::swap(before, start_);
    std::swap(start_, at_);
    keep_start();
  }

  const State<Real>& present() const { return start_; }

  /// Accelerations and multipliers of a state, where guides need them: those of the stages only come near to them.
  void accelerate(State<Real>& state) {
    if (!d_.driven) return;
    row_ = state;
    if (!single_.begin(row_, Real(1))) state = row_;  // a singular pose has none
  }

  /// The displacement by the last step before its end was projected, in the chart of its start.
  const std::vector<Real>& moved() const { return delta_; }

  /// Coordinates and speeds of another state, which closes the loops, become those of the present one; `restart` has to follow.
  void go_to(const State<Real>& state) {
    start_.t = state.t;
    start_.q = state.q;
    start_.v = state.v;
  }

  /// Accelerations and multipliers of the present state, which forces that jump change; factors and what stages are guessed by are forgotten.
  void restart() {
    const long evaluations = single_.evaluations(), factorisations = single_.factorisations();
    require_none(single_.begin(start_, Real(1)), d_, "recursive-newton");
    evaluations_ += single_.evaluations() - evaluations;
    factorisations_ += single_.factorisations() - factorisations;
    last_h_ = Real(0);
    factored_ = slow_ = false;
    keep_start();
  }

  /// Go over to the regime of the present state.
  void adopt() {
    if (regime_.empty()) return;
    switch_at(start_);
    regime_.adopt();
  }

  /// Seek the switches that a state has out of the regime; whether there are any.
  bool seek(const State<Real>& state) {
    if (regime_.empty()) return false;
    switch_at(state);
    return regime_.seek();
  }

  /// The first of them that a state has out of the regime; as many as there are switches if there is none.
  std::size_t found(const State<Real>& state) {
    if (regime_.empty()) return 0;
    switch_at(state);
    return regime_.found();
  }

  stepping::Regime<S>& regime() { return regime_; }

  /// Close the loops of a state, positions first, then speeds.  Returns what is left.
  Residuals project(State<Real>& state) {
    if (m_ == 0) return {};
    time_ = state.t;
    system_.begin_step(state.t, Real(1));
    Residuals left;
    require(this->close_with(state, pose_, alpha_, closing_, way_, moved_, left));
    return left;
  }

  long iterations() const { return iterations_; }

  // With what restarts take.
  long evaluations() const { return Base::evaluations() + evaluations_; }
  long factorisations() const { return Base::factorisations() + factorisations_; }

  /// The coordinate of the last attempt's largest error or change.
  std::string worst() const { return std::string(d_.unknowns()[worst_]); }

 private:
  using Base::f_, Base::lambda_, Base::m_, Base::n_, Base::phi_, Base::phid_, Base::phidd_, Base::system_, Base::time_, Base::x_;

  /// Throws the Failure of a fault.
  void require(const Fault& fault) const { require_none(fault, d_, "sdirk4"); }

  void keep_start() {
    slopes_[0] = start_.vdot;
    forces_[0] = start_.lambda;
  }

  void switch_at(const State<Real>& state) {
    system_.begin_step(state.t, Real(1));
    system_.events(state.q.data(), state.v.data(), regime_.values());
  }

  /// Whether the attempt leaves the regime with the stage as it is, and shall end there.
  bool leaves() {
    if (regime_.empty()) return false;
    system_.events(at_.q.data(), at_.v.data(), regime_.values());
    regime_.look(time_);
    return regime_.crossed() && !whole_;
  }

  /// The same of a stage that is not found, or slowly: as it is, and as it was guessed, which is where the regime before would lead.
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
  void estimate(Real h) {
    const Real w = Table::gamma.as<Real>() * h;
    std::fill(way_.begin(), way_.end(), Real(0));
    add_slopes(h, Table::error, rates_, way_);
    probe_ = at_;
    add_slopes(h / w, Table::error, slopes_, probe_.vdot);
    for (std::size_t i = 0; i < n_; ++i) trial_[i] = -way_[i];
    retract<Real>(d_.charts, at_.q.data(), trial_.data(), probe_.q.data());
    this->dynamic_residual(probe_, Real(0));
    for (std::size_t i = 0; i < n_; ++i) x_[i] = w * f_[i];
    require(this->solve());
    for (std::size_t i = 0; i < n_; ++i) way_[i] += w * x_[i];
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
    chart_rates<Real>(d_.charts, delta_.data(), at_.v.data(), rates_[stage].data());
    slopes_[stage] = at_.vdot;
    forces_[stage] = lambda_;
    return {};
  }

  static void guess(std::size_t stage, const std::vector<std::vector<Real>>& known, std::vector<Real>& values) {
    std::fill(values.begin(), values.end(), Real(0));
    add_slopes(Real(1), Table::guess[stage], known, values);
  }

  /// The first stage's: on the parabola through the last step's half, three quarters and end, unless that is far behind.
  void extrapolate(Real h, const std::vector<Real>& end, const std::vector<std::vector<Real>>& middle, std::vector<Real>& values) const {
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

  /// An iteration.  What violates the equations is corrected along their directions in the pose of the tangent, Phi_q; and so are the multipliers,
  /// by alpha (Phidd + Phi_q dvdot): the new Phidd is another one where Phi_q has turned, and alpha would make much of that.
  Fault correct(bool renew, Real w) {
    this->constraint_residual(at_);
    if (renew) {
      this->linearise(at_, Real(0), {w, w * w, alpha_, turns_.data()});
      pose_ = at_.q;
      if (const Fault fault = this->factor()) return fault;
      factored_ = true;
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
      chart_rates<Real>(d_.charts, delta_.data(), at_.v.data(), trial_.data());
      change = Real(0);
      for (std::size_t i = 0; i < n_; ++i) {
        const Real next = delta_hat_[i] + w * trial_[i];
        change = std::max(change, abs(next - delta_[i]) / (Real(1) + abs(next)));
        delta_[i] = next;
      }
      if (turns_.empty()) change = Real(0);
    }
    retract<Real>(d_.charts, start_.q.data(), delta_.data(), at_.q.data());
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

  const SystemDescription& d_;
  RecursiveNewton<S, Solver> single_;
  Closing<S> closing_;
  std::vector<SwitchPlace> places_;
  stepping::Regime<S> regime_;
  std::vector<Real> turns_;
  State<Real> row_, start_, at_, probe_;  ///< of a row, at the step's start, of a stage, and beside it
  std::vector<Real> pose_, moved_;    ///< that of the factors
  std::vector<Real> push_, way_;
  std::vector<Real> v_hat_, delta_hat_, delta_, trial_, guess_;
  std::vector<std::vector<Real>> rates_, slopes_, forces_;  ///< at the start and of the stages: delta', accelerations and multipliers
  std::vector<std::vector<Real>> middle_, middle_forces_;   ///< the last two at a half and three quarters of the step before
  Tolerances<Real> tolerances_;
  Real alpha_{1}, factored_w_{0}, last_h_{0}, share_{0.5};  ///< the last: of a change by the iteration before
  bool factored_ = false, slow_ = false, whole_ = false;
  std::size_t worst_ = 0;
  long iterations_ = 0, evaluations_ = 0, factorisations_ = 0;
};

}  // namespace cutjoint::sdirk
