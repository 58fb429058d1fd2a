// A system with its tangent's factors and arrays, for Newton's iteration, the start and projections.
#pragma once

#include "cutjoint/core/simulation/fault.hpp"
#include "cutjoint/core/newton/static_solver.hpp"
#include "cutjoint/core/mechanism/retraction.hpp"
#include "cutjoint/core/mechanism/state.hpp"

namespace cutjoint {

/// The default weight of the equations in an augmented tangent, relative to the heaviest coordinate.
template <class Real>
inline constexpr Real overweight{1e4};

/// With the tangent A = B + c Phi_q^T Phi_q, the projection  A dv = -c Phi_q^T violation  leaves a fraction of the violation.  It is the first step, of
/// length c, of an iteration for w in  S w = violation, S = Phi_q A^-1 Phi_q^T, dv = -A^-1 Phi_q^T w.  Conjugate residuals take steps of optimal
/// length at the same cost, a back-substitution each.  They converge also where the length c achieves almost nothing.  They are those of
/// Eisenstat, Elman, Schultz (SIAM J. Numer. Anal. 20 (1983) 345-357), since A need not be symmetric, nor belong to this very pose.
///
/// A direction far weaker than others belongs to nearly dependent equations: it is ignored, since closing it
/// would take a large change of the rates.  The penalty hides its strength: without it S is S / (1 - c S).  (Massless directions
/// have unbounded strength and are no reference for others.)
template <class S>
class Closing {
 public:
  using Real = typename S::real_type;

  static constexpr std::size_t passes = 10;

  explicit Closing(const S& system)
      : n_(sizes_of(system).speeds), m_(sizes_of(system).equations), shifts_(passes * n_), closings_(passes * m_) {}

  /// Change `values` until their `violation`, which is linear in them and updated, is `negligible`.  `follow` computes way = A^-1 Phi_q^T w and
  /// closing = Phi_q way for a w; `constraint` is c.  The fault is that of `follow`.
  Fault close(Speeds<S>& values, Equations<S>& violation, Real constraint, Real negligible, auto follow) {
    Real strongest(0);
    share_left_ = Real(0);
    closed_ = !(largest(violation) > negligible);
    for (std::size_t pass = 0; pass < passes && !closed_; ++pass) {
      const std::span<Real> shift(shifts_.data() + pass * n_, n_), closing(closings_.data() + pass * m_, m_);
      if (const Fault fault = follow(violation, shift, closing)) return fault;
      Real match = dot(violation, closing);
      const Real strength = match / dot(violation, violation);
      share_left_ = std::max(share_left_, 1 - constraint * strength);
      const Real free = strength / std::max(1 - constraint * strength, std::numeric_limits<Real>::epsilon());
      if (!(free > Real(1e-4) * strongest)) break;
      strongest = std::max(strongest, std::min(free, overweight<Real> / constraint));
      for (std::size_t before = 0; before < pass; ++before) {
        const std::span<Real> old_shift(shifts_.data() + before * n_, n_), old(closings_.data() + before * m_, m_);
        const Real share = dot(closing, old) / dot(old, old);
        subtract(share, old_shift, shift);
        subtract(share, old, closing);
      }
      if (pass > 0) match = dot(violation, closing);
      const Real length = match / dot(closing, closing);
      subtract(length, shift, values);
      subtract(length, closing, violation);
      closed_ = !(largest(violation) > negligible);
    }
    return {};
  }

  /// The largest fraction of the last violation that a projection of length c would leave.
  Real share_left() const { return share_left_; }

  /// Whether the last violation has been closed.
  bool closed() const { return closed_; }

 private:
  static Real dot(std::span<const Real> a, std::span<const Real> b) { return cutjoint::dot(a, b); }

  static void subtract(Real factor, std::span<const Real> a, std::span<Real> from) {
    for (std::size_t i = 0; i < a.size(); ++i) from[i] -= factor * a[i];
  }

  std::size_t n_, m_;
  bool closed_ = true;
  Real share_left_{0};
  Array<S, passes * static_sizes<S>().speeds> shifts_;         ///< increments
  Array<S, passes * static_sizes<S>().equations> closings_;  ///< their effect on the violation
};

/// Evaluates, factors and solves with a linear solver, counts these, and locates numbers that are not finite.  All memory is taken in the constructor.
///
/// A system has `begin_step`, `report`, `guard` and `events` (mechanism/contract.hpp) and the functions of lagrangian/any_system.hpp; a solver
/// has `factor` for the values of a tangent, and `solve` in place, which return a Breakdown.
template <class S, class Solver>
class Workspace {
 public:
  using Real = typename S::real_type;

  Workspace(S& system, Solver& solver)
      : system_(system), solver_(solver), charts_(charts_of(system)), n_(sizes_of(system).speeds), m_(sizes_of(system).equations), arm_(arm_of(system)), f_(n_),
        phi_(m_), phid_(m_), phidd_(m_), weight_(m_), lambda_(m_), x_(tangent_of(system).rows), tangent_(tangent_of(system).entries) {}

  Workspace(const Workspace&) = delete;
  Workspace& operator=(const Workspace&) = delete;

  long evaluations() const { return evaluations_; }
  long factorisations() const { return factorisations_; }

 protected:
  void linearise(const StateOf<S>& state, Real penalty, const Weights<Real>& weights) {
    ++evaluations_;
    system_.linearise(state.q.data(), state.v.data(), state.vdot.data(), lambda_.data(), penalty, weights, f_.data(), phi_.data(),
                      tangent_.data());
  }

  void dynamic_residual(const StateOf<S>& state, Real penalty) {
    ++evaluations_;
    system_.dynamic_residual(state.q.data(), state.v.data(), state.vdot.data(), lambda_.data(), penalty, f_.data(), phi_.data());
  }

  void constraint_residual(const StateOf<S>& state) {
    system_.constraint_residual(state.q.data(), state.v.data(), state.vdot.data(), phi_.data(), phid_.data(), phidd_.data());
  }

  Fault factor() {
    if (const Fault fault = require_finite()) return fault;
    ++factorisations_;
    return fault_of(solver_.factor(tangent_.data()));
  }

  Fault solve() { return fault_of(solver_.solve(x_.data())); }

  /// way = A^-1 Phi_q^T w with the Phi_q of a given pose, and closing = Phi_q way, with the factors of A.
  Fault follow_weight(const Coordinates<S>& pose, const Coordinates<S>& at, const Equations<S>& w, std::span<Real> shift, std::span<Real> closing) {
    system_.apply_jacobian_transposed(pose.data(), w.data(), x_.data());
    if (const Fault fault = solve()) return fault;
    std::copy_n(x_.begin(), n_, shift.begin());
    system_.apply_jacobian(at.data(), shift.data(), closing.data());
    return {};
  }

  /// Close the loops of a state, positions first, then velocities, with the factors of a tangent of a pose with the weight `constraint`
  /// of the equations; `shift` and `from` are scratch arrays.  `left` receives the remaining violations.
  Fault close_with(StateOf<S>& state, const Coordinates<S>& pose, Real constraint, Closing<S>& closing, Speeds<S>& shift, Coordinates<S>& from,
                   Residuals& left) {
    const auto bring = [&](Speeds<S>& values, Equations<S>& violation, Real negligible) {
      return closing.close(values, violation, constraint, negligible,
                           [&](const auto& weight, auto along, auto closed) { return follow_weight(pose, state.q, weight, along, closed); });
    };
    for (int round = 0;; ++round) {
      constraint_residual(state);
      const Real rounding = rounding_like(1e-13) * pose_size(state.q);
      if (!(largest(phi_) > rounding) || round == 4) break;
      std::fill(shift.begin(), shift.end(), Real(0));
      if (const Fault fault = bring(shift, phi_, rounding)) return fault;
      from = state.q;
      displace(charts(), from, shift.data(), state.q);
    }
    if (const Fault fault = bring(state.v, phid_, rounding_like(1e-12) * speed_size(state.v))) return fault;
    constraint_residual(state);
    left = {static_cast<double>(largest(phi_)), static_cast<double>(largest(phid_)), 0.0};
    return {};
  }

  /// The largest mass of a coordinate, for angles divided by the squared arm; 1 if there is none.
  Real heaviest(const StateOf<S>& state, const Real* ball_tangents) {
    linearise(state, Real(0), {Real(0), Real(0), Real(0), ball_tangents});
    const auto& pattern = pattern_of(system_);
    const std::span<const double> nominals = nominals_of(system_);
    Real heaviest(0);
    for (std::size_t j = 0; j < n_; ++j)
      for (auto k = static_cast<std::size_t>(pattern.first[j]); k < static_cast<std::size_t>(pattern.first[j + 1]); ++k)
        if (static_cast<std::size_t>(pattern.row[k]) == j) heaviest = std::max(heaviest, arm_ == Real(1) ? tangent_[k] : tangent_[k] * Real(nominals[j] * nominals[j]));
    return heaviest > Real(0) ? heaviest : Real(1);
  }

  // Reference sizes (mechanism/state.hpp).
  Real pose_size(const Coordinates<S>& q) const { return cutjoint::pose_size(q, arm_of(system_), charts(), nominals_of(system_)); }
  Real speed_size(const Speeds<S>& v) const { return cutjoint::speed_size(v, arm_of(system_), nominals_of(system_)); }
  Real acceleration_size(const Speeds<S>& vdot) const { return cutjoint::acceleration_size(vdot, nominals_of(system_)); }
  Real size_of(const StateOf<S>& state, const Speeds<S>& values) const { return &values == &state.v ? speed_size(values) : acceleration_size(values); }

  std::span<const Chart> charts() const {
    if constexpr (Sized<S>) return S::charts;
    else return charts_;
  }

  /// A fault of an unknown, or of an equation after the unknowns; of neither if the row is negative.
  Fault fault_in_row(Cause cause, int row, Real value) const {
    const bool equation = row >= static_cast<int>(n_);
    return {.cause = cause, .list = row < 0 ? FaultList::none : equation ? FaultList::equations : FaultList::speeds,
            .index = equation ? row - static_cast<int>(n_) : row, .t = static_cast<double>(time_), .step = number_,
            .value = static_cast<double>(value)};
  }

  /// A fault of an equation.
  Fault fault_in_equation(Cause cause, std::size_t equation, Real value) const {
    return fault_in_row(cause, static_cast<int>(n_ + equation), value);
  }

  /// The relative rounding in this number type that corresponds to one in double.
  static Real rounding_like(double in_double) {
    return Real(in_double / std::numeric_limits<double>::epsilon()) * std::numeric_limits<Real>::epsilon();
  }

  static bool finite(Real value) { return std::isfinite(static_cast<double>(value)); }

  S& system_;
  Solver& solver_;
  std::span<const Chart> charts_;
  std::size_t n_, m_;                         ///< unknowns and equations
  Real arm_;                                  ///< see `arm_of`
  Speeds<S> f_;                               ///< force residual
  Equations<S> phi_, phid_, phidd_, weight_;  ///< equations and their rates, and scratch for weights of the equations
  Equations<S> lambda_;
  Rows<S> x_;  ///< right-hand side and then solution
  Entries<S> tangent_;
  Real time_{0};
  long number_ = 0;  ///< of the step

 private:
  /// A fault if an entry of the residual or the tangent is not finite.
  Fault require_finite() const {
    for (std::size_t i = 0; i < n_; ++i)
      if (!finite(f_[i])) return fault_in_row(Cause::forces_not_finite, static_cast<int>(i), f_[i]);
    bool all = true;
    for (const Real value : tangent_) all &= value - value == Real(0);  // without branches, since this is checked for every tangent
    if (all) return {};
    std::size_t i = 0;
    while (finite(tangent_[i])) ++i;
    return fault_in_row(Cause::tangent_not_finite, pattern_of(system_).row[i], tangent_[i]);
  }

  Fault fault_of(Breakdown broken) const {
    if (!broken) return {};
    const bool is_positive = broken.kind != Breakdown::Kind::not_positive;
    return fault_in_row(is_positive ? Cause::tangent_singular : Cause::tangent_not_positive, broken.row, Real(0));
  }

  long evaluations_ = 0, factorisations_ = 0;
};

}  // namespace cutjoint
