// The trapezoidal rule in positions with Newton's iteration, and projections of velocities and accelerations: what the two Lagrangian
// methods of Cuadrado et al. 2000 (sections 2.1 and 2.2) share.
#pragma once

#include <optional>

#include "cutjoint/core/newton/step_rule.hpp"
#include "cutjoint/core/newton/workspace.hpp"

namespace cutjoint {

/// Settings of a Lagrangian method.  `tolerance` and `iterations` mean what they mean to the fixed point (trapezoidal.hpp); the augmented
/// method corrects its multipliers in the first `multiplier_updates` iterations of a step and has the `penalty` alpha, or finds one.  With
/// `fixed_cost` a step has so many `iterations`, each with a tangent of its own, and is not divided.
struct NewtonSettings {
  double dt;
  std::optional<double> penalty;
  double tolerance;
  int iterations;
  int multiplier_updates;
  StepRule rule{};
  bool fixed_cost = false;
};

/// Integrates a system with steps of equal length.  The unknown of a step is the acceleration at its end, from which follow
///
///     v = v_n + dt/2 (vdot_n + vdot)         q = q_n + dt v_n + dt^2/4 (vdot_n + vdot)
///
/// (or as another StepRule has it), which is the rule of [eqs. 4-5] without its differences of large numbers, qd = 2/dt (q - q_n) - qd_n and
/// qdd = 4/dt^2 (q - q_n) - 4/dt qd_n - qdd_n, that cost a small step its digits.  Newton's equations remain those for dq = dt^2/4 dvdot.
///
/// In the form of Arnold and Bruels (Multibody System Dynamics 18 (2007) 185-202), generalised-alpha has M vdot + Phi_q^T lambda = Q and
/// Phi = 0 at the end of each step, as the trapezoidal rule has them here; a, which has no equation of its own, is stored beside the state.
///
/// The tangent leaves out how the multipliers' directions turn, (Phi_q^T)_q lambda, as the paper does; convergence is linear with a
/// factor of the order of dt^2/4 lambda / (mass length).
///
/// `Own` is the method, which derives from it and says what it does in
///
/// - `weights` and `start_weights`, of the tangent of a step and of the matrix that gives accelerations,
/// - `right_of_start` and `approach`, the right-hand sides of iterations, of a step with the tangent where that is renewed,
/// - `update_multipliers` at the end of a step, whose Phi is known,
/// - `project_on`, which brings rates, whose violation is Phid, or accelerations, whose violation is Phidd, to the equations; what is left stays in `violation`,
/// - and whatever it has instead of the functions under "what methods may have of their own".
template <class Own, class S, class Solver>
class Newton : public Workspace<S, Solver> {
 public:
  using Base = Workspace<S, Solver>;
  using typename Base::Real;

  Newton(S& system, Solver& solver, const NewtonSettings& settings)
      : Base(system, solver), settings_(settings), length_(settings.dt), dt_(length_),
        share_(Real(1 - settings.rule.alpha_f) / Real(1 - settings.rule.alpha_m)), speed_(dt_ * Real(settings.rule.gamma) * share_),
        k_(dt_ * dt_ * Real(settings.rule.beta) * share_), ball_tangents_(unit_ball_tangents(system)), lambda_before_(m_), vdot_before_(n_),
        predicted_(n_), before_(design_state(system)), whole_(before_), mean_(n_), whole_mean_(n_), delta_(n_), full_(x_.size()), full_vdot_(n_),
        full_lambda_(m_), kept_now_(m_), kept_before_(m_) {}

  /// Accelerations and multipliers of a start, whose coordinates and rates satisfy the equations.
  Fault begin(StateOf<S>& state, Real motion) {
    get_ready(state, motion);
    if (const Fault fault = require_start(state)) return fault;
    return accelerate(state);
  }

  /// Accelerations and multipliers of a state as it is, from which the next step goes on.
  Fault go_on(StateOf<S>& state) {
    get_ready(state, Real(1));
    const Fault fault = accelerate(state);
    if (!fault) stay(state);
    return fault;
  }

  /// Forces have jumped: accelerations and multipliers of a state, by the factors of the step that ended there while these converge quickly.
  void follow_jump(StateOf<S>& state) {
    if (!factored_ || settings_.fixed_cost) return follow_sample(state);
    whole_ = state;
    system_.begin_step(state.t, Real(1));
    time_ = state.t;
    lambda_ = state.lambda;
    if (iterate_accelerations(whole_, own().weights().constraint, true)) return follow_sample(state);
    state = whole_;
    state.lambda = lambda_;
    stay(state);
  }

  /// A controller has changed forces: accelerations by a tangent of their own.  A singular pose keeps those that it has.
  void follow_sample(StateOf<S>& state) {
    whole_ = state;
    if (!go_on(whole_)) state = whole_;
  }

  /// Go on from a state that has accelerations and multipliers, with a tangent of its own.
  void resume(const StateOf<S>& state) {
    get_ready(state, Real(1));
    own().choose_weights(state);
    stay(state);
    take_means(state.vdot);
  }

  /// One step; `state` is that at its end.  Where it fails `state` is the last one that converged, and the system is at its time.
  [[gnu::noinline]] Fault step(StateOf<S>& state, long number) {
    this->number_ = number;
    const Fault fault = advance(state);
    if (!fault || (!settings_.fixed_cost && own().halves() && advance_by_parts(state))) return {};
    if (!settings_.fixed_cost && number_of_states(this->system_) != 0 && has_lost_its_way(fault) && advance_damped(state)) return {};
    system_.begin_step(state.t, Real(1));
    return fault;
  }

  /// Settings of the next steps.
  NewtonSettings& settings() { return settings_; }

  /// Go on with steps of another length.
  void set_step(Real length) {
    if (length == length_) return;
    length_ = length;
    stride(Real(1));
  }

  /// Let the next step begin with the state's accelerations and multipliers: those before belong to another length, or to an attempt.
  void stay(const StateOf<S>& state) {
    vdot_before_ = state.vdot;
    lambda_ = lambda_before_ = state.lambda;
  }

  /// The accelerations a, which rules that average go on with, and a step back to others.
  const Speeds<S>& means() const { return mean_; }
  void take_means(const Speeds<S>& means) { mean_ = means, ++restarts_; }

  /// How often these have become other ones than those of the last step.
  long restarts() const { return restarts_; }

  /// Weights of the tangent of a step.
  Weights<Real> step_weights() const { return own().weights(); }

  /// Memory of the next steps, besides the state; `factored` is as long as a number, so that equal ones have equal bytes.
  struct Memory {
    Equations<S> lambda, lambda_before;
    Speeds<S> vdot_before, mean;
    Entries<S> tangent;
    Real length, contraction;
    long factored;
  };

  Memory memory() const { return {lambda_, lambda_before_, vdot_before_, mean_, tangent_, length_, contraction_, factored_}; }

  /// The solver has to restore its factors too.
  void restore(const Memory& memory) {
    length_ = memory.length;
    stride(Real(1));
    lambda_ = memory.lambda;
    lambda_before_ = memory.lambda_before;
    vdot_before_ = memory.vdot_before;
    mean_ = memory.mean;
    tangent_ = memory.tangent;
    contraction_ = memory.contraction;
    factored_ = memory.factored;
  }

  /// The values of the last tangent, and whether there are factors of a step.
  const Entries<S>& tangent() const { return tangent_; }
  bool has_factors() const { return factored_; }

  long iterations() const { return iterations_; }

  /// What the last iteration changed the accelerations by, as a share of 1 + the largest of them.
  double change() const { return static_cast<double>(change_ / size_); }

  /// How many parts the steps that were divided have been taken in.
  long substeps() const { return substeps_; }

  /// Residuals of the last state.
  const Residuals& residuals() const { return residuals_; }

 protected:
  using Base::lambda_, Base::m_, Base::n_, Base::phi_, Base::phid_, Base::phidd_, Base::system_, Base::tangent_, Base::time_, Base::x_;
  using Base::finite, Base::rounding_like;

  // Members that methods may have of their own.

  void choose_weights(const StateOf<S>&) {}                              ///< of the equations against the masses
  void weigh() {}                                                   ///< the same for another length of the step
  Fault examine() { return {}; }                                    ///< whether the matrix of the start is singular without its solver having noticed
  void correct_start(Real) {}                                       ///< multipliers from Phidd
  bool renews_always() const { return true; }                       ///< whether each iteration has a tangent of its own
  bool halves() const { return false; }                             ///< whether a step that fails is taken in halves
  bool extrapolates() const { return true; }                        ///< whether multipliers go on as in the step before
  bool may_end() const { return true; }                             ///< whether a step may end with this iteration
  void take_multipliers(Real) {}                                    ///< those of the solution, by their weight in the tangent
  Fault explain(const Fault& fault) { return fault; }               ///< what more there is to say of an iteration without end
  Real negligible(Real size) const { return rounding_like(1e-11) * size; }  ///< the violation beside a quantity of this size that a projection may leave

  bool is_damped() const { return damped_; }  ///< whether changes are shortened, after trials with an iteration of number 0

  /// Whether the last iteration changed the accelerations by little already, or the coordinates, in a short step, by rounding.
  bool is_near() const { return change_ <= std::max(Real(1e-3) * size_, rounding_ / k_); }

  /// The share by which the factors in use differ from those of the state, as iterations have shown, and what these may leave of accelerations.
  Real age() const { return std::min(contraction_, Real(1)); }
  Real left() const { return Real(settings_.tolerance) * size_; }

  /// Forget the factors of a step, since others of a state come.
  void get_ready(const StateOf<S>& state, Real motion) {
    time_ = state.t;
    factored_ = false;
    std::fill(delta_.begin(), delta_.end(), Real(0));
    update_ball_tangents();
    system_.begin_step(state.t, motion);
  }

  /// Whether loops and their rates are closed, up to a share of coordinates and speeds that is next to rounding.
  bool is_closed(const StateOf<S>& state) const {
    const Real allowed = std::max(Real(1e-10), this->rounding_like(1e-12));
    return largest(this->phi_) <= allowed * this->pose_size(state.q) && largest(this->phid_) <= allowed * this->speed_size(state.v);
  }

  /// The tangents of the balls' rotations from the step's start to the iterate.
  void update_ball_tangents() { ball_tangents<Real>(this->charts(), delta_.data(), ball_tangents_.data()); }

  /// Passes of a projection.
  static constexpr std::size_t passes = 10;

  /// Coordinates and rates that belong to the state's accelerations.
  void follow(StateOf<S>& state) {
    const StepRule& rule = settings_.rule;
    if (!rule.averages()) {
      for (std::size_t i = 0; i < n_; ++i) {
        const Real sum = before_.vdot[i] + state.vdot[i];
        state.v[i] = before_.v[i] + dt_ / 2 * sum;
        delta_[i] = dt_ * before_.v[i] + k_ * sum;
      }
    } else {
      const Real speed_now(dt_ * Real(1 - rule.gamma)), place_now(dt_ * dt_ * Real(0.5 - rule.beta));
      for (std::size_t i = 0; i < n_; ++i) {
        const Real a = averaged(state, i);
        state.v[i] = before_.v[i] + speed_now * mean_[i] + dt_ * Real(rule.gamma) * a;
        delta_[i] = dt_ * before_.v[i] + place_now * mean_[i] + dt_ * dt_ * Real(rule.beta) * a;
      }
    }
    displace(this->charts(), before_.q, delta_.data(), state.q);
  }

  /// The acceleration a of the step's end.
  Real averaged(const StateOf<S>& state, std::size_t i) const {
    const StepRule& rule = settings_.rule;
    return share_ * state.vdot[i] + (Real(rule.alpha_f) * before_.vdot[i] - Real(rule.alpha_m) * mean_[i]) / Real(1 - rule.alpha_m);
  }

  NewtonSettings settings_;
  Real length_;              ///< of steps
  Real dt_, share_;          ///< step, or part of one, and how much of vdot is in a
  Real speed_, k_;           ///< dv/dvdot and dq/dvdot: dt/2 and dt^2/4 of the trapezoidal rule
  BallTangents<S> ball_tangents_;  ///< of the balls, in relative coordinates
  Equations<S> lambda_before_;  ///< multipliers of the step before

 private:
  Own& own() { return static_cast<Own&>(*this); }
  const Own& own() const { return static_cast<const Own&>(*this); }

  Fault accelerate(StateOf<S>& state) {
    std::fill(state.vdot.begin(), state.vdot.end(), Real(0));
    std::fill(lambda_.begin(), lambda_.end(), Real(0));
    own().choose_weights(state);
    this->linearise(state, Real(0), own().start_weights());
    if (const Fault fault = this->factor()) return fault;
    if (const Fault fault = own().examine()) return fault;
    if (const Fault fault = iterate_accelerations(state, own().start_weights().constraint, false)) return fault;
    lambda_before_ = lambda_;
    state.lambda = lambda_;
    take_means(state.vdot);
    residuals_ = measure();
    return {};
  }

  /// Accelerations by the factors at hand, which have this weight of the equations, by a fixed number of iterations if steps have one; `impatient` where other factors would converge sooner.
  Fault iterate_accelerations(StateOf<S>& state, Real weight, bool impatient) {
    bool converged = false, slow = false;
    for (int iteration = 0;; ++iteration) {
      this->constraint_residual(state);
      if (iteration > 0) own().correct_start(weight);
      if (converged) return {};
      if (iteration == 200 || slow) return this->fault_in_row(Cause::start_not_converged, static_cast<int>(index_of_largest(x_, n_)), change_);
      this->dynamic_residual(state, Real(0));
      own().right_of_start(state, weight);
      if (const Fault fault = this->solve()) return fault;
      take(Real(1), weight, state);
      const Real last = change_;
      converged = start_converged(state, iteration);
      if (settings_.fixed_cost) converged = iteration + 1 >= std::min(settings_.iterations, 200);
      slow = impatient && iteration > 0 && !(change_ <= last / 10);
    }
  }

  Fault advance(StateOf<S>& state) {
    before_ = state;
    time_ = state.t + dt_;
    Fault fault = find_end(state);
    if (damped_ && !fault && m_ > 0 && !moves_as_it_says(state)) fault = give_up(Cause::newton_not_converged, 0);
    if (fault) {
      wary_ = false;
      state = before_;
      return fault;
    }
    if (settings_.rule.averages())
      for (std::size_t i = 0; i < n_; ++i) mean_[i] = averaged(state, i);
    state.t = time_;
    return {};
  }

  Fault find_end(StateOf<S>& state) {
    system_.begin_step(time_, Real(1));
    if (const Fault fault = own().renews_always() || settings_.fixed_cost ? iterate(state) : iterate_warily(state)) return fault;
    this->constraint_residual(state);
    if (const Fault fault = own().update_multipliers(state)) return fault;
    return project(state);
  }

  /// A step in parts of a half, a quarter and so on, as short as they must be and as long as they may.  Returns false where the shortest
  /// fails; `state` is then that before the step.
  bool advance_by_parts(StateOf<S>& state) {
    constexpr int whole = 64;
    whole_ = state;
    whole_mean_ = mean_;
    int done = 0, part = whole / 2;
    while (done < whole && part > 0) {
      stride(Real(part) / Real(whole));
      stay(state);
      if (advance(state)) {
        part /= 2;
        continue;
      }
      ++substeps_;
      done += part;
      if (part < whole / 2 && done % (2 * part) == 0) part *= 2;
    }
    if (done < whole) {
      state = whole_;
      mean_ = whole_mean_;
    }
    stride(Real(1));
    stay(state);
    return done == whole;
  }

  /// Go on with this share of the step's length.
  void stride(Real share) {
    dt_ = share * length_;
    speed_ = dt_ * Real(settings_.rule.gamma) * share_;
    k_ = dt_ * dt_ * Real(settings_.rule.beta) * share_;
    factored_ = false;
    contraction_ = Real(1);
    own().weigh();
  }

  Fault iterate(StateOf<S>& state) {
    predict(state);
    rounding_ = 64 * std::numeric_limits<Real>::epsilon() * this->pose_size(before_.q);
    change_ = smallest_ = std::numeric_limits<Real>::infinity();
    growing_ = idle_ = 0;
    slow_ = false;
    for (int iteration = 1;; ++iteration) {
      follow(state);
      const bool renewed = own().renews_always() || settings_.fixed_cost || wary_ || damped_ || !factored_ || slow_;
      if (renewed) update_ball_tangents();
      own().approach(state, iteration, renewed);
      if (renewed && iteration > 1 && !finite(largest_move())) return give_up(Cause::newton_infinite, iteration);
      if (renewed)
        if (const Fault fault = this->factor()) return fault;
      factored_ = true;
      if (const Fault fault = this->solve()) return fault;
      const bool near = damped_ && is_near();
      if (damped_) full_vdot_ = state.vdot, full_lambda_ = lambda_;
      take(Real(1) / k_, own().start_weights().constraint, state);
      ++iterations_;
      if (converged(state, iteration) && own().may_end() && (!damped_ || m_ == 0 || near) && !settings_.fixed_cost) break;
      if (settings_.fixed_cost && iteration == settings_.iterations && finite(change_)) break;
      if (damped_)
        if (const Fault fault = shorten(state)) return fault;
      if (!finite(change_)) return give_up(Cause::newton_infinite, iteration);
      if (!damped_ && !settings_.fixed_cost && growing_ >= 5 && change_ > Real(1e3) * smallest_) return give_up(Cause::newton_diverging, iteration);
      if (iteration >= settings_.iterations) return give_up(Cause::newton_not_converged, iteration);
    }
    follow(state);
    return {};
  }

  /// With factors that are reused while the iteration converges; from the start again, with a tangent in each iteration, where that fails.
  Fault iterate_warily(StateOf<S>& state) {
    kept_now_ = lambda_;
    kept_before_ = lambda_before_;
    if (iterate(state)) {
      state = before_;
      lambda_ = kept_now_;
      lambda_before_ = kept_before_;
      wary_ = true;
      if (const Fault fault = iterate(state)) return fault;
    }
    wary_ = false;
    return {};
  }

  /// Whether a step has failed since its iteration went astray, which damping may mend.
  static bool has_lost_its_way(const Fault& fault) {
    return fault.cause == Cause::newton_not_converged || fault.cause == Cause::newton_diverging || fault.cause == Cause::newton_infinite ||
           fault.cause == Cause::forces_not_finite || fault.cause == Cause::tangent_not_finite;
  }

  /// A step whose iteration is damped, with a tangent in each iteration, from the accelerations before it, and in parts where that fails too.  This
  /// is for systems with first-order states, which may be stiff.
  [[gnu::noinline, gnu::cold]] bool advance_damped(StateOf<S>& state) {
    stay(state);
    damped_ = true;
    const bool found = !advance(state) || advance_by_parts(state);
    damped_ = false;
    return found;
  }

  /// Whether the step's displacement is that by the speeds at its ends.  Equations of loops have other solutions, with links turned over, which a
  /// damped iteration may find: there these speeds are not along the loops, and their projection takes most of them away.
  bool moves_as_it_says(const StateOf<S>& state) const {
    using std::abs;
    Real apart(0), most(0);
    for (std::size_t i = 0; i < n_ - number_of_states(this->system_); ++i) {
      const Real ends = dt_ / 2 * (before_.v[i] + state.v[i]);
      apart = std::max(apart, abs(delta_[i] - ends)), most = std::max(most, std::max(abs(delta_[i]), abs(ends)));
    }
    return apart <= most / 10 + Real(settings_.tolerance) * dt_ * this->speed_size(state.v);
  }

  /// Shorten the change of a damped iteration to a share t = 1, 1/2, 1/4 .. where the same factors would ask for a change that is smaller by t/4 of it:
  /// the monotonicity test of Deuflhard (Newton Methods for Nonlinear Problems, 2004, section 3.3), which does not depend on units of the equations.
  /// Where no share passes the change stays whole.
  [[gnu::noinline, gnu::cold]] Fault shorten(StateOf<S>& state) {
    const Real move = largest_move();
    full_ = x_;
    Real share(1);
    for (;; share /= 2) {
      const bool last = share < Real(1e-5);
      if (last) share = Real(1);
      for (std::size_t i = 0; i < full_.size(); ++i) x_[i] = share * full_[i];
      state.vdot = full_vdot_, lambda_ = full_lambda_;
      take(Real(1) / k_, own().start_weights().constraint, state);
      if (last) break;
      follow(state);
      own().approach(state, 0, false);
      if (const Fault fault = this->solve()) return fault;
      if (largest_move() <= (1 - share / 4) * move) break;
    }
    return {};
  }

  /// The multipliers go on as in the step before, lambda_0 = 2 lambda_n - lambda_(n-1) [eq. 3], or stay; so do the accelerations where
  /// `renews_always` does not hold, or they stay.
  void predict(StateOf<S>& state) {
    extrapolate(lambda_, lambda_before_, own().extrapolates());
    if (!own().renews_always()) extrapolate(state.vdot, vdot_before_, !wary_ && this->number_ > 1);
    predicted_ = state.vdot;
  }

  /// The change of the accelerations that may end an iteration: the tolerance, or with reused tangents the share that the step's own error can see, if that is less.
  ///
  /// The rest of an old tangent has the same direction in all steps, and adds up.  The accelerations come to lie as far from their
  /// extrapolation as a second difference, of which the rule's error is a twelfth.  Less than the rounding of the speeds is not asked for.
  Real enough(const StateOf<S>& state) const {
    using std::abs;
    const Real tolerated = Real(settings_.tolerance) * size_;
    if (own().renews_always()) return tolerated;
    Real apart(0);
    const std::span<const double> nominals = nominals_of(this->system_);
    const std::size_t first = n_ - nominals.size();
    for (std::size_t i = 0; i < first; ++i) apart = std::max(apart, abs(state.vdot[i] - predicted_[i]));
    for (std::size_t i = first; i < n_; ++i) apart = std::max(apart, abs(state.vdot[i] - predicted_[i]) / Real(nominals[i - first]));
    const Real rounding = 64 * std::numeric_limits<Real>::epsilon() * this->speed_size(state.v) / speed_;
    return std::min(tolerated, std::max(apart / Real(100), rounding));
  }

  template <class Numbers>
  static void extrapolate(Numbers& values, Numbers& before, bool extrapolated) {
    const Real share(extrapolated ? 1 : 0);
    for (std::size_t i = 0; i < values.size(); ++i) {
      const Real now = values[i];
      values[i] = now + share * (now - before[i]);
      before[i] = now;
    }
  }

  void take(Real scale, Real weight, StateOf<S>& state) {
    for (std::size_t i = 0; i < n_; ++i) state.vdot[i] += scale * x_[i];
    own().take_multipliers(weight);
  }

  /// The accelerations changed by at most the tolerance; or the coordinates by no more than their rounding, and that falls no more: with
  /// a small dt, an acceleration belongs to less than the last digit of a coordinate.  Equations that nearly depend on each other
  /// enlarge rounding, which shows when several iterations get no closer.
  bool converged(const StateOf<S>& state, int iteration) {
    const Real last = change_, move = largest_move();
    change_ = move / k_;
    size_ = this->acceleration_size(state.vdot);
    growing_ = change_ > last ? growing_ + 1 : 0;
    idle_ = change_ < smallest_ / 2 ? 0 : idle_ + 1;
    smallest_ = std::min(smallest_, change_);
    if (iteration > 1) contraction_ = change_ / last;
    const Real enough = this->enough(state);
    const Real third = iteration > 1 ? change_ : change_ * contraction_;  // the change before that of the third iteration, or of the next
    slow_ = !(third * contraction_ <= enough);
    if (change_ <= enough) return true;
    const Real digits = (idle_ >= 4 ? 4096 : 64) * std::numeric_limits<Real>::epsilon();
    return idle_ > 0 && move <= digits * this->pose_size(state.q);
  }

  Real largest_move() const { return largest(std::span<const Real>(x_.data(), n_), nominals_of(this->system_)); }

  bool start_converged(const StateOf<S>& state, int iteration) {
    const Real last = change_;
    change_ = largest_move();
    const Real size = this->acceleration_size(state.vdot);
    return iteration > 0 && (change_ <= rounding_like(1e-12) * size || (change_ <= rounding_like(1e-8) * size && change_ >= last / 2));
  }

  /// Rates and accelerations satisfy the equations at the smallest cost in the norm of the tangent: by increments that vanish with the
  /// violations, with the factors of the last iteration.  Phid is linear in the rates and Phidd in the accelerations: what is left is known.
  Fault project(StateOf<S>& state) {
    if (const Fault fault = own().project_on(state, state.v, phid_)) return fault;
    this->constraint_residual(state);
    if (const Fault fault = own().project_on(state, state.vdot, phidd_)) return fault;
    residuals_ = measure();
    const double sum = residuals_.position + residuals_.velocity + residuals_.acceleration;
    if (!std::isfinite(sum)) return this->fault_in_equation(Cause::equations_not_finite, 0, Real(sum));
    return {};
  }

  Residuals measure() const {
    return {static_cast<double>(largest(phi_)), static_cast<double>(largest(phid_)), static_cast<double>(largest(phidd_))};
  }

  Fault require_start(const StateOf<S>& state) {
    using std::abs;
    this->constraint_residual(state);
    for (std::size_t i = 0; i < m_; ++i) {
      const Real violation = std::max(abs(phi_[i]) / this->pose_size(state.q), abs(phid_[i]) / this->speed_size(state.v));
      if (!(violation <= std::max(Real(1e-6), rounding_like(1e-14)))) return this->fault_in_equation(Cause::start_inconsistent, i, violation);
    }
    return {};
  }

  Fault give_up(Cause cause, int iteration) {
    Fault fault = this->fault_in_row(cause, static_cast<int>(index_of_largest(x_, n_)), change_);
    fault.size = static_cast<double>(size_);
    fault.iterations = iteration;
    fault.closer = idle_ == 0;
    return own().explain(fault);
  }

  Speeds<S> vdot_before_, predicted_;  ///< accelerations of the step before, and those that a step's iteration begins with
  StateOf<S> before_, whole_;               ///< the state before the step, and before one that is taken in parts
  Speeds<S> mean_, whole_mean_;        ///< a, of rules that average, and that before a step in parts
  Speeds<S> delta_;                    ///< the integrals of the speeds over a step
  Residuals residuals_;
  Real change_{0}, smallest_{0}, size_{1}, rounding_{0};  ///< the last: of coordinates
  Rows<S> full_;                                          ///< the change of a damped iteration, before it is shortened, and what it changes
  Speeds<S> full_vdot_;
  Equations<S> full_lambda_;
  Equations<S> kept_now_, kept_before_;                   ///< multipliers at the start of a step and before it
  bool wary_ = false;                                     ///< whether each iteration has a tangent of its own after all
  bool damped_ = false;                                   ///< whether its changes are shortened too
  bool factored_ = false;                                 ///< whether there are factors of a step
  bool slow_ = false;            ///< whether the factors in use would not end the step with its third iteration, or then with the next
  Real contraction_{1};          ///< the share of a change that the next one has, as last seen
  int growing_ = 0, idle_ = 0;   ///< iterations in a row whose change grew, and since it last fell by half
  long iterations_ = 0, substeps_ = 0, restarts_ = 0;
};

}  // namespace cutjoint
