// The coupled stages of a step by Radau IIA, by Newton's iteration on their accelerations.
#pragma once

#include "cutjoint/core/newton/complex_solver.hpp"
#include "cutjoint/core/radau/step_start.hpp"

namespace cutjoint::radau {

/// The unknowns are the accelerations a_i of all stages; with the weights A of the method,
///
///     v_i = v_0 + h sum_j A_ij a_j         delta_i = h sum_j A_ij T(delta_j)^-1 v_j         q_i = retract(q_0, delta_i)
///
/// (radau/step_start.hpp).  The iteration solves, over all stages,
///
///     (M + alpha Phi_q^T Phi_q) da_i + h C sum_j A_ij da_j + h^2 K sum_j (A^2)_ij da_j = -(M a_i + Phi_q^T lambda_i - Q_i + alpha Phi_q^T Phidd_i)
///
/// and lambda_i += alpha (Phidd_i + Phi_q da_i).  The eigenvectors of A decouple this into a real and a complex system of the size of one stage: positions are no
/// additional unknowns.  M, C and K of one pose are reused in further steps, also of other lengths, with new factors.
template <class S, class Solver>
class Stages : public StepStart<S, Solver> {
  using Base = StepStart<S, Solver>;

  template <class Numbers>
  using OfStages = std::array<Numbers, Table::stages + 1>;  ///< the first belongs to the step's start

 public:
  using typename Base::Real;
  using Base::charts;

  Stages(S& system, Solver& solver, Solver& other, IndicatorPlaces<S> indicators, const Road<Real>* roads)
      : Base(system, solver, other, std::move(indicators), roads), complex_(system), points_{at_, at_, at_},
        changes_(derivatives_), guess_(derivatives_), kept_(derivatives_), places_(derivatives_), violations_(forces_), kept_forces_(forces_), mass_(this->tangent_),
        damping_(mass_), stiffness_(mass_), re_(mass_), im_(mass_), x_re_(n_), x_im_(n_) {}

  /// Try a step of length h from the present state; return whether its stages were found. Unless `whole`, it ends where it leaves the mode.
  bool attempt(Real h, bool whole, long number) {
    this->number_ = number;
    whole_ = whole;
    h_ = h;
    cells_.begin(start_.t);
    extrapolate(h);
    drop_open_part();
    guess_ = derivatives_;
    stale_ = !factored_ || slow_;
    bool found = false;
    if (iterate(h, found)) factored_ = false;
    if (!found) {
      leaves_early();
      return false;
    }
    if (leaves()) return false;
    at_ = points_.back();
    at_.lambda = forces_.back();
    delta_ = places_.back();
    return true;
  }

  /// Accept the attempted step: its end becomes the present state, and `before` the one before it.
  Fault accept(Real h, StateOf<S>& before) {
    at_.t = start_.t + h;
    if (const Fault fault = this->project(at_)) return fault;
    last_h_ = h;
    std::swap(kept_, derivatives_);
    std::swap(kept_forces_, forces_);
    std::swap(before, start_);
    std::swap(start_, at_);
    this->keep_start();
    return {};
  }

  /// The stages of the step that was accepted last, with accelerations and multipliers.
  void read(std::array<StateOf<S>, Table::stages>& stages) const {
    stages = points_;
    for (std::size_t i = 0; i < Table::stages; ++i) {
      stages[i].vdot = kept_[i + 1];
      stages[i].lambda = kept_forces_[i + 1];
    }
  }

  /// Memory of the next steps.
  struct Memory {
    typename Base::Memory common;
    OfStages<Speeds<S>> derivatives;
    OfStages<Equations<S>> forces;
    Entries<S> mass, damping, stiffness;
    Real parted_w;
  };

  Memory memory() const { return {Base::memory(), kept_, kept_forces_, mass_, damping_, stiffness_, parted_w_}; }

  void restore(const Memory& memory) {
    mass_ = memory.mass;
    damping_ = memory.damping;
    stiffness_ = memory.stiffness;
    parted_w_ = memory.parted_w;
    Base::restore(memory.common);
    kept_ = memory.derivatives;
    kept_forces_ = memory.forces;
    if (this->has_factors_) {
      join(this->factored_w_ / parted_w_);
      complex_.factor(re_.data(), im_.data());
    }
  }

 private:
  using Base::alpha_, Base::at_, Base::before_, Base::cells_, Base::delta_, Base::f_, Base::factored_, Base::forces_, Base::lambda_, Base::last_h_, Base::m_,
      Base::n_, Base::phidd_, Base::pose_, Base::push_, Base::rates_, Base::derivatives_, Base::slow_, Base::start_, Base::system_, Base::tangent_, Base::time_,
      Base::tolerances_, Base::trial_, Base::ball_tangents_, Base::x_;

  static constexpr double shorter = 0.9, longer = 1.1;  ///< factors are reused for steps up to these times theirs
  static constexpr double rest = 0.003;                 ///< fraction of the allowed error that the iteration leaves
  static constexpr int most_iterations = 25;

  static Real node(std::size_t i) { return Table::nodes[i].template as<Real>(); }

  void enter(std::size_t stage) {
    time_ = start_.t + node(stage) * h_;
    points_[stage - 1].t = time_;
    system_.begin_step(time_, Real(1));
  }

  /// Newton's iteration for all stages; whether these are `found`.  The first change is judged by the convergence rate of earlier steps, with decreasing
  /// trust (Hairer, Wanner, section IV.8).  Slow convergence may be due to a stiff force that begins in this step.
  Fault iterate(Real h, bool& found) {
    using std::pow;
    const Real w = Table::gamma.template as<Real>() * h;
    const Real infinity = std::numeric_limits<Real>::infinity();
    Real last = infinity, smallest = infinity, move(0);
    bool renew = !factored_ || slow_ || !(w < this->factored_w_ * Real(longer) && w > this->factored_w_ * Real(shorter));
    slow_ = false;
    for (int iteration = 1, idle = 0; iteration <= most_iterations && follow(); ++iteration) {
      if (const Fault fault = correct(renew, w)) return fault;
      this->iterations_ += Table::stages;
      const Real change = size_of_change(w, move), share = iteration > 1 ? change / last : renew ? Real(0.5) : pow(this->share_, Real(0.8));
      if (!this->finite(change) || change > Real(1e3) * smallest) return {};
      this->share_ = std::clamp(share, Real(0.01), Real(0.99));
      idle = change < smallest / 2 ? 0 : idle + 1;
      smallest = std::min(smallest, change);
      const Real digits = (idle >= 3 ? 4096 : 64) * std::numeric_limits<Real>::epsilon();
      const bool rounding = idle > 0 && move <= digits * speed_size(at_.v, arm_of(system_), scaled_nominals_of(system_));
      if (rounding || (share < Real(1) && change * share / (1 - share) <= Real(rest))) {
        found = follow();
        return {};
      }
      renew = iteration > 1 && share > Real(0.3);
      if (renew && leaves_early()) return {};
      slow_ = slow_ || renew;
      last = change;
    }
    return {};
  }

  /// Predict accelerations and multipliers by the cubic through those of the last step, unless that is too long ago.
  void extrapolate(Real h) {
    const bool near = last_h_ > Real(0) && h <= 2 * last_h_;
    for (std::size_t i = 1; i <= Table::stages; ++i) {
      derivatives_[i] = derivatives_[0];
      forces_[i] = forces_[0];
      if (!near) continue;
      std::fill(derivatives_[i].begin(), derivatives_[i].end(), Real(0));
      std::fill(forces_[i].begin(), forces_[i].end(), Real(0));
      const Real s = 1 + node(i) * h / last_h_;
      for (std::size_t j = 0; j <= Table::stages; ++j) {
        Real weight(1);
        for (std::size_t k = 0; k <= Table::stages; ++k)
          if (k != j) weight *= (s - node(k)) / (node(j) - node(k));
        for (std::size_t l = 0; l < n_; ++l) derivatives_[i][l] += weight * kept_[j][l];
        for (std::size_t l = 0; l < m_; ++l) forces_[i][l] += weight * kept_forces_[j][l];
      }
    }
  }

  /// Redundant equations leave a component of the multipliers undetermined, which no iteration corrects: as the Jacobian rotates, it grows at each step,
  /// and extrapolation amplifies it.  If multipliers have doubled mostly by it, without a force, the prediction omits it.
  void drop_open_part() {
    const Real size = largest(forces_.back());
    const bool grown = size > 2 * before_;
    before_ = grown ? size : std::min(before_, size);
    if (m_ == 0 || !grown || !this->has_factors_) return;
    for (std::size_t i = Table::stages; i > 0; --i) {
      if (this->carries_open_part(forces_[i])) return;
      if (i == Table::stages && largest(push_) < size / 2) return;
      for (std::size_t j = 0; j < m_; ++j) forces_[i][j] -= push_[j];
    }
    before_ = largest(forces_.back());
  }

  /// Whether the attempt leaves the mode with the present stages and should end there.
  bool leaves() {
    if (cells_.empty()) return false;
    for (std::size_t i = 1; i <= Table::stages; ++i) {
      enter(i);
      this->look_at(points_[i - 1]);
      cells_.look(time_);
      if (cells_.crossed() && !whole_) return true;
      cells_.pass(time_);
    }
    return false;
  }

  /// Whether slowly or not converging stages leave the mode, as computed or as extrapolated within the previous mode.
  bool leaves_early() {
    if (leaves()) return true;
    cells_.begin(start_.t);
    std::swap(derivatives_, guess_);
    follow();
    const bool out = leaves();
    std::swap(derivatives_, guess_);
    follow();
    if (!out) cells_.begin(start_.t);
    return out;
  }

  /// An iteration over all stages.  Violations are corrected along the Phi_q of the tangent's pose.
  /// So are the multipliers, by alpha (Phidd + Phi_q da): if Phi_q has changed, the new Phidd differs, and alpha would amplify the difference.
  Fault correct(bool renew, Real w) {
    constexpr std::size_t middle = 2;
    const bool linearised = renew && stale_;
    if (linearised) {
      enter(middle);
      lambda_ = forces_[middle];
      part(points_[middle - 1], w);
      changes_[middle] = f_;
    }
    stale_ = true;
    if (renew)
      if (const Fault fault = factor(w)) return fault;
    for (std::size_t i = 1; i <= Table::stages; ++i) pull(i, linearised && i == middle);
    if (const Fault fault = solve_stages()) return fault;
    for (std::size_t i = 1; i <= Table::stages; ++i) {
      system_.apply_jacobian(pose_.data(), changes_[i].data(), push_.data());
      for (std::size_t j = 0; j < m_; ++j) forces_[i][j] += alpha_ * (violations_[i][j] + push_[j]);
      for (std::size_t j = 0; j < n_; ++j) derivatives_[i][j] += changes_[i][j];
    }
    return {};
  }

  /// The terms M (with the equations), w C and w^2 K of the tangent in a stage.
  void part(const StateOf<S>& state, Real w) {
    parted_w_ = w;
    pose_ = state.q;
    this->linearise(state, Real(0), {Real(0), Real(0), alpha_, ball_tangents_.data()});
    mass_ = tangent_;
    this->linearise(state, Real(0), {w, Real(0), alpha_, ball_tangents_.data()});
    damping_ = tangent_;
    this->linearise(state, Real(0), {w, w * w, alpha_, ball_tangents_.data()});
    for (std::size_t i = 0; i < mass_.size(); ++i) {
      stiffness_[i] = tangent_[i] - damping_[i];
      damping_[i] -= mass_[i];
    }
  }

  /// The real and the complex tangent of a step whose length is `ratio` times that of these terms.
  void join(Real ratio) {
    const Real gamma = Table::gamma.template as<Real>(), a = ratio * Table::real.template as<Real>() / gamma, b = ratio * Table::imaginary.template as<Real>() / gamma;
    for (std::size_t i = 0; i < mass_.size(); ++i) {
      tangent_[i] = mass_[i] + ratio * damping_[i] + ratio * ratio * stiffness_[i];
      re_[i] = mass_[i] + a * damping_[i] + (a * a - b * b) * stiffness_[i];
      im_[i] = b * damping_[i] + 2 * a * b * stiffness_[i];
    }
  }

  Fault factor(Real w) {
    join(w / parted_w_);
    if (const Fault fault = Base::factor()) return fault;
    this->has_factors_ = factored_ = true;
    this->factored_w_ = w;
    if (complex_.factor(re_.data(), im_.data())) return this->fault_in_row(Cause::tangent_singular, -1, Real(0));
    return {};
  }

  /// The right-hand side of a stage, whose residual may be known.
  void pull(std::size_t i, bool known) {
    enter(i);
    StateOf<S>& state = points_[i - 1];
    lambda_ = forces_[i];
    if (known) f_ = changes_[i];
    else this->dynamic_residual(state, Real(0));
    this->constraint_residual(state);
    violations_[i] = phidd_;
    for (std::size_t j = 0; j < m_; ++j) push_[j] = alpha_ * phidd_[j];
    system_.apply_jacobian_transposed(pose_.data(), push_.data(), x_.data());
    for (std::size_t j = 0; j < n_; ++j) changes_[i][j] = -f_[j] - x_[j];
  }

  /// Solve for the changes of all stages.
  Fault solve_stages() {
    const auto mixed = [](const auto& row, const auto& a, const auto& b, const auto& c, std::size_t j) {
      return row[0].template as<Real>() * a[j] + row[1].template as<Real>() * b[j] + row[2].template as<Real>() * c[j];
    };
    for (std::size_t j = 0; j < n_; ++j) {
      x_[j] = mixed(Table::inverse[0], changes_[1], changes_[2], changes_[3], j);
      x_re_[j] = mixed(Table::inverse[1], changes_[1], changes_[2], changes_[3], j);
      x_im_[j] = mixed(Table::inverse[2], changes_[1], changes_[2], changes_[3], j);
    }
    if (const Fault fault = this->solve()) return fault;
    complex_.solve(x_re_.data(), x_im_.data());
    for (std::size_t i = 1; i <= Table::stages; ++i)
      for (std::size_t j = 0; j < n_; ++j) changes_[i][j] = mixed(Table::vectors[i - 1], x_, x_re_, x_im_, j);
    return {};
  }

  /// Velocities and coordinates of the stages from their accelerations; false if a ball rotates too far for its chart.
  bool follow() {
    for (std::size_t i = 1; i <= Table::stages; ++i) {
      StateOf<S>& point = points_[i - 1];
      point.v = start_.v;
      add_derivatives(h_, Table::weights[i], derivatives_, point.v);
      point.vdot = derivatives_[i];
      rates_[i] = point.v;
    }
    for (std::size_t i = 1; i <= Table::stages; ++i) {
      std::fill(places_[i].begin(), places_[i].end(), Real(0));
      add_derivatives(h_, Table::weights[i], rates_, places_[i]);
    }
    bool close = true;
    for (const Chart& chart : charts()) close = (!chart.ball || place_ball(static_cast<std::size_t>(chart.v + chart.scalars))) && close;
    for (std::size_t i = 1; i <= Table::stages; ++i) retract<Real>(charts(), start_.q.data(), places_[i].data(), points_[i - 1].q.data());
    return close;
  }

  /// Rates and displacements of a ball, from the first index of its angular velocity; whether they are found.
  bool place_ball(std::size_t at) {
    using std::abs;
    constexpr Chart here{0, 0, 0, true};
    Real change(1);
    for (int pass = 0; pass < 40 && change > 4 * std::numeric_limits<Real>::epsilon(); ++pass) {
      for (std::size_t i = 1; i <= Table::stages; ++i)
        chart_rates<Real>(std::span(&here, 1), places_[i].data() + at, points_[i - 1].v.data() + at, rates_[i].data() + at);
      change = Real(0);
      for (std::size_t i = 1; i <= Table::stages; ++i)
        for (std::size_t k = at; k < at + 3; ++k) {
          Real next(0);
          for (std::size_t j = 1; j <= Table::stages; ++j) next += h_ * Table::weights[i][j].template as<Real>() * rates_[j][k];
          change = std::max(change, abs(next - places_[i][k]) / (Real(1) + abs(next)));
          places_[i][k] = next;
        }
    }
    return change <= 64 * std::numeric_limits<Real>::epsilon();
  }

  /// The largest change of a velocity by an iteration relative to its allowed error; without tolerances, `move`, m/s.
  Real size_of_change(Real w, Real& move) {
    using std::abs;
    Real largest(0);
    move = Real(0);
    for (std::size_t j = 0; j < n_; ++j) {
      const Real size = w * std::max({abs(changes_[1][j]), abs(changes_[2][j]), abs(changes_[3][j])});
      move = std::max(move, size / Real(size_at(scaled_nominals_of(system_), j, n_)));
      this->note((size + Real(0) * changes_[1][j]) / tolerances_.of(abs(start_.v[j]), j, n_), j, largest);
    }
    return largest;
  }

  ComplexSolver<S> complex_;
  std::array<StateOf<S>, Table::stages> points_;
  OfStages<Speeds<S>> changes_, guess_, kept_, places_;  ///< changes of accelerations, their prediction, those of the last step, displacements
  OfStages<Equations<S>> violations_, kept_forces_;
  Entries<S> mass_, damping_, stiffness_, re_, im_;
  Speeds<S> x_re_, x_im_;
  Real h_{0}, parted_w_{1};
  bool whole_ = false;  ///< whether the attempt continues outside the mode
  bool stale_ = false;  ///< whether new factors need new terms
};

}  // namespace cutjoint::radau
