// Derivatives of the end of a substep with respect to its beginning; it may end at an event, whose time depends on the seeds.
#pragma once

#include "cutjoint/core/constraints/impacts.hpp"
#include "cutjoint/core/derivatives/rule_derivatives.hpp"
#include "cutjoint/core/radau/stage_derivatives.hpp"
#include "cutjoint/core/stepping/interpolant.hpp"

namespace cutjoint {

/// `Derivatives` of a `Simulation` from the consistent state at a substep's beginning to that at its end: its integrator's formulas over dual numbers,
/// with those of accelerations, multipliers and projections by the linearised force residual, as of the converged solution.
///
/// The event's time t solves g(x(t), t, p) = level for the interpolant x(t) of the last step.  Hence
///
///     dt = -(g_x dx + g_p dp) / (g_x x' + g_t)        dx at the event = dx at its time + x' dt
///
/// The next substep begins at that time and ends where it did: its length changes by -dt.
template <class Simulation, Sized D, Sized S, std::size_t dofs, class ForceResidual>
class SubstepDerivatives : public RuleDerivatives<Simulation, D, S, dofs, ForceResidual> {
 public:
  using Base = RuleDerivatives<Simulation, D, S, dofs, ForceResidual>;
  using typename Base::M;
  using Steps = typename Simulation::Steps;

 protected:
  using Base::m, Base::n, Base::has_stages, Base::is_explicit, Base::seeks_multipliers;
  using Base::charts, Base::from_, Base::mechanism_, Base::phi_, Base::phid_, Base::q_, Base::speeds_, Base::stage_, Base::step_, Base::v_, Base::vdot_;

  using Subject = typename Simulation::Subject;
  static constexpr std::size_t indicators = Base::is_stepped ? Subject::sizes.indicators : 0;

  /// Whether a step begins with the accelerations of the previous one, found before the projection at its end.
  static constexpr bool reuses_accelerations = !is_explicit && (!Base::has_system || m > 0 || has_stages);

  /// Whether it begins with the state derivative of the previous one's last stage, found before the projection.
  static constexpr bool carries_derivative = is_explicit && m > 0;

  /// A substep that ends at a fraction `share` of the step taken (which may exceed 1), where `left` indicators change mode.
  struct Cut {
    bool is_made = false;
    double share = 1.0;
    std::size_t left = 0;
    Fixed<std::size_t, indicators> which;

    /// A fault at the first of these indicators.
    Fault fault(Cause cause, double t) const {
      return {.cause = cause, .list = FaultList::indicators, .index = left > 0 ? static_cast<int>(which[0]) : -1, .t = t};
    }
  };

  [[no_unique_address]] std::conditional_t<has_stages, radau::StageDerivatives<ForceResidual>, typename Base::None> stages_;  ///< of a step with stages at `points_`
  std::array<StateOf<M>, has_stages ? radau::Table::stages : 0> points_;

  Fixed<Dual, M::sizes.coordinates> coordinate_rates_;  ///< rates of coordinates in that state derivative
  bool is_derivative_known_ = false;             ///< a substep begins with it, in `coordinate_rates_` and accelerations
  bool wants_derivative_ = false;                ///< it is needed at the end

  Cut cut_;
  Tangents dt_begin_{}, dt_end_{};  ///< derivatives of the times at which a substep begins and ends
  Fixed<double, indicators ? M::sizes.coordinates : 0> qdot_at_event_;  ///< rates of coordinates and velocities at the cut
  Fixed<double, indicators ? n : 0> vdot_at_event_;
  Fault refused_;  ///< why a substep has no derivative

  /// Prepare for a substep between two states; false if its end has no derivative.
  bool prepare_substep(Simulation& simulation, const StateOf<M>& from, const StateOf<M>& end, double h) {
    if constexpr (has_stages) return find_stages(simulation.mechanism(), from, h);
    if constexpr (seeks_multipliers) return this->find_rule(simulation.mechanism(), from, end, h);
    this->is_converged_ = false;
    return true;
  }

  /// Propagate derivatives from the beginning of the substep to its end; false if there are none.
  bool go(Simulation& simulation, const StateOf<M>& from, const StateOf<M>& end, double h) {
    M& mechanism = simulation.mechanism();
    if constexpr (is_explicit) return propagate_explicit<typename Steps::Method>(mechanism, from, end, h);
    else if constexpr (has_stages) return propagate_stages(mechanism, from, end, h);
    else {
      bool is_found = false;
      if constexpr (seeks_multipliers) is_found = this->propagate_rule(mechanism, end);
      else is_found = this->propagate_fixed_point(mechanism, from, end, h);
      this->average();
      return is_found;
    }
  }

  /// The projection at the end; false if loops stay open.
  bool project_end(Simulation& simulation, const StateOf<M>& end) {
    if constexpr (has_stages) return project_by_force_residual(end);
    else if constexpr (seeks_multipliers) return true;
    else return !(is_explicit || simulation.settings().fixed_point.proximal) || project_loops();
  }

  /// Whether velocities jump at the event.
  bool speeds_jump([[maybe_unused]] const StateOf<M>& end) const {
    if constexpr (can_jump<Subject> && indicators > 0) {
      if (cut_.left == 0) return false;
      return jump(v_, end.v);
    }
    return false;
  }

 private:
  // Events

  /// Values at the cut of a step with derivatives at fixed time, and their rates; `end` has those at the end of the step.
  template <class Table, class Stages, std::size_t count>
  void interpolate(const Dual& length, const Fixed<Dual, count>& begin, const Stages& derivatives, Fixed<Dual, count>& end, Fixed<double, count>& rate) const {
    constexpr std::size_t parts = 4 + Table::dense.size();
    const Dual share(cut_.share, (cut_.share - 1.0) / length.value * dt_begin_), left = 1.0 - share;
    [[maybe_unused]] std::array<Fixed<Dual, count>, Table::dense.size()> more{};
    if constexpr (parts > 4)
      for (std::size_t i = 0; i + 4 < parts; ++i) add_derivatives(length, Table::dense[i], derivatives, more[i]);
    for (std::size_t i = 0; i < count; ++i) {
      const Dual shift = end[i] - begin[i], quadratic = length * derivatives[0][i] - shift;
      std::array<Dual, parts> part{begin[i], shift, quadratic, shift - length * derivatives[Table::stages - 1][i] - quadratic};
      if constexpr (parts > 4)
        for (std::size_t k = 4; k < parts; ++k) part[k] = more[k - 4][i];
      Dual sum = part.back();
      double steepness = 0.0;  // by the share
      for (std::size_t k = parts - 2; k > 0; --k) {
        steepness = k % 2 > 0 ? left.value * steepness - sum.value : share.value * steepness + sum.value;
        sum = part[k] + (k % 2 > 0 ? left : share) * sum;
      }
      rate[i] = (sum.value + share.value * steepness) / length.value;
      end[i] = part[0] + share * sum;
    }
  }

  /// From derivatives of coordinates and velocities at the fixed time of the cut to those at the moving time of the event.
  bool shift_to_event([[maybe_unused]] M& mechanism, [[maybe_unused]] const StateOf<M>& end) {
    if constexpr (indicators > 0) {
      if (cut_.left == 0) return true;
      const Tangents probe = find_probe_times();
      Fixed<Dual, indicators> here, beside;
      evaluate_indicators(end.t, Tangents{}, q_, v_, here);
      auto q = q_;
      auto v = v_;
      move(probe, q, v);
      evaluate_indicators(end.t, probe, q, v, beside);
      bool part = false;
      for (std::size_t k = 0; k < seeds_at_once; ++k)
        for (std::size_t j = 0; j < cut_.left; ++j) {
          const double open = here[cut_.which[j]].derivative[k], change = open == 0.0 ? 0.0 : -probe[k] * open / (beside[cut_.which[j]].derivative[k] - open);
          if (!(change - change == 0.0)) return false;
          if (j == 0) dt_end_[k] = change;
          part = part || std::abs(change - dt_end_[k]) > 1e-6 * std::max(std::abs(change), std::abs(dt_end_[k]));
        }
      if (part && forces_jump(mechanism, end)) return refuse(Cause::simultaneous_events, end.t);
      move(dt_end_, q_, v_);
    }
    return true;
  }

  bool refuse(Cause cause, double t) {
    refused_ = cut_.fault(cause, t);
    return false;
  }

  /// Times in which the state changes by as much as along each seed.
  Tangents find_probe_times() const {
    Tangents probe{};
    const double rate = std::max(cutjoint::largest(qdot_at_event_), cutjoint::largest(vdot_at_event_));
    for (std::size_t k = 0; k < seeds_at_once; ++k) {
      double size = 0.0;
      for (const Dual& x : q_) size = std::max(size, std::abs(x.derivative[k]));
      for (const Dual& x : v_) size = std::max(size, std::abs(x.derivative[k]));
      probe[k] = size > 0.0 && rate > 0.0 ? size / rate : 1.0;
    }
    return probe;
  }

  void move(const Tangents& time, auto& q, auto& v) const {
    for (std::size_t i = 0; i < qdot_at_event_.size(); ++i) q[i].derivative += qdot_at_event_[i] * time;
    for (std::size_t i = 0; i < vdot_at_event_.size(); ++i) v[i].derivative += vdot_at_event_[i] * time;
  }

  void evaluate_indicators(double t, const Tangents& time, const auto& q, const auto& v, Fixed<Dual, indicators>& values) {
    auto& subject = this->subject();
    subject.begin_step(Dual(t, time), 1.0);
    subject.events(q.data(), v.data(), values.data());
  }

  /// Whether accelerations jump at the event.
  bool forces_jump(M& mechanism, const StateOf<M>& end) {
    if (!this->enter(mechanism, end)) return true;
    return jump(this->vdot_value_, vdot_at_event_);
  }

  /// Whether numbers are others than those before, by more than rounding.
  static bool jump(const auto& numbers, const Fixed<double, n>& before) {
    double most = 0.0, size = 1.0;
    for (std::size_t i = 0; i < n; ++i) most = std::max(most, std::abs(Dual(numbers[i]).value - before[i])), size = std::max(size, std::abs(before[i]));
    return most > 1e-6 * size;
  }

  // Steps

  /// An explicit method whose last stage is the first of the next step (FSAL).
  template <class Table>
  bool propagate_explicit(M& mechanism, const StateOf<M>& from, const StateOf<M>& end, double h) {
    constexpr std::size_t last = Table::stages - 1, all = indicators > 0 ? Table::all : Table::stages;
    std::array<Fixed<Dual, M::sizes.coordinates>, all> place_derivatives;
    std::array<Fixed<Dual, n>, all> speed_derivatives;
    const Dual length(h, -dt_begin_);
    from_ = q_;
    speeds_ = v_;
    stage_ = from;
    Dual now;
    const auto set_stage = [&](std::size_t stage) {
      q_ = from_;
      v_ = speeds_;
      add_derivatives(length, Table::weights[stage], place_derivatives, q_);
      add_derivatives(length, Table::weights[stage], speed_derivatives, v_);
      const double node = Table::nodes[stage].template as<double>();
      now = Dual(stage_.t = from.t + node * h, (1.0 - node) * dt_begin_);
      mechanism.begin_step(stage_.t, 1.0);
    };
    const auto derive = [&] {
      for (std::size_t i = 0; i < q_.size(); ++i) stage_.q[i] = q_[i].value;
      for (std::size_t i = 0; i < n; ++i) stage_.v[i] = v_[i].value;
      if (!this->enter(mechanism, stage_)) return false;
      this->set_dual_time(now);
      if (!this->find_accelerations()) return false;
      coordinate_rates<Dual>(charts(), q_.data(), v_.data(), coordinate_rates_.data());
      return true;
    };
    const auto keep = [&](std::size_t stage) { place_derivatives[stage] = coordinate_rates_, speed_derivatives[stage] = vdot_; };
    if (!is_derivative_known_) coordinate_rates<Dual>(charts(), q_.data(), v_.data(), coordinate_rates_.data());
    for (std::size_t stage = 0; stage < last;) {
      keep(stage);
      set_stage(++stage);
      if ((stage < last || wants_derivative_ || cut_.is_made) && !derive()) return false;
    }
    dt_end_ = Tangents{};
    if constexpr (indicators > 0)
      if (cut_.is_made) {
        keep(last);
        const auto places = q_;
        const auto speeds = v_;
        for (std::size_t stage = Table::stages; stage < all; ++stage) {
          set_stage(stage);
          if (!derive()) return false;
          keep(stage);
        }
        q_ = places;
        v_ = speeds;
        interpolate<Table>(length, from_, place_derivatives, q_, qdot_at_event_);
        interpolate<Table>(length, speeds_, speed_derivatives, v_, vdot_at_event_);
        mechanism.begin_step(stage_.t = end.t, 1.0);
        this->take_inputs(mechanism);
        if (!shift_to_event(mechanism, end)) return false;
      }
    this->take_inputs(mechanism);
    this->set_dual_time({stage_.t, dt_end_});
    normalise<Dual>(charts(), q_.data());
    return true;
  }

  // Coupled stages

  /// Jacobians of the equations of motion in the stages of a step; false if their matrix is singular.
  bool find_stages(M& mechanism, const StateOf<M>& from, double h) {
    this->along_ = {};
    return stages_.find(this->force_residual_, h, from, points_, [&](std::size_t i) {
      mechanism.begin_step(points_[i].t, 1.0);
      this->take_inputs(mechanism);
    });
  }

  /// The end of a step with coupled stages.
  bool propagate_stages(M& mechanism, const StateOf<M>& from, const StateOf<M>& end, double h) {
    from_ = q_, speeds_ = v_;
    const bool moves = !dt_begin_.is_zero();
    const auto solve = [&](auto& change) {
      for (std::size_t i = 0; i < points_.size(); ++i) {
        DualPart* const rows = change.data() + i * (n + m);
        if (moves || this->trajectories_) this->set_time(mechanism, {points_[i].t, (from.t + h - points_[i].t) / h * dt_begin_});
        this->force_residual_.subtract_jvp(stages_.derivative(i), stages_.q(i), stages_.v(i), this->dual_inputs(), rows);
        if (moves) this->force_residual_.subtract_time_jvp(points_[i], this->dt_, rows);
      }
      return this->force_residual_.solve(stages_.matrix(), change);
    };
    if (!this->propagate_implicit(stages_, points_.back(), -dt_begin_, solve)) return false;
    dt_end_ = Tangents{};
    this->set_time(mechanism, points_.back().t);
    if constexpr (indicators > 0)
      if (cut_.is_made) {
        StateOf<D> begin;
        begin.q = from_, begin.v = speeds_, begin.vdot = this->before_;
        return project_by_force_residual(points_.back()) && cut(mechanism, end, Dual(h, -dt_begin_), begin, stages_.shift());
      }
    return true;
  }

  /// From the end of a step to its cut, by the interpolant over the step with displacement `shift`.
  bool cut(M& mechanism, const StateOf<M>& end, const Dual& length, StateOf<D>& begin, Fixed<Dual, n> shift) {
    StateOf<D> done;
    done.q = q_, done.v = v_, done.vdot = vdot_;
    stepping::Interpolant<D> between(charts(), begin);
    typename stepping::Interpolant<D>::Vector at;
    between.join(length, begin, done, shift);
    between.at(Dual(cut_.share, (cut_.share - 1.0) / length.value * dt_begin_), at);
    std::copy_n(at.begin(), q_.size(), q_.begin());
    std::copy_n(at.begin() + q_.size(), n, v_.begin());
    const auto still = [](auto&... numbers) {
      const auto each = [](auto& some) {
        for (Dual& x : some) x.derivative = Tangents{};
      };
      (each(numbers), ...);
    };
    still(begin.q, begin.v, begin.vdot, done.q, done.v, done.vdot, shift);
    between.join(length.value, begin, done, shift);
    Dual share(cut_.share);
    share.derivative[0] = 1.0 / length.value;
    between.at(share, at);
    for (std::size_t i = 0; i < q_.size(); ++i) qdot_at_event_[i] = at[i].derivative[0];
    for (std::size_t i = 0; i < n; ++i) vdot_at_event_[i] = at[q_.size() + i].derivative[0];
    this->set_time(mechanism, end.t);
    if (!shift_to_event(mechanism, end)) return false;
    this->set_time(mechanism, {end.t, dt_end_});
    return true;
  }

  /// Project derivatives of a state onto the loops by the force residual, in the metric of the masses; the run uses that of its tangents, which differs by the
  /// violations that steps leave.
  bool project_by_force_residual(const StateOf<M>& state) {
    if constexpr (m > 0) {
      typename ForceResidual::Changes change;
      this->force_residual_.find(state.t, state.q, state.v, state.vdot, state.lambda, this->u_);
      mechanism_.constraint_residual(q_.data(), v_.data(), phi_.data(), phid_.data());
      if (!this->force_residual_.close_violations(phi_, change)) return false;
      from_ = q_;
      for (std::size_t i = 0; i < n; ++i) step_[i] = {0.0, change[i].derivative};
      retract<Dual>(charts(), from_.data(), step_.data(), q_.data());
      mechanism_.constraint_residual(q_.data(), v_.data(), phi_.data(), phid_.data());
      if (!this->force_residual_.close_violations(phid_, change)) return false;
      for (std::size_t i = 0; i < n; ++i) v_[i].derivative += change[i].derivative;
    }
    return true;
  }

  /// The projection at a step's end by the mechanism; false if loops stay open.
  bool project_loops() {
    if constexpr (m > 0) {
      const auto measure = [this] { mechanism_.constraint_residual(q_.data(), v_.data(), phi_.data(), phid_.data()); };
      const bool closed = close(phi_, q_, measure, [this] { retract<Dual>(charts(), from_.data(), step_.data(), q_.data()); }, from_);
      return closed && close(phid_, v_, measure, [this] { for (std::size_t i = 0; i < n; ++i) v_[i] = speeds_[i] + step_[i]; }, speeds_);
    }
    return true;
  }

  /// The largest value relative to 1 + the largest of `others`, or derivative relative to the largest along its seed; NaN if one is NaN.
  static double largest_share(const auto& numbers, const auto& others) {
    const Dual most = largest(numbers), size = largest(others);
    double share = most.value / (1.0 + size.value);
    for (std::size_t k = 0; k < seeds_at_once; ++k) {
      const double along = size.derivative[k] == 0.0 ? most.derivative[k] : most.derivative[k] / size.derivative[k];
      if (!(along <= share)) share = along;
      if (along != along) break;
    }
    return share;
  }

  /// The largest absolute value and derivatives; NaN if one is NaN.
  static Dual largest(const auto& numbers) {
    Dual most, odd;
    for (const Dual& x : numbers) {
      most.derivative = larger(larger(x.derivative, -x.derivative), most.derivative);
      most.value = std::max(most.value, std::abs(x.value));
      odd.derivative += 0.0 * x.derivative;
      odd.value += 0.0 * x.value;
    }
    return most + odd;
  }

  /// Whether values and derivatives are at most `most`, as those of a violation that only rounding of parameters changes.
  static bool is_at_most(const auto& numbers, double most) {
    const Dual found = largest(numbers);
    for (std::size_t k = 0; k < seeds_at_once; ++k)
      if (!(found.derivative[k] <= most)) return false;
    return found.value <= most;
  }

  /// Project until a violation and its derivatives are rounding or no longer decrease.
  template <class Numbers, class Measure, class Move>
  bool close(const Fixed<Dual, m>& violation, Numbers& numbers, Measure measure, Move move, Numbers& before) {
    constexpr double rounding = 64 * std::numeric_limits<double>::epsilon();
    double factor = 1.0, last = std::numeric_limits<double>::infinity();
    for (int iteration = 0; iteration < 50; ++iteration) {
      measure();
      const double left = largest_share(violation, numbers);
      if (!(left <= std::numeric_limits<double>::max())) return false;
      if (iteration > 0) factor = left / last;
      if (left <= rounding || (iteration > 0 && factor > 0.5 && (left <= 1e-9 || is_at_most(violation, rounding)))) return true;
      before = numbers;
      mechanism_.project(q_.data(), violation.data(), step_.data());
      move();
      if (left * std::min(1.0, factor) <= rounding && iteration > 0) return true;
      last = left;
    }
    return false;
  }
};

}  // namespace cutjoint
