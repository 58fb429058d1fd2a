// Derivatives of the end of a step by the trapezoidal rule.
#pragma once

#include "cutjoint/core/derivatives/derivatives.hpp"
#include "cutjoint/core/newton/step_rule.hpp"

namespace cutjoint {

/// Derivatives by `ForceResidual` of the end of a step by Newton's iteration: accelerations a, multipliers, coordinates q and velocities v of the rule, and the
/// projections of velocities and accelerations in the metric of the tangent A there:
///
///     f(q, v, a, lambda) = 0     Phi(q) = 0         A (v_1 - v) + Phi_q^T mu = 0     Phid(q, v_1) = 0         A (vdot - a) + Phi_q^T nu = 0     Phidd(q, v_1, vdot) = 0
///
/// f is the force residual.  Derivatives of A times a displacement are differences of Jacobians along it.  The effect of a reused tangent of
/// another pose is neglected.
template <class ForceResidual>
class ClosedEndDerivatives {
 public:
  static constexpr std::size_t n = ForceResidual::n, m = ForceResidual::m, coordinates = ForceResidual::coordinates, all = n + m;
  using Changes = typename ForceResidual::Changes;
  using Entries = typename ForceResidual::JacobianEntries;
  using Matrix = Bordered<typename ForceResidual::Places>;
  using Columns = Fixed<double, ForceResidual::first_acceleration>;
  using First = Fixed<double, all>;  ///< with respect to accelerations and multipliers of the rule

  /// Prepare for a step by its formula; `rule` is the end before the projections.  False if a matrix is singular.
  template <class Formula, class State>
  bool find(ForceResidual& force_residual, const Formula& formula, const State& rule, const State& end) {
    position_weights_ = formula.position_weights().end;
    force_residual.find(rule, rule_);
    force_residual.find(end, end_);
    const auto decomposes = [&] { return decompose(force_residual, formula); };
    if (!decomposes() && !decomposes()) return false;  // with other pivots if those of earlier matrices have become small
    Changes pushed{}, moved{};
    ForceResidual::visit_unknowns(n, all, [&](std::size_t row, std::size_t k, std::size_t column) {
      pushed[row].derivative[0] += end_[k] * (end.vdot[column] - rule.vdot[column]);
      moved[row].derivative[0] += end_[k] * (end.v[column] - rule.v[column]);
    });
    if (!force_residual.solve(projections_, pushed) || !force_residual.solve(projections_, moved)) return false;
    const auto move = [&](double scale, const Changes& by, Entries& derivative) {
      State at = rule;
      Fixed<double, n> shift;
      for (std::size_t i = 0; i < n; ++i) {
        const double x = scale * by[i].derivative[0];
        at.vdot[i] += x, at.v[i] += formula.velocity_weights().end * x, shift[i] = position_weights_ * x;
      }
      retract<double>(ForceResidual::charts(), rule.q.data(), shift.data(), at.q.data());
      for (std::size_t i = 0; i < m; ++i) at.lambda[i] += scale * by[n + i].derivative[0];
      force_residual.find(at, derivative);
      for (std::size_t k = 0; k < derivative.size(); ++k) derivative[k] = (derivative[k] - rule_[k]) / scale;
    };
    move(1 / formula.velocity_weights().end, moved, speeds_);
    move(1.0, pushed, accelerations_);
    return true;
  }

  /// A linear equation of the end: its matrix, the Jacobian of its equations of motion, and the weight of violations of constraints.
  struct Part {
    const Matrix& matrix;
    const Entries& derivative;
    double weight;
  };

  Part rule() const { return {matrix_, rule_, -1 / position_weights_}; }        ///< accelerations and multipliers of the rule
  Part speeds() const { return {projections_, speeds_, -1.0}; }                 ///< the projection of velocities
  Part accelerations() const { return {projections_, accelerations_, 1.0}; }  ///< and of accelerations

  /// Its derivatives; `violations` has those of constraints for constant unknowns, `first` those of the rule, if it is none itself.
  bool solve(const Part& part, ForceResidual& force_residual, const auto& q, const auto& v, const auto* violations, std::span<const Dual> inputs, const Changes* first, Changes& change) const {
    force_residual.subtract_jvp(part.derivative, q, v, inputs, change.data());
    for (std::size_t i = 0; i < m; ++i) change[n + i].derivative = part.weight * violations[i].derivative;
    if (first) ForceResidual::visit_unknowns(0, n, [&](std::size_t i, std::size_t k, std::size_t column) { change[i].derivative -= part.derivative[k] * (*first)[column].derivative; });
    return force_residual.solve(part.matrix, change);
  }

  /// The transpose: derivatives with respect to all that `subtract_jvp` reads, to violations, and added to `by_first` those to the rule.
  bool vjp(const Part& part, const ForceResidual& force_residual, const auto& by_solution, Columns& by, Fixed<double, m>& by_violation, First* by_first) const {
    First x, forces;
    std::copy(by_solution.begin(), by_solution.end(), x.begin());
    if (!force_residual.solve_transposed(part.matrix, x)) return false;
    std::copy_n(x.begin(), n, forces.begin());
    force_residual.vjp(part.derivative, forces.data(), by);
    if (by_first) ForceResidual::visit_unknowns(0, n, [&](std::size_t i, std::size_t k, std::size_t column) { (*by_first)[column] -= part.derivative[k] * x[i]; });
    for (std::size_t i = 0; i < m; ++i) by_violation[i] = part.weight * x[n + i];
    return true;
  }

  /// Derivatives of the projection of accelerations, with velocities before and after theirs.
  bool solve_accelerations(ForceResidual& force_residual, const auto& q, const auto& v, const auto& projected, std::span<const Dual> inputs, const Changes& first, Changes& change) const {
    Changes loops;
    force_residual.subtract_jvp(end_, q, projected, inputs, loops.data());
    ForceResidual::visit_unknowns(n, all, [&](std::size_t row, std::size_t k, std::size_t column) { loops[row].derivative -= end_[k] * first[column].derivative; });
    return solve(accelerations(), force_residual, q, v, loops.data() + n, inputs, &first, change);
  }

  /// The transpose: derivatives with respect to all that `subtract_jvp` reads, with velocities before and after their projection, and to the rule.
  bool accelerations_vjp(const ForceResidual& force_residual, const Fixed<double, n>& by_move, Columns& by, Columns& by_projected, First& by_first) const {
    Fixed<double, m> by_loops;
    First loops;
    if (!vjp(accelerations(), force_residual, by_move, by, by_loops, &by_first)) return false;
    std::copy(by_loops.begin(), by_loops.end(), loops.begin() + n);
    force_residual.vjp(end_, loops.data(), by_projected);
    ForceResidual::visit_unknowns(n, all, [&](std::size_t row, std::size_t k, std::size_t column) { by_first[column] -= end_[k] * loops[row]; });
    return true;
  }

 private:
  bool decompose(const ForceResidual& force_residual, const auto& formula) {
    auto &rule = matrix_.entries(), &projections = projections_.entries();
    const auto at = [](std::size_t i, std::size_t j) { return Matrix::places.of(i, j); };
    rule.fill(0.0), projections.fill(0.0);
    force_residual.gather_entries(formula, 0, rule_, n, [&](std::size_t i, std::size_t, std::size_t j, double x) { rule[at(i, j)] += x, projections[at(i, j)] += x; });
    ForceResidual::visit_unknowns(n, all, [&](std::size_t i, std::size_t k, std::size_t j) {
      projections[at(i, j)] += end_[k];
      if (!is_rotation(j)) rule[at(i, j)] += end_[k];
    });
    for (std::size_t i = n; i < all; ++i) rule[at(i, i)] -= force_residual.compliance(i - n), projections[at(i, i)] -= force_residual.compliance(i - n);
    if constexpr (balls > 0) rotate_violations(formula.delta());
    const bool is_regular = matrix_.decompose(Matrix::everywhere);
    return projections_.decompose(Matrix::everywhere) && is_regular;
  }

  static bool is_rotation(std::size_t speed) {
    for (const Chart& chart : ForceResidual::charts())
      if (chart.ball && speed >= static_cast<std::size_t>(chart.v + chart.scalars) && speed < static_cast<std::size_t>(chart.v + chart.scalars + 3)) return true;
    return false;
  }

  /// Add the derivatives of constraints with respect to the rotation vectors of balls.
  void rotate_violations(const double* delta) {
    Fixed<double, 9 * balls> turned;
    ball_tangents<double>(ForceResidual::charts(), delta, turned.data());
    const double* T = turned.data();
    for (const Chart& chart : ForceResidual::charts()) {
      if (!chart.ball) continue;
      const auto w = static_cast<std::size_t>(chart.v + chart.scalars);
      ForceResidual::visit_unknowns(n, all, [&](std::size_t row, std::size_t k, std::size_t column) {
        for (std::size_t l = 0; column >= w && column < w + 3 && l < 3; ++l) matrix_.entries()[Matrix::places.of(row, w + l)] += end_[k] * T[3 * (column - w) + l];
      });
      T += 9;
    }
  }

  static constexpr std::size_t balls = ForceResidual::balls;

  double position_weights_ = 0.0;  ///< of accelerations in coordinates at the end
  Entries rule_, end_, accelerations_, speeds_;  ///< Jacobians before the projections, after them, and of tangents times the displacements of projections
  Matrix matrix_, projections_;  ///< of the rule, and of projections
};

/// Coordinates and velocities at the end of a step of length h by a `StepRule` from the beginning and the accelerations at the end; trapezoidal unless it `averages`.
template <class M, bool averages>
class RuleFormula {
 public:
  static constexpr std::size_t stages = 1, n = M::sizes.speeds, joints = M::sizes.joint_speeds(), balls = M::sizes.coordinates - joints;

  /// Weights of the rule's averaged accelerations at the beginning, of the state's accelerations there, and of those at the end.
  struct Weights {
    double mean, begin, end;
  };

  void begin(const StateOf<M>& from, const auto& means, double h, const StepRule& of = {}) {
    const StepRule rule = averages ? of : StepRule{};
    from_ = from.q;
    h_ = h;
    mean_ = {-rule.alpha_m / (1 - rule.alpha_m), rule.alpha_f / (1 - rule.alpha_m), (1 - rule.alpha_f) / (1 - rule.alpha_m)};
    const auto shares = [&](double scale, double all, double by_end) { return Weights{scale * (all - by_end + by_end * mean_.mean), scale * by_end * mean_.begin, scale * by_end * mean_.end}; };
    velocity_weights_ = shares(h, 1.0, rule.gamma), position_weights_ = shares(h * h, 0.5, rule.beta);
    for (std::size_t i = 0; i < n; ++i) {
      speeds_[i] = from.v[i] + velocity_weights_.mean * means[i], shift_[i] = h * from.v[i] + position_weights_.mean * means[i];
      if (averages) speeds_[i] += velocity_weights_.begin * from.vdot[i], shift_[i] += position_weights_.begin * from.vdot[i];
    }
  }

  /// Coordinates and velocities at the end from the accelerations there.
  void evaluate(StateOf<M>& end) {
    for (std::size_t i = 0; i < n; ++i) delta_[i] = shift_[i] + position_weights_.end * end.vdot[i], end.v[i] = speeds_[i] + velocity_weights_.end * end.vdot[i];
    retract<double>(M::charts, from_.data(), delta_.data(), end.q.data());
  }

  /// The inverse: accelerations from coordinates and first-order states at the end, and the velocities.
  void find(StateOf<M>& end) {
    displacement<double>(M::charts, from_.data(), end.q.data(), delta_.data());
    for (std::size_t i = 0; i < n; ++i) {
      end.vdot[i] = i < joints ? (delta_[i] - shift_[i]) / position_weights_.end : (end.v[i] - speeds_[i]) / velocity_weights_.end;
      end.v[i] = speeds_[i] + velocity_weights_.end * end.vdot[i];
    }
    linearise_retraction();
  }

  /// Linearise the retraction at the last end.
  void linearise_retraction() { retraction_ = {M::charts, from_.data(), delta_.data()}; }

  const double* delta() const { return delta_.data(); }
  const Weights& velocity_weights() const { return velocity_weights_; }
  const Weights& position_weights() const { return position_weights_; }
  const Weights& average_weights() const { return mean_; }  ///< of the averaged accelerations at the end

  /// Visit each unknown that a coordinate or velocity at the end depends on, with the partial derivative.
  template <class Residual, class Use>
  void visit_weights(std::size_t column, std::size_t, std::size_t, Use use) const {
    if (column >= Residual::first_speed) return use(column - Residual::first_speed, velocity_weights_.end);
    const std::size_t unknown = Residual::unknown_of(column);
    if (!Residual::is_quaternion(column)) return use(unknown, position_weights_.end);
    const auto [ball, c] = Residual::ball_of(column);
    for (std::size_t k = 0; balls > 0 && k < 3; ++k) use(unknown + k, position_weights_.end * retraction_[ball].by[c][4 + k]);
  }

  /// Replace derivatives of coordinates and velocities at the beginning by those at the end, for constant accelerations there.
  template <class Q, class V>
  void begin_jvp(Q& q, V& v, const V& means, const V& before, const Tangents&) const {
    std::array<DualPart, n> delta;
    for (std::size_t i = 0; i < n; ++i) {
      delta[i].derivative = h_ * v[i].derivative + position_weights_.mean * means[i].derivative;
      v[i].derivative += velocity_weights_.mean * means[i].derivative;
      if (averages) delta[i].derivative += position_weights_.begin * before[i].derivative, v[i].derivative += velocity_weights_.begin * before[i].derivative;
    }
    retraction_.jvp(M::charts, delta, q, true);
  }

  /// Add the terms of accelerations at the end.
  void end_jvp(const DualPart* change, auto& q, auto& v) const {
    std::array<DualPart, n> delta;
    for (std::size_t i = 0; i < n; ++i) delta[i] = position_weights_.end * change[i], v[i].derivative += velocity_weights_.end * change[i].derivative;
    retraction_.jvp(M::charts, delta, q, false);
  }

  /// From derivatives with respect to the end to those with respect to the beginning; those with respect to accelerations at the end are added.
  template <class Q, class V, class Point>
  void vjp(const std::array<Q, 1>& by_q, const std::array<V, 1>& by_v, Point& begun, std::array<V, 1>& by_vdot) const {
    V by_delta;
    retraction_.vjp(M::charts, by_q[0].data(), begun.q.data(), by_delta.data());
    for (std::size_t i = 0; i < n; ++i) {
      begun.v[i] = by_v[0][i] + h_ * by_delta[i];
      const auto by = [&](double Weights::* share) { return velocity_weights_.*share * by_v[0][i] + position_weights_.*share * by_delta[i]; };
      by_vdot[0][i] += by(&Weights::end);
      begun.vdot[i] = by(averages ? &Weights::begin : &Weights::mean);
      if constexpr (averages) begun.mean[i] = by(&Weights::mean);
    }
  }

 private:
  double h_ = 0.0;
  Weights velocity_weights_{}, position_weights_{}, mean_{};
  Coordinates<M> from_;
  Fixed<double, n> speeds_, shift_, delta_;  ///< the end without the terms of accelerations there, and the displacement
  RetractionDerivatives<balls> retraction_;
};

/// `Derivatives` of a `Simulation` with the trapezoidal rule, whose accelerations at the end satisfy the equations of motion there.
///
/// Newton's iteration has the multipliers at the end among its unknowns, so that Phi = 0 there.  It then projects velocities and accelerations in the
/// metric of its tangent, which may be an earlier one; here the metric is that of the masses, its limit for short steps.
template <class Simulation, Sized D, Sized S, std::size_t dofs, class ForceResidual>
class RuleDerivatives : public Derivatives<Simulation, D, S, dofs, ForceResidual> {
 public:
  using Base = Derivatives<Simulation, D, S, dofs, ForceResidual>;
  using typename Base::M;

 protected:
  using Base::m, Base::n;
  using Base::charts, Base::lambda_, Base::mechanism_, Base::phi_, Base::phid_, Base::q_, Base::v_, Base::values_, Base::vdot_;
  static constexpr std::size_t no_row = std::numeric_limits<std::size_t>::max();
  static constexpr bool is_stepped = requires { typename Simulation::Steps::Scheme; };   ///< steps end at events
  static constexpr bool is_explicit = requires { typename Simulation::Steps::Method; };
  static constexpr bool has_stages = is_stepped && !is_explicit;  ///< coupled stages
  static constexpr bool averages = [] {
    if constexpr (requires { Simulation::Steps::averages; }) return Simulation::Steps::averages;
    return false;
  }();
  static constexpr bool seeks_multipliers = Base::has_system && m > 0 && !has_stages;

  /// Derivatives of an implicit step whose length may depend on the seeds: `formula` gives coordinates and velocities of the stages, `solve` the derivatives of
  /// accelerations and multipliers there.  False if there are none.
  template <class Formula, class Solve>
  bool propagate_implicit(Formula& formula, const StateOf<M>& end, const Tangents& length, Solve solve) {
    std::array<DualPart, Formula::stages * (n + m)> change;
    if constexpr (averages || has_stages) before_ = vdot_;
    formula.begin_jvp(q_, v_, means(), before_, length);
    for (std::size_t i = 0; i < q_.size(); ++i) q_[i].value = end.q[i];
    for (std::size_t i = 0; i < n; ++i) v_[i].value = end.v[i];
    if (!solve(change)) return false;
    formula.end_jvp(change.data(), q_, v_);
    const DualPart* const last = change.data() + change.size() - n - m;
    for (std::size_t i = 0; i < n; ++i) vdot_[i] = {end.vdot[i], last[i].derivative};
    for (std::size_t i = 0; i < m; ++i) lambda_[i] = {end.lambda[i], last[n + i].derivative};
    return true;
  }

  /// The averaged accelerations of the rule, else those of the state, at the beginning of a step.
  const auto& means() const {
    if constexpr (averages) return mean_;
    else return vdot_;
  }

  /// Those at the end.
  void average() {
    for (std::size_t i = 0; averages && i < n; ++i)
      mean_[i].derivative = formula_.average_weights().mean * mean_[i].derivative + formula_.average_weights().begin * before_[i].derivative + formula_.average_weights().end * vdot_[i].derivative;
  }

  /// Prepare for a step by the rule.
  void begin_rule(const StateOf<M>& from, double h) {
    if constexpr (averages) formula_.begin(from, means_, h, rule_);
    else formula_.begin(from, from.vdot, h);
  }

  /// Derivatives of the end of a step by the rule; false if one of the force residual is not finite.
  bool propagate_fixed_point(M& mechanism, const StateOf<M>& from, const StateOf<M>& end, double h) {
    this->set_time(mechanism, end.t);
    if (!(is_converged_ ? linearise_end(end.t, h) : converge_end(mechanism, from, end, h))) return false;  // others may have set the time of the beginning
    is_converged_ = true;
    return propagate_implicit(formula_, stage_, {}, [this](auto& change) { return this->force_residual_.solve_end(q_, v_, this->dual_inputs(), change); });
  }

  /// Put the end of a step before its projection into `stage_`, and decompose the matrix there; false if that is singular.
  bool converge_end(M& mechanism, const StateOf<M>& from, const StateOf<M>& end, double h) {
    begin_rule(from, h);
    if (!converge(mechanism, end, h)) return false;
    formula_.evaluate(stage_);
    formula_.linearise_retraction();
    return linearise_end(end.t, h);
  }

  /// Iterate accelerations and multipliers from those of the end to the fixed point, with the matrix of an earlier step while errors decrease, then with a
  /// new one.
  bool converge(M& mechanism, const StateOf<M>& end, double h) {
    stage_ = end;
    double before = std::numeric_limits<double>::infinity();
    for (int iteration = 0; iteration < 30; ++iteration) {
      formula_.evaluate(stage_);
      mechanism.evaluate(stage_.q.data(), stage_.v.data(), stage_.lambda.data(), values_.data(), this->violation_.data());
      for (std::size_t i = 0; i < n; ++i) values_[i] -= stage_.vdot[i];
      for (std::size_t i = 0; i < m; ++i) stage_.lambda[i] += this->violation_[i];
      const double share = largest(values_) / (1.0 + largest(stage_.vdot));
      if (!(share <= std::numeric_limits<double>::max())) return false;
      if (share == 0.0 || (share > before / 2 && share <= (iteration > 2 ? 1e-5 : 1e-8))) return true;
      if (!this->force_residual_.has_matrix_for(h) || share > before / 2) formula_.linearise_retraction();
      const bool has_matrix = this->force_residual_.decompose_end(h, formula_);
      if ((!has_matrix || share > before / 2) && !linearise_end(end.t, h)) return false;
      if (iteration > 0) share_left_ = std::min(1.0, share / before);
      before = share;
      this->force_residual_.correct(values_, this->lambda_scratch_);
      for (std::size_t i = 0; i < n; ++i) stage_.vdot[i] += values_[i];
      for (std::size_t i = 0; i < m; ++i) stage_.lambda[i] += this->lambda_scratch_[i];
      if (share * share_left_ <= 1e-12) return true;
    }
    return false;
  }

  /// The Jacobian of the force residual at the stage, and its matrix; false if that is singular.
  bool linearise_end(double t, double h) {
    this->force_residual_.find(t, stage_.q, stage_.v, stage_.vdot, stage_.lambda, this->u_);
    return this->force_residual_.decompose_end(h, formula_);
  }

  /// The end of a step as Newton's iteration left it, with accelerations from its coordinates, and the Jacobian of the force residual there.
  bool find_rule(M& mechanism, const StateOf<M>& from, const StateOf<M>& end, double h) {
    stage_ = end;
    begin_rule(from, h);
    formula_.find(stage_);
    mechanism.begin_step(end.t, 1.0);
    this->along_ = {};
    this->take_inputs(mechanism);
    return ends_.find(this->force_residual_, formula_, stage_, end);
  }

  /// Derivatives of its end, with projected velocities and accelerations.
  bool propagate_rule(M& mechanism, const StateOf<M>& end) {
    this->set_time(mechanism, end.t);
    typename ForceResidual::Changes first, change;
    const auto inputs = this->dual_inputs();
    const auto solve = [&](auto& found) {
      mechanism_.constraint_residual(q_.data(), v_.data(), phi_.data(), phid_.data());
      const bool is_found = ends_.solve(ends_.rule(), this->force_residual_, q_, v_, phi_.data(), inputs, nullptr, found);
      first = found;
      return is_found;
    };
    if (!propagate_implicit(formula_, stage_, {}, solve)) return false;
    speeds_ = v_;
    for (std::size_t i = 0; i < n; ++i) v_[i].value = end.v[i];
    mechanism_.constraint_residual(q_.data(), v_.data(), phi_.data(), phid_.data());
    if (!ends_.solve(ends_.speeds(), this->force_residual_, q_, speeds_, phid_.data(), inputs, &first, change)) return false;
    for (std::size_t i = 0; i < n; ++i) v_[i].derivative += change[i].derivative;
    if (!ends_.solve_accelerations(this->force_residual_, q_, speeds_, v_, inputs, first, change)) return false;
    for (std::size_t i = 0; i < n; ++i) vdot_[i] = {end.vdot[i], first[i].derivative + change[i].derivative};
    return true;
  }

  std::size_t loaded_ = no_row;  ///< the first of the seeds whose parameter derivatives are loaded

  StateOf<M> stage_;
  RuleFormula<M, averages> formula_;
  StepRule rule_;
  Fixed<double, averages ? n : 0> means_;  ///< averaged accelerations of the rule at the beginning of a substep
  Fixed<Dual, averages ? n : 0> mean_;
  Fixed<Dual, M::sizes.coordinates> from_;
  Fixed<Dual, n> speeds_, before_;
  bool is_converged_ = false;  ///< the end of a substep is found
  double share_left_ = 1.0;                       ///< the fraction of the error that the last correction of a step left
  [[no_unique_address]] std::conditional_t<seeks_multipliers, ClosedEndDerivatives<ForceResidual>, typename Base::None> ends_;  ///< whose multipliers close the loops
};

}  // namespace cutjoint
