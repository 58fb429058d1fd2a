// Adjoint sensitivities: derivatives of objectives of a run, computed from its end to its beginning.
#pragma once

#include "cutjoint/core/derivatives/step_derivatives.hpp"

namespace cutjoint {

template <class Real, class Fits>
class LoopFits;

/// No embedded loops that are fitted with parameters.
struct NoFits {
  static constexpr int length = 0;
};

/// `StepDerivatives` with the transposed functions T of the mechanism (formulate/transposed.py), which accumulate derivatives with respect to parameter values,
/// `loaded` of them; `Fits` are the embedded loops fitted with these.
///
/// The run is recorded by substeps. Backwards, derivatives with respect to everything at the end of a substep become those at its beginning.
/// An implicit step takes one solution of the transposed equations, with the matrix of its forward derivatives.
template <class Simulation, Sized D, Sized S, std::size_t dofs, class T, std::size_t loaded, class Fits, class ForceResidual>
class Adjoint : public StepDerivatives<Simulation, D, S, dofs, ForceResidual> {
 public:
  using Base = StepDerivatives<Simulation, D, S, dofs, ForceResidual>;
  using typename Base::Trajectory, typename Base::M, typename Base::Minimal;
  using Base::inputs, Base::parameters, Base::states;

 private:
  using Base::m, Base::n, Base::averages, Base::indicators, Base::is_explicit, Base::has_stages, Base::carries_derivative, Base::is_derivative_known_, Base::seeks_multipliers, Base::exogenous, Base::charts, Base::simulation_, Base::blocks_;
  static constexpr std::size_t orders = InputTrajectories<inputs>::orders, coordinates = M::sizes.coordinates, discrete = M::sizes.discrete, length = coordinates + (averages ? 3 : 2) * n + m;

 public:
  /// Doubles of a record: a substep, a controller sample or an output sample.
  static constexpr std::size_t stages = has_stages ? radau::Table::stages : 0, record = 4 + (2 + stages) * length + discrete;

  /// Room for records: the number of substeps, controller samples and output samples of a run.
  struct Tape {
    double* numbers;
    std::size_t records;
  };

  /// Objectives, sums of the outputs of all samples with `weights` (number, samples, outputs), and their derivatives (number, states), (number, inputs) and
  /// (number, parameters).
  struct Objectives {
    std::size_t number;
    const double* weights;
    double *by_state, *by_input, *by_parameter;
  };

  /// Take this many steps, and differentiate objectives with respect to the initial states, a constant shift of each input, and
  /// parameters.
  Fault adjoint_sensitivities(Simulation& simulation, Minimal& minimal, long steps, Trajectory trajectory, const Objectives& objectives, const Tape& tape) {
    const auto begun = simulation.memory();
    this->open(simulation, minimal, nullptr);
    tape_ = tape;
    records_ = 0;
    const Fault missed = record_run(steps, trajectory);
    const auto ended = simulation.memory();
    simulation.restore(begun);
    if (missed) return missed;
    load_transposed();
    const std::size_t rows = static_cast<std::size_t>(steps / trajectory.every) + 1;
    begun_at_ = simulation.state().t;
    Fault fault;
    for (std::size_t i = 0; i < objectives.number && !fault; ++i) {
      objective_ = i;
      fault = sweep_backward(trajectory.number, objectives.weights + i * rows * trajectory.number, rows);
      if (!fault) fault = initial_derivatives(objectives, i);
    }
    simulation.restore(fault ? begun : ended);
    return fault;
  }

 private:
  static constexpr std::size_t max_projections = m > 0 ? 8 : 1;  ///< iterations of a projection

  enum class Kind : int { substep, controller_sample, output_sample, cut };  ///< `cut`: the substep before is cut at an event
  using Numbers = Fixed<double, n>;

  static constexpr std::size_t balls = coordinates - M::sizes.joint_speeds();
  static constexpr std::size_t unknowns = n + m;
  using ByColumns = Fixed<double, ForceResidual::first_acceleration>;  ///< with respect to all that the force residual reads
  using Unknowns = Fixed<double, unknowns>;

  /// A state whose time is unused, or derivatives with respect to one.
  struct Point : StateOf<M> {
    Fixed<double, averages ? n : 0> mean;

    void take(const StateOf<M>& state) { StateOf<M>::operator=(state); }

    void visit(auto use) { use(this->q), use(this->v), use(this->vdot), use(this->lambda), use(mean); }

    void clear() {
      visit([](auto& numbers) { numbers.fill(0.0); });
    }
  };

  static constexpr int restarted = 2, average_restarted = 4;  ///< flags of a substep's number: it begins with new accelerations, or its rule averages those of the state

  struct Record {
    Kind kind;
    double h = 0.0, t = 0.0;  ///< length and beginning of a substep
    int first = 0, number = 0;  ///< values of a sample; `number` is 1 for a substep that begins with the derivative of the one before (explicit), or with its accelerations (Newton), or that does not end with its own
    Point from, end;            ///< for such a substep `end` has the derivative: rates of coordinates, and accelerations
    std::array<Point, stages> between;
    Fixed<double, discrete> values;  ///< that controllers hold during the substep
    bool is_restarted = false, restarts_average = false;  ///< of a substep
  };

  // The record

  Fault record_run(long steps, Trajectory& trajectory) {
    blocks_ = {};
    blocks_[0].discrete = discrete;
    this->recorder_ = {&record_substep, &record_controller_sample, &record_output_sample, this};
    const Fault fault = this->go_on(steps, trajectory);
    this->recorder_ = {};
    return fault;
  }

  static Fault record_output_sample(void* who, Trajectory& trajectory) {
    Adjoint& x = *static_cast<Adjoint*>(who);
    const double* known = x.simulation_->report();
    for (std::size_t i = 0; i < trajectory.number; ++i) *trajectory.values++ = known[trajectory.outputs[i]];
    x.outputs_ = trajectory.outputs;
    x.record_.number = 0;
    x.record_.from.take(x.simulation_->complete_state());
    return x.write(Kind::output_sample, x.simulation_->state().t, 0.0);
  }

  static Fault record_substep(void* who, const StateOf<M>& from, const StateOf<M>& end, double h) {
    Adjoint& x = *static_cast<Adjoint*>(who);
    x.record_.from.take(from);
    x.record_.end.take(end);
    x.record_.number = 0;
    if constexpr (carries_derivative) {
      x.record_.number = x.is_derivative_known_;
      std::copy_n(x.first_derivative_.begin(), coordinates, x.record_.end.q.begin());
      std::copy_n(x.first_derivative_.begin() + coordinates, n, x.record_.end.vdot.begin());
    }
    if constexpr (seeks_multipliers) x.record_.number = x.is_short(h);
    if constexpr (has_stages) {
      x.record_.number = x.is_known(from);
      for (std::size_t i = 0; i < stages; ++i) x.record_.between[i].take(x.points_[i]);
    }
    if constexpr (averages) x.record_.from.mean = x.means_;
    x.record_.number += (x.begins_anew(from) ? restarted : 0) + (x.restarts_average_ ? average_restarted : 0);
    if (const Fault fault = x.write(Kind::substep, from.t, h)) return fault;
    return x.cut_.is_made ? x.record_cut(end) : Fault{};
  }

  /// A cut of the last substep: at a fraction of its length, in a state where indicators change mode.
  Fault record_cut(const StateOf<M>& end) {
    const auto& cut = this->cut_;
    if (cut.left > length) return cut.fault(Cause::step_subdivided, end.t);
    record_.from.take(end);
    record_.number = static_cast<int>(cut.left);
    if (const Fault fault = write(Kind::cut, end.t, cut.share)) return fault;
    double* const which = tape_.numbers + (records_ - 1) * record + 4 + length;
    for (std::size_t j = 0; j < cut.left; ++j) which[j] = static_cast<double>(cut.which[j]);
    return {};
  }

  static Fault record_controller_sample(void* who, std::size_t first, std::size_t number) {
    Adjoint& x = *static_cast<Adjoint*>(who);
    x.record_.from.take(x.simulation_->complete_state());
    x.record_.first = static_cast<int>(first), x.record_.number = static_cast<int>(number);
    return x.write(Kind::controller_sample, x.simulation_->state().t, 0.0);
  }

  Fault write(Kind kind, double t, double h) {
    if (records_ == tape_.records) return {.cause = Cause::too_many_steps, .t = t, .step = static_cast<long>(records_)};
    double* x = tape_.numbers + records_++ * record;
    *x++ = static_cast<double>(kind);
    *x++ = kind == Kind::controller_sample ? record_.first : h;
    *x++ = t;
    *x++ = record_.number;
    const auto put = [&x](const auto& numbers) { x = std::copy(numbers.begin(), numbers.end(), x); };
    record_.from.visit(put), (kind == Kind::substep ? record_.end : record_.from).visit(put);
    for (Point& stage : record_.between) stage.visit(put);
    if constexpr (discrete > 0) {
      M& mechanism = simulation_->mechanism();
      mechanism.begin_step(t, 1.0);
      std::copy_n(mechanism.last_inputs() + (exogenous - discrete), discrete, x);
      mechanism.begin_step(simulation_->state().t, 1.0);
    }
    return {};
  }

  void read(std::size_t place) {
    const double* x = tape_.numbers + place * record;
    record_.kind = static_cast<Kind>(static_cast<int>(*x++));
    record_.h = *x++, record_.first = static_cast<int>(record_.h);
    record_.t = *x++;
    record_.number = static_cast<int>(*x++);
    const int number = record_.kind == Kind::substep ? record_.number : 0;
    record_.is_restarted = number & restarted, record_.restarts_average = number & average_restarted;
    record_.number -= number & (restarted | average_restarted);
    const auto take = [&x](auto& numbers) { std::copy_n(x, numbers.size(), numbers.begin()), x += numbers.size(); };
    record_.from.visit(take), record_.end.visit(take);
    for (Point& stage : record_.between) stage.visit(take);
    std::copy_n(x, discrete, record_.values.begin());
  }

  // Backward sweep

  void load_transposed() {
    Simulation& simulation = *simulation_;
    if constexpr (exogenous > 0) transposed_.drive_by(this->plain_inputs());
    load_mechanism(transposed_, simulation.parameters().data(), simulation.roads(), simulation.stabilisation(), simulation.penalties());
  }

  /// Return to a time, with the values of controllers there.
  void begin_step(double t, [[maybe_unused]] const Fixed<double, discrete>& values) {
    M& mechanism = simulation_->mechanism();
    if constexpr (discrete > 0) simulation_->set_discrete_values(values);
    mechanism.begin_step(t, 1.0);
    if constexpr (exogenous > 0) std::copy_n(mechanism.last_inputs(), exogenous, this->u_.begin());
    transposed_.begin_step(t, 1.0);
  }

  Fault sweep_backward(std::size_t number, const double* weights, std::size_t rows) {
    by_.clear();
    by_loaded_.fill(0.0), by_parameter_.fill(0.0), by_input_.fill(0.0), by_discrete_.fill(0.0);
    if (this->trajectories_) this->trajectories_->clear_derivatives(objective_);
    owes_derivative_ = false;
    read(records_ - 1);
    by_residual_values_.fill(0.0);
    for (std::size_t place = records_; place-- > 0;) {
      select_pieces(record_);
      const bool is_part = record_.kind == Kind::substep || record_.kind == Kind::cut;
      const Point before_sample = by_;
      if (has_stages && !is_part) by_.vdot.fill(0.0), by_.lambda.fill(0.0);
      if (record_.kind == Kind::output_sample) reverse_output_sample(number, weights + --rows * number);
      else if (record_.kind == Kind::controller_sample) reverse_controller_sample();
      else if (is_at_event(place)) {
        if (const Fault fault = reverse_events(place)) return fault;
      } else if (!reverse_substep()) return not_finite_step();
      if constexpr (has_stages) {
        if ((!is_part || record_.number == 0) && !reverse_accelerations(record_)) return not_finite_step();
        if (!is_part) by_.vdot = before_sample.vdot, by_.lambda = before_sample.lambda;
        if (place > 0) read(place - 1);
        continue;
      }
      if (place == 0) return is_explicit && !reverse_accelerations(record_) ? not_finite_step() : Fault{};
      const Record later = record_;
      read(place - 1);
      const bool is_new = record_.kind == Kind::controller_sample || later.is_restarted;
      const bool recomputes_end = seeks_multipliers && record_.number == 1;
      const bool reuses_accelerations = is_explicit ? is_part : !is_new && !recomputes_end && later.from.vdot == record_.end.vdot;
      if (!reuses_accelerations && !reverse_accelerations(later)) return not_finite_step();
    }
    return {};
  }

  Fault not_finite_step() const { return {.cause = Cause::accelerations_not_finite, .t = record_.t}; }

  /// From derivatives with respect to accelerations and multipliers that were computed from a state to those with respect to the state.
  bool reverse_accelerations(const Record& at) {
    select_pieces(at);
    begin_step(at.t, at.values);
    put(at.from, at.t);
    if (!enter_stage()) return false;
    Point of = by_;
    by_.vdot.fill(0.0), by_.lambda.fill(0.0);
    return accelerations_vjp(of.vdot, of.lambda, by_);
  }

  /// Select the pieces of input trajectories for a record: those of a substep, or those at a time.
  void select_pieces(const Record& at) {
    if (!this->trajectories_) return;
    if (at.kind == Kind::substep) this->trajectories_->select_pieces_within(at.t, at.t + at.h);
    else if (at.t > begun_at_) this->trajectories_->select_pieces_until(at.t);
    else this->trajectories_->select_pieces_within(at.t, std::numeric_limits<double>::infinity());
  }

  const StateOf<M>& put(const Point& point, double t) {
    stage_ = point;
    stage_.t = t;
    return stage_;
  }

  void reverse_output_sample(std::size_t number, const double* weights) {
    begin_step(record_.t, record_.values);
    by_outputs_.fill(0.0);
    for (std::size_t i = 0; i < number; ++i) by_outputs_[static_cast<std::size_t>(outputs_[i])] += weights[i];
    outputs_vjp(&T::report_transposed, by_outputs_.data());
  }

  void reverse_controller_sample() {
    if constexpr (discrete > 0) {
      begin_step(record_.t, record_.values);
      Fixed<double, discrete> by_next;
      for (int i = record_.first; i < record_.first + record_.number; ++i) std::swap(by_next[static_cast<std::size_t>(i)], by_discrete_[static_cast<std::size_t>(i)]);
      outputs_vjp(&T::sample_transposed, by_next.data());
    }
  }

  /// Derivatives with respect to a function of the state become derivatives with respect to the state.
  void outputs_vjp(auto function, const double* by) {
    const Point& x = record_.from;
    (transposed_.*function)(x.q.data(), x.v.data(), x.vdot.data(), x.lambda.data(), by, more_.q.data(), more_.v.data(), more_.vdot.data(), more_.lambda.data(),
                            more_loaded_.data(), more_input_.data());
    add(more_.q, by_.q), add(more_.v, by_.v), add(more_.vdot, by_.vdot), add(more_.lambda, by_.lambda);
    add_sums();
  }

  static void add(const auto& more, auto& to) {
    for (std::size_t i = 0; i < more.size(); ++i) to[i] += more[i];
  }

  void add_sums() {
    add(more_loaded_, by_loaded_);
    add_inputs();
  }

  void add_inputs() {
    for (std::size_t i = 0; i < exogenous - discrete; ++i) by_input_[i] += more_input_[i];
    if (this->trajectories_) this->trajectories_->vjp(objective_, more_input_.data());
    for (std::size_t i = 0; i < discrete; ++i) by_discrete_[i] += more_input_[exogenous - discrete + i];
  }

  bool reverse_substep() {
    if constexpr (is_explicit) return reverse_explicit_step<typename Simulation::Steps::Method>();
    else if constexpr (averages) return reverse_averages([this] { return reverse_implicit_step(); });
    else return reverse_implicit_step();
  }

  /// From derivatives at the end of a step, averaged accelerations included, to those at its beginning.
  bool reverse_averages(auto rest) {
    const Numbers by_mean = by_.mean;
    this->means_ = record_.from.mean;
    this->begin_rule(put(record_.from, record_.t), record_.h);
    const auto share = this->formula_.average_weights();
    for (std::size_t i = 0; i < n; ++i) by_.vdot[i] += share.end * by_mean[i];
    if (!rest()) return false;
    for (std::size_t i = 0; i < n; ++i) by_.vdot[i] += share.begin * by_mean[i], by_.mean[i] += share.mean * by_mean[i];
    if (record_.restarts_average) add(by_.mean, by_.vdot), by_.mean.fill(0.0);
    return true;
  }

  // Substeps up to events, and after them

  Kind kind_at(std::size_t place) const { return static_cast<Kind>(static_cast<int>(tape_.numbers[place * record])); }
  bool ends_at_event(std::size_t place) const { return kind_at(place) == Kind::cut && tape_.numbers[place * record + 3] > 0.0; }

  /// Whether a substep is cut, or begins at an event.
  bool is_at_event(std::size_t place) const { return indicators > 0 && (record_.kind == Kind::cut || (place > 0 && ends_at_event(place - 1))); }

  /// From derivatives at the end of substeps with events in between, or at the cut of the last one, to those at the beginning of the first, whose index is returned;
  /// by forward mode with respect to everything at the beginning.
  Fault reverse_events(std::size_t& place) {
    const std::size_t last = place;
    place -= kind_at(place) == Kind::cut ? 1 : 0;
    while (place > 0 && ends_at_event(place - 1)) place -= 2;
    constexpr std::size_t moving = coordinates + n + (carries_derivative ? n + coordinates : has_stages ? n : 0);
    Fixed<double, discrete + moving + inputs + parameters> found;
    const auto follow = [&](std::size_t number, double* derivatives) {
      if (const Fault fault = differentiate_substeps(place, last, number)) return fault;
      add_carried(number, derivatives);
      return Fault{};
    };
    if (const Fault fault = along_seeds(states, discrete + moving, place, last, follow, found.data())) return fault;
    read(place);
    const double* x = found.data();
    const auto take = [&x](auto& derivatives) { std::copy_n(x, derivatives.size(), derivatives.begin()), x += derivatives.size(); };
    by_.clear();
    for (double& derivative : by_discrete_) derivative += *x++;
    take(by_.q), take(by_.v);
    if constexpr (has_stages) take(by_.vdot);
    if constexpr (carries_derivative) take(by_derivative_), take(by_coordinate_rates_);
    owes_derivative_ = carries_derivative && record_.number == 1;
    for (std::size_t i = 0; i < inputs; ++i) by_input_[numbers_per_input * i] += *x++;
    for (double& derivative : by_parameter_) derivative += *x++;
    return {};
  }

  /// Along a number of rows of the matrix of seeds from one on, inputs and parameters, and along the pieces of input trajectories that the substeps touch: `follow` adds to derivatives.
  Fault along_seeds(std::size_t begin, std::size_t rows, std::size_t place, std::size_t last, auto follow, double* found) {
    std::array<int, seeds_at_once> by{};
    const std::size_t all = rows + inputs + parameters;
    for (std::size_t first = 0; first < all; first += seeds_at_once) {
      const std::size_t number = std::min(seeds_at_once, all - first);
      open_seeds(number, by);
      for (std::size_t k = 0, which = first; k < number; ++k, ++which)
        if (which >= rows) by[k] = static_cast<int>(which - rows);
        else matrix_[(begin + which) * number + k] = 1.0;
      if (const Fault fault = follow(number, found + first)) return fault;
    }
    return visit_pieces(place, last, [&](double* derivatives) {
      open_seeds(orders, by);
      return follow(orders, derivatives);
    });
  }

  /// Add the derivatives of an objective along the carried seeds.
  void add_carried(std::size_t number, double* derivatives) {
    for (std::size_t k = 0; k < number; ++k) {
      const double* row = this->carried_ + k;
      const auto add_rows = [&](const auto& by) {
        for (const double derivative : by) derivatives[k] += derivative * *row, row += number;
      };
      add_rows(by_.q), add_rows(by_.v);
      if (owes_derivative_) add_rows(by_derivative_), add_rows(by_coordinate_rates_);
      else if constexpr (!is_explicit) add_rows(by_.vdot), add_rows(by_.lambda), add_rows(by_.mean);
    }
  }

  /// This many seeds, zero at first; `by` says what each changes besides states.
  void open_seeds(std::size_t number, std::array<int, seeds_at_once>& by) {
    matrix_.fill(0.0);
    by.fill(-1);
    blocks_ = {};
    blocks_[0] = {matrix_.data(), number, -1, by.data(), discrete};
    this->carried_ = matrix_.data() + (states + discrete) * number;
    this->loaded_ = Base::no_row;
  }

  /// Add derivatives with respect to the coefficients of each piece of an input trajectory that the substeps touch, from `follow` along these.
  Fault visit_pieces([[maybe_unused]] std::size_t first, [[maybe_unused]] std::size_t last, [[maybe_unused]] auto follow) {
    if constexpr (inputs > 0) {
      auto* const trajectories = this->trajectories_;
      for (std::size_t i = 0; trajectories && i < trajectories->number(); ++i) {
        const auto piece_at = [&](std::size_t place, bool is_end) {
          read(place);
          select_pieces(record_);
          return trajectories->find(i, record_.t + (is_end && record_.kind == Kind::substep ? record_.h : 0.0));
        };
        const std::size_t end = piece_at(last, true);
        for (std::size_t piece = piece_at(first, false); piece <= end; ++piece) {
          double* const derivatives = trajectories->derivatives_of(objective_, i, piece);
          if (!derivatives) continue;
          trajectories->change_piece(i, piece);
          const Fault fault = follow(derivatives);
          trajectories->change_seeds(InputTrajectories<inputs>::Seeded::nothing);
          if (fault) return fault;
        }
      }
    }
    return {};
  }

  /// The same substeps, differentiated along seeds.
  Fault differentiate_substeps(std::size_t place, std::size_t last, std::size_t number) {
    this->begins_at_event_ = false;
    for (; place <= last; ++place) {
      read(place);
      select_pieces(record_);
      const StateOf<M> from = put(record_.from, record_.t);
      StateOf<M> end = from;
      const double h = record_.h;
      end.t = from.t + h;
      is_derivative_known_ = carries_derivative && record_.number == 1;
      if constexpr (carries_derivative) {
        std::copy(record_.end.q.begin(), record_.end.q.end(), this->first_derivative_.begin());
        std::copy(record_.end.vdot.begin(), record_.end.vdot.end(), this->first_derivative_.begin() + coordinates);
      }
      if constexpr (discrete > 0) simulation_->set_discrete_values(record_.values);
      if constexpr (has_stages) {
        put_stages(from.t, h);
        this->known_.fill(std::numeric_limits<double>::quiet_NaN());
        if (record_.number == 1) std::copy(from.vdot.begin(), from.vdot.end(), this->known_.begin());
      }
      this->cut_ = {};
      this->wants_derivative_ = owes_derivative_ && place == last;
      if (place < last && kind_at(place + 1) == Kind::cut) {
        read(++place);
        end = put(record_.from, record_.t);
        this->cut_ = {true, record_.h, static_cast<std::size_t>(record_.number), {}};
        for (std::size_t j = 0; j < this->cut_.left; ++j) this->cut_.which[j] = static_cast<std::size_t>(tape_.numbers[place * record + 4 + length + j]);
      }
      if constexpr (has_stages)
        if (!this->prepare_substep(*simulation_, from, end, h)) return not_finite_step();
      const Fault fault = this->propagate_seeds(from, end, h, 0, number);
      is_derivative_known_ = false;
      this->begins_at_event_ = this->cut_.left > 0;
      Base::last_.t = end.t;
      if (fault) return fault;
    }
    return this->end_at_event();
  }

  // Coupled stages

  void put_stages(double t, double h) {
    for (std::size_t i = 0; i < stages; ++i) this->points_[i] = put(record_.between[i], t + radau::Table::nodes[i + 1].template as<double>() * h);
  }

  /// From the end of a step to its beginning: its loops are projected by the force residual, and its stages need one solution of transposed equations.
  bool reverse_implicit_step() requires has_stages {
    const double h = record_.h;
    put_stages(record_.t, h);
    begin_step(record_.t + h, record_.values);
    if (!residual_loops_vjp()) return false;
    const auto find = [&](std::size_t i) { begin_step(this->points_[i].t, record_.values); };
    if (!this->stages_.find(this->force_residual_, h, record_.from, this->points_, find)) return false;
    return step_vjp(this->stages_, [&](auto& x, auto& by_q, auto& by_v) {
      if (!this->force_residual_.solve_transposed(this->stages_.matrix(), x)) return false;
      for (std::size_t i = 0; i < stages; ++i) {
        ByColumns by;
        this->force_residual_.vjp(this->stages_.derivative(i), x.data() + i * unknowns, by);
        find(i);
        add_columns(by, by_q[i], by_v[i]);
      }
      return true;
    });
  }

  /// Convert derivatives with respect to all that the force residual reads into those with respect to coordinates, velocities, inputs, discrete states and parameters; add them.
  void add_columns(const ByColumns& by, Fixed<double, coordinates>& by_q, Numbers& by_v) {
    const double* x = by.data();
    const auto add_next = [&x](auto& derivatives, std::size_t number) {
      for (std::size_t i = 0; i < number; ++i) derivatives[i] += *x++;
    };
    more_input_.fill(0.0);
    add_next(by_q, coordinates), add_next(by_v, n), add_next(more_input_, exogenous), add_next(by_residual_values_, by_residual_values_.size());
    add_inputs();
  }

  /// From derivatives with respect to displaced coordinates to those before; those with respect to the displacement are returned.
  Numbers retraction_vjp(const Fixed<double, coordinates>& from, const Numbers& displacement) {
    const Fixed<double, coordinates> later = by_.q;
    Numbers by_delta;
    by_.q.fill(0.0);
    RetractionDerivatives<balls>(charts(), from.data(), displacement.data()).vjp(charts(), later.data(), by_.q.data(), by_delta.data());
    return by_delta;
  }

  /// From derivatives after the projection by the force residual at the end to those before it.
  bool residual_loops_vjp() {
    if constexpr (m > 0) {
      const Point &open = record_.between.back(), &end = record_.end;
      this->force_residual_.find(record_.t + record_.h, end.q, end.v, end.vdot, end.lambda, this->u_);
      if (!this->force_residual_.violations_vjp(by_.v, by_violation_)) return false;
      residual_vjp(open, nothing_, by_violation_, by_.q, by_.v);
      const Numbers by_delta = retraction_vjp(open.q, Numbers());
      if (!this->force_residual_.violations_vjp(by_delta, by_violation_)) return false;
      residual_vjp(open, by_violation_, nothing_, by_.q, by_.v);
    }
    return true;
  }

  // The trapezoidal rule with multipliers that close the loops

  bool reverse_implicit_step() requires seeks_multipliers {
    const double h = record_.h;
    const StateOf<M> from = put(record_.from, record_.t), end = put(record_.end, record_.t + h);
    begin_step(end.t, record_.values);
    if (!this->find_rule(simulation_->mechanism(), from, end, h)) return false;
    const auto& force_residual = this->force_residual_;
    ByColumns by, projected;
    Unknowns by_first;
    std::copy(by_.lambda.begin(), by_.lambda.end(), std::copy(by_.vdot.begin(), by_.vdot.end(), by_first.begin()));
    if (!this->ends_.accelerations_vjp(force_residual, by_.vdot, by, projected, by_first)) return false;
    add_columns(projected, by_.q, by_.v);
    if (!this->ends_.vjp(this->ends_.speeds(), force_residual, by_.v, by, by_violation_, &by_first)) return false;
    residual_vjp(record_.end, nothing_, by_violation_, by_.q, by_.v);
    add_columns(by, by_.q, by_.v);
    Point rule;
    rule.take(stage_);
    std::copy_n(by_first.begin(), n, by_.vdot.begin()), std::copy_n(by_first.begin() + n, m, by_.lambda.begin());
    return step_vjp(this->formula_, [&](auto& x, auto& by_q, auto& by_v) {
      by.fill(0.0);
      if (!this->ends_.vjp(this->ends_.rule(), force_residual, x, by, by_violation_, nullptr)) return false;
      residual_vjp(rule, by_violation_, nothing_, by_q[0], by_v[0]);
      add_columns(by, by_q[0], by_v[0]);
      return true;
    });
  }

  // The trapezoidal rule

  bool reverse_implicit_step() requires(!seeks_multipliers && !has_stages) {
    const double h = record_.h;
    const StateOf<M> from = put(record_.from, record_.t), end = put(record_.end, record_.t + h);
    begin_step(end.t, record_.values);
    if (!this->converge_end(simulation_->mechanism(), from, end, h) || !closed_loops_vjp()) return false;
    return step_vjp(this->formula_, [&](auto& x, auto& by_q, auto& by_v) {
      ByColumns by;
      if (!this->force_residual_.end_vjp(x, by)) return false;
      add_columns(by, by_q[0], by_v[0]);
      return true;
    });
  }

  // Implicit steps

  /// From derivatives at the end of a step to those at its beginning: through the formulas of its stages, the `solution` of transposed equations for derivatives with respect to accelerations
  /// and multipliers, which adds to those of the stages' coordinates and velocities, and the formulas once more.
  template <class Formula, class Solution>
  bool step_vjp(const Formula& formula, Solution solution) {
    std::array<Fixed<double, coordinates>, Formula::stages> by_q{};
    std::array<Numbers, Formula::stages> by_v{}, by_vdot{};
    Fixed<double, Formula::stages * unknowns> x;
    Point begun;
    by_q.back() = by_.q, by_v.back() = by_.v, by_vdot.back() = by_.vdot;
    formula.vjp(by_q, by_v, begun, by_vdot);
    for (std::size_t i = 0; i < Formula::stages; ++i) std::copy(by_vdot[i].begin(), by_vdot[i].end(), x.begin() + i * unknowns);
    std::copy(by_.lambda.begin(), by_.lambda.end(), x.end() - m);
    if (!solution(x, by_q, by_v)) return false;
    begun.clear();
    formula.vjp(by_q, by_v, begun, by_vdot);
    by_ = begun;
    return true;
  }

  // Accelerations as functions of states

  /// Accelerations and multipliers of the stage; false if one is not a number.
  bool enter_stage() {
    if (!this->enter(simulation_->mechanism(), stage_)) return false;
    for (std::size_t i = 0; i < n; ++i) stage_.vdot[i] = this->vdot_value_[i];
    for (std::size_t i = 0; i < m; ++i) stage_.lambda[i] = this->lambda_value_[i] + this->lambda_update_[i];
    return true;
  }

  /// Add to derivatives with respect to the stage's coordinates and velocities those through its accelerations and multipliers: with loops by the residual's matrix,
  /// without loops by the transposed evaluation, which is cheaper.
  bool accelerations_vjp(const Numbers& by_vdot, const Fixed<double, m>& by_lambda, Point& to) {
    if constexpr (m > 0) {
      Unknowns by_accelerations;
      ByColumns by;
      std::copy(by_lambda.begin(), by_lambda.end(), std::copy(by_vdot.begin(), by_vdot.end(), by_accelerations.begin()));
      this->force_residual_.find(stage_.t, stage_.q, stage_.v, stage_.vdot, stage_.lambda, this->u_);
      if (!this->force_residual_.accelerations_vjp(by_accelerations, by)) return false;
      add_columns(by, to.q, to.v);
    } else {
      transposed_.evaluate_transposed(stage_.q.data(), stage_.v.data(), stage_.lambda.data(), by_vdot.data(), by_lambda.data(), more_.q.data(), more_.v.data(), more_.lambda.data(),
                                      more_loaded_.data(), more_input_.data());
      add(more_.q, to.q), add(more_.v, to.v);
      add_sums();
    }
    return true;
  }

  // Explicit methods

  template <class Table>
  bool reverse_explicit_step() {
    constexpr std::size_t stages = Table::stages - 1;
    const double h = record_.h;
    const bool begins_with_derivative = carries_derivative && record_.number == 1;
    std::array<Point, stages> points;
    std::array<Fixed<double, coordinates>, stages> rates, by_rates{};
    std::array<Numbers, stages> accelerations, by_accelerations{};
    const auto time = [&](std::size_t stage) { return record_.t + Table::nodes[stage].template as<double>() * h; };
    for (std::size_t stage = 0; stage <= stages; ++stage) {
      put(record_.from, time(stage));
      add_derivatives(h, Table::weights[stage], rates, stage_.q);
      add_derivatives(h, Table::weights[stage], accelerations, stage_.v);
      if (stage == stages) break;
      if (stage == 0 && begins_with_derivative) {
        rates[0] = record_.end.q, accelerations[0] = record_.end.vdot;
        continue;
      }
      begin_step(stage_.t, record_.values);
      if (!enter_stage()) return false;
      points[stage].take(stage_);
      accelerations[stage] = points[stage].vdot;
      coordinate_rates<double>(charts(), stage_.q.data(), stage_.v.data(), rates[stage].data());
    }
    begin_step(stage_.t, record_.values);
    const StateOf<M> end = stage_;
    normalise<double>(charts(), stage_.q.data());
    if (!closed_loops_vjp()) return false;
    lengths_vjp(charts(), end.q.data(), by_.q.data());
    const auto derivatives_vjp = [&](const Fixed<double, coordinates>& by_rate, const Numbers& by_acceleration, Point& to) {
      rates_vjp(charts(), stage_.q.data(), stage_.v.data(), by_rate.data(), to.q.data(), to.v.data());
      return accelerations_vjp(by_acceleration, Fixed<double, m>(), to);
    };
    if (owes_derivative_) {
      stage_ = end;
      begin_step(stage_.t, record_.values);
      if (!enter_stage() || !derivatives_vjp(by_coordinate_rates_, by_derivative_, by_)) return false;
    }
    owes_derivative_ = begins_with_derivative;
    Point by = by_;
    for (std::size_t stage = stages; stage-- > 0;) {
      add_derivatives_vjp(h, Table::weights[stage + 1], by.q, by_rates);
      add_derivatives_vjp(h, Table::weights[stage + 1], by.v, by_accelerations);
      if (stage == 0 && begins_with_derivative) {
        by_coordinate_rates_ = by_rates[0], by_derivative_ = by_accelerations[0];
        break;
      }
      by.clear();
      put(points[stage], time(stage));
      begin_step(stage_.t, record_.values);
      if (!derivatives_vjp(by_rates[stage], by_accelerations[stage], by)) return false;
      add(by.q, by_.q), add(by.v, by_.v);
    }
    by_.vdot.fill(0.0), by_.lambda.fill(0.0);
    return true;
  }

  // Closed loops

  /// From derivatives after the projection of the stage to those before it.
  bool closed_loops_vjp() {
    if constexpr (m > 0) {
      if (!is_explicit && !simulation_->settings().fixed_point.proximal) return true;
      std::array<Point, max_projections> places, speeds;
      std::array<Fixed<double, m>, max_projections> violations, rates;
      StateOf<M> now = stage_;
      std::size_t position_count = 0, velocity_count = 0;
      if (!record_projections(now, places, violations, position_count, true) || !record_projections(now, speeds, rates, velocity_count, false)) return false;
      for (std::size_t i = velocity_count; i-- > 0;) {
        const Point& x = speeds[i];
        move_vjp(x, rates[i], by_.v);
        residual_vjp(x, nothing_, by_violation_, by_.q, by_.v);
      }
      for (std::size_t i = position_count; i-- > 0;) {
        const Point& x = places[i];
        simulation_->mechanism().project(x.q.data(), violations[i].data(), found_values_.data());
        move_vjp(x, violations[i], retraction_vjp(x.q, found_values_));
        residual_vjp(x, by_violation_, nothing_, by_.q, by_.v);
      }
    }
    return true;
  }

  /// From derivatives with respect to the displacement that removes a violation to those with respect to the violation; those with respect to coordinates are added.
  void move_vjp(const Point& at, const Fixed<double, m>& violation, const Numbers& by_move) {
    transposed_.project_transposed(at.q.data(), violation.data(), by_move.data(), more_.q.data(), by_violation_.data(), more_loaded_.data(), more_input_.data());
    add(more_.q, by_.q);
    add_sums();
  }

  /// Add to derivatives with respect to coordinates and velocities those through the residual of loops and its rate.
  void residual_vjp(const Point& at, const Fixed<double, m>& by_residual, const Fixed<double, m>& by_rate, Fixed<double, coordinates>& by_q, Numbers& by_v) {
    transposed_.constraint_residual_transposed(at.q.data(), at.v.data(), by_residual.data(), by_rate.data(), more_.q.data(), more_.v.data(),
                                               more_loaded_.data(), more_input_.data());
    add(more_.q, by_q), add(more_.v, by_v);
    add_sums();
  }

  /// Displacements that project a state, and their rates; false if loops stay open.
  bool record_projections(StateOf<M>& now, std::array<Point, max_projections>& before, std::array<Fixed<double, m>, max_projections>& violations, std::size_t& number,
                    bool is_position) {
    constexpr double rounding = 64 * std::numeric_limits<double>::epsilon();
    M& mechanism = simulation_->mechanism();
    Fixed<double, m> residual, rate;
    double last = std::numeric_limits<double>::infinity();
    for (;;) {
      mechanism.constraint_residual(now.q.data(), now.v.data(), residual.data(), rate.data());
      const Fixed<double, m>& violation = is_position ? residual : rate;
      double left = 0.0, size = 1.0;
      for (const double x : violation) left = std::max(left, std::abs(x));
      for (const double x : now.v) size = is_position ? size : std::max(size, std::abs(x));
      if (!(left - left == 0.0)) return false;
      if (left <= rounding * size || (left > last / 2 && left <= 1e-9 * size)) return true;
      if (number == max_projections) return false;
      last = left;
      before[number].take(now);
      violations[number] = violation;
      mechanism.project(now.q.data(), violation.data(), found_values_.data());
      if (is_position) retract<double>(charts(), before[number].q.data(), found_values_.data(), now.q.data());
      else
        for (std::size_t i = 0; i < n; ++i) now.v[i] += found_values_[i];
      ++number;
    }
  }

  // The beginning

  /// Derivatives of an objective with respect to initial states, inputs and parameters.
  Fault initial_derivatives(const Objectives& objectives, std::size_t objective) {
    double* const by_state = objectives.by_state + objective * states;
    double* const by_input = objectives.by_input + objective * inputs;
    double* const by_parameter = objectives.by_parameter + objective * parameters;
    if constexpr (has_fits) transposed_.load_transposed(by_loaded_.data(), by_parameter, by_series_.data());
    else transposed_.load_transposed(by_loaded_.data(), by_parameter);
    Fixed<double, states + inputs + parameters> found;
    const auto follow = [&](std::size_t number, double* derivatives) {
      this->load_all();
      if (const Fault fault = this->find_carried()) return fault;
      add_carried(number, derivatives);
      const Dual* series = nullptr;
      if constexpr (has_fits) series = fits_.find(this->mechanism_, this->parameters_.data());
      for (std::size_t k = 0; k < number; ++k) {
        derivatives[k] += residual_values_jvp(k);
        for (std::size_t i = 0; series && i < by_series_.size(); ++i) derivatives[k] += by_series_[i] * series[i].derivative[k];
      }
      return Fault{};
    };
    if (const Fault fault = along_seeds(0, states, 0, 0, follow, found.data())) return fault;
    const double* x = found.data();
    for (std::size_t i = 0; i < states; ++i) by_state[i] = *x++;
    for (std::size_t i = 0; i < inputs; ++i) by_input[i] = by_input_[numbers_per_input * i] + *x++;
    for (std::size_t i = 0; i < parameters; ++i) by_parameter[i] += by_parameter_[i] + *x++;
    return {};
  }

  /// The derivative along a seed from derivatives with respect to parameter values in the force residual.
  double residual_values_jvp([[maybe_unused]] std::size_t k) const {
    double sum = 0.0;
    if constexpr (decltype(by_residual_values_)::size() > 0)
      for (std::size_t i = 0; i < by_residual_values_.size(); ++i) sum += by_residual_values_[i] * this->force_residual_.changes()[i].derivative[k];
    return sum;
  }

  using Base::stage_;

  static constexpr bool has_fits = Fits::length > 0;

  T transposed_;
  [[no_unique_address]] std::conditional_t<has_fits, LoopFits<Dual, Fits>, NoFits> fits_{};
  Fixed<double, static_cast<std::size_t>(Fits::length)> by_series_;
  Tape tape_{};
  std::size_t records_ = 0, objective_ = 0;
  double begun_at_ = 0.0;
  const int* outputs_ = nullptr;
  Record record_{};
  Point by_, more_;
  Fixed<double, coordinates> by_coordinate_rates_;  ///< derivatives with respect to the derivative at the beginning of the substep after, which is that at the end of the one before
  Numbers by_derivative_;
  bool owes_derivative_ = false;
  Fixed<double, loaded> by_loaded_, more_loaded_;
  Fixed<double, parameters> by_parameter_;  ///< through events
  Fixed<double, ForceResidual::loaded> by_residual_values_;  ///< with respect to parameter values in the force residual
  Fixed<double, exogenous> by_input_, more_input_;
  Fixed<double, discrete> by_discrete_;
  Fixed<double, Base::columns> by_outputs_;
  Fixed<double, m> by_violation_, nothing_;
  Numbers found_values_;
  Fixed<double, Base::rows * seeds_at_once> matrix_;
};

}  // namespace cutjoint
