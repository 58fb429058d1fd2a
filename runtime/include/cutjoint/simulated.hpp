// A simulation for the driver, with its observers: guards, the balance of work and energy, impacts, residuals.
#pragma once

#include "cutjoint/core/simulation/simulation.hpp"
#include "cutjoint/domains.hpp"
#include "cutjoint/energy_balance.hpp"
#include "cutjoint/guards.hpp"
#include "cutjoint/near_jumps.hpp"
#include "cutjoint/read_settings.hpp"
#include "cutjoint/stop.hpp"

namespace cutjoint {

/// An integrator of equal steps with an observer after each.
template <class Integrator>
class Attended : public Integrator {
 public:
  using typename Integrator::Real, typename Integrator::Subject;
  using Integrator::Integrator;

  struct Watch {
    void (*call)(void* who, const StateOf<Subject>& state) = nullptr;
    void* who = nullptr;
  };

  void watch(const Watch& watch) { watch_ = watch; }

  Fault step(StateOf<Subject>& state, const SimulationSettings& settings, Real h, Real until, long number) {
    const Fault fault = Integrator::step(state, settings, h, until, number);
    if (!fault && watch_.call) watch_.call(watch_.who, state);
    return fault;
  }

 private:
  Watch watch_;
};

/// The method of a run (run.hpp) by an integrator of the core, with a row each `dt` of the settings.
template <class Integrator>
class Simulated {
  static constexpr bool finds_events = Integrator::finds_events;
  static constexpr bool is_newton = requires(Integrator& steps) { steps.newton(); };

 public:
  using Subject = typename Integrator::Subject;
  using Real = typename Subject::real_type;

  Simulated(Subject& subject, const RunSettings& settings, const Json& file)
      : subject_(subject), settings_(settings), file_(file), data_(subject.description(), file), guards_(subject), list_(subject, energy_),
        simulation_(subject, settings_from(settings), data_.parameters().data(), data_.roads().data()) {
    simulation_.drive_by(data_.inputs());
  }

  const List<Named>& columns() const { return subject_.description().columns; }
  const List<const char*>& coordinates() const { return subject_.description().coordinates; }

  /// Take over a start in relative coordinates with the penalties of its cut joints; `motion` is 0 for a mechanism at rest.  Throws Failure.
  void begin(const State<double>& start, const std::vector<double>& penalties, double motion) {
    require(simulation_.begin(State<Real>(start), converted<Real>(penalties), Real(motion), discrete()), method());
    if (finds_events && settings_.energy) state_.emplace(start);
    if (Integrator::knows_residuals) find_residuals();
    check(0);
  }

  /// Prepare for steps.
  void prepare() {
    if (settings_.energy) balance_energy();
    if constexpr (finds_events) steps().stepper().watch({.call = [](void* who, auto& scheme) { static_cast<Simulated*>(who)->end_step(scheme); }, .who = this});
    if (settings_.energy) simulation_.watch_samples({.call = [](void* who) { static_cast<Simulated*>(who)->restart(); }, .who = this});
    if (may_jump(subject_)) steps().watch_impacts({.reached = &reach, .left = &leave, .who = this});
    if constexpr (finds_events) steps().run_to(Real(count_steps<Real>(settings_).number) * Real(settings_.dt));
  }

  /// Throws Failure, or Stopped if a stop is requested before the row: the last row is then the previous one.
  void step(long number) {
    if constexpr (!finds_events) before_ = steps().iterations();
    require(simulation_.step(), finds_events && !is_newton ? "" : method());
    if (Integrator::knows_residuals) find_residuals();
    check(number);
    if (finds_events && !Integrator::knows_residuals && energy_) {
      const auto time = energy_->time();
      find_residuals();
    }
  }

  /// The motion to the failure begins at the previous row.
  Failure explain(const Failure& failure) { return explain_by_domains(subject_, simulation_.complete_state(), Real(settings_.dt), failure); }

  /// If the system has its coordinates, the starting mechanism may know a cause too, such as a friction load without a value.
  template <class M>
    requires(!std::is_same_v<M, Subject> && std::is_same_v<typename M::real_type, Real>)
  Failure explain(const Failure& failure, M& mechanism) {
    if (subject_.description().charts.empty()) return explain(failure);
    return explain(explain_by_domains(mechanism, simulation_.complete_state(), Real(settings_.dt), failure));
  }

  Real time() const { return simulation_.state().t; }

  const std::optional<EnergyBalance<Subject>>& energy() const { return energy_; }

  /// The coordinates of the last row.
  const std::vector<Real>& position() const { return simulation_.state().q; }

  void report(Real* column) {
    const State<Real>& x = simulation_.complete_state();
    subject_.report(x.q.data(), x.v.data(), x.vdot.data(), x.lambda.data(), column);
  }

  /// Report the values at a time after the row, or before it.
  void report_moved(Real time, Real* column) { cutjoint::report_moved(subject_, simulation_.complete_state(), time, column); }

  static constexpr auto step_columns = [] {
    if constexpr (finds_events) return std::array<std::string_view, 3>{"steps", "position", "velocity"};
    else if constexpr (is_newton) return std::array<std::string_view, 4>{"iterations", "position", "velocity", "acceleration"};
    else return std::array<std::string_view, 3>{"iterations", "position", "velocity"};
  }();

  /// The steps of a row, or the iterations of its step, and its largest residuals.
  const std::vector<double>& measure_step() {
    const Residuals row = find_residuals();
    long taken = 0;
    if constexpr (finds_events) {
      taken = steps().stepper().steps() - before_;
      before_ += taken;
    } else {
      taken = steps().iterations() - before_;
    }
    measured_ = {static_cast<double>(taken), row.position, row.velocity};
    if (is_newton && !finds_events) measured_.push_back(row.acceleration);
    return measured_;
  }

  void summarise(Json& summary) const {
    summary["evaluations"] = summary["iterations"] = 0;
    if (settings_.solver) summary["solver"] = *settings_.solver;
    if (!simulation_.is_started()) return;
    summary["evaluations"] = steps().evaluations();
    summary["iterations"] = steps().iterations();
    if constexpr (requires { steps().factorisations(); }) summary["factorisations"] = steps().factorisations();
    if constexpr (is_newton) summarise_newton(summary);
    if (energy_) energy_->summarise(summary);
    list_.summarise(summary);
    if (Integrator::knows_residuals || !measured_.empty() || energy_) summarise_residuals(summary);
    if constexpr (finds_events) {
      summarise_steps(steps().stepper().counts(), summary);
      if constexpr (requires { steps().stepper().scheme().stiff(); }) summary["stiff_steps"] = steps().stepper().scheme().stiff();
    }
  }

  /// The last state, in the form that `evaluate` reads.
  Json state() const requires(!Integrator::finds_events) { return write(simulation_.state(), simulation_.discrete_values()); }

  /// Save the state, if a guard may end the run after it.
  void keep() {
    if (!guards_.empty()) kept_.emplace(simulation_.state(), simulation_.discrete_values());
  }

  /// The state saved last, or null.
  Json kept() const { return kept_ ? write(kept_->first, kept_->second) : Json(); }

 private:
  using Steps = std::conditional_t<finds_events, Integrator, Attended<Integrator>>;
  using Stepped = Simulation<Subject, Steps>;

  Steps& steps() { return simulation_.steps(); }
  const Steps& steps() const { return simulation_.steps(); }

  static auto settings_from(const RunSettings& settings) {
    using Own = typename Stepped::Settings;
    auto own = [&] {
      if constexpr (std::is_constructible_v<Own, const RunSettings&>) return Own(settings);
      else return simulation_settings(settings);
    }();
    if (settings.task == Task::simulate || settings.task == Task::realtime) own.end = static_cast<double>(count_steps<Real>(settings).number) * settings.dt;
    return own;
  }

  /// The name of the method for failures of systems.
  std::string_view method() const {
    if constexpr (requires { name_of(subject_.description().method); }) return name_of(subject_.description().method);
    return "";
  }

  /// Throws Failure if there is a fault.
  void require(const Fault& fault, std::string_view method) const {
    if (!fault) return;
    const Failure failure = failure_of(fault, subject_.description(), fault.list == FaultList::indicators ? "" : method);
    if constexpr (is_newton) throw explain_tangent(subject_.description(), fault, steps().newton().tangent().data(), failure);
    throw failure;
  }

  static Json write(const State<Real>& at, const std::vector<Real>& discrete) {
    const State<double> plain(at);
    Json state{{"t", plain.t}, {"q", plain.q}, {"v", plain.v}, {"vdot", plain.vdot}, {"lambda", plain.lambda}};
    state["discrete_states"] = Json::array();
    for (const Real value : discrete) state["discrete_states"].push_back(number_or_null(static_cast<double>(value)));
    return state;
  }

  /// The values of controllers in a continued run; NaN before their first samples.
  std::optional<std::vector<Real>> discrete() const {
    if (!file_.contains("initial_state")) return std::nullopt;
    std::vector<Real> values;
    for (const Json& value : file_.at("initial_state").at("discrete_states"))
      values.push_back(value.is_null() ? std::numeric_limits<Real>::quiet_NaN() : Real(value.get<double>()));
    return values;
  }

  void check(long number) {
    if (guards_.empty()) return;
    if constexpr (finds_events) subject_.begin_step(simulation_.state().t, Real(1));
    guards_.check(simulation_.state(), number);
  }

  void balance_energy() {
    energy_.emplace(subject_, state_ ? *state_ : simulation_.state());
    if constexpr (!finds_events) steps().watch({.call = [](void* who, const State<Real>& state) { static_cast<Simulated*>(who)->add_step(state); }, .who = this});
  }

  void end_step(auto& scheme) {
    if (stop_requested()) throw Stopped();
    if (!energy_) return;
    const auto time = energy_->time();
    scheme.read_end(*state_);
    add_between(scheme, *state_);
  }

  void add_between(auto& scheme, const State<Real>& end) {
    energy_->add(end, [&](Real t, State<Real>& state) { scheme.read_between(t, state); });
  }

  /// After a controller's sample the next step begins with new accelerations.
  void restart() {
    const auto time = energy_->time();
    energy_->add(simulation_.complete_state());
  }

  void add_step(const State<Real>& end) {
    const auto time = energy_->time();
    if constexpr (is_newton) energy_->add(steps().with_reactions(end));
    else energy_->add(end);
    if (!Integrator::knows_residuals) find_residuals(end);
  }

  static void reach(void* who, State<Real>& state) {
    Simulated& own = *static_cast<Simulated*>(who);
    if (!own.energy_) return;
    const auto time = own.energy_->time();
    if constexpr (finds_events) {
      auto& scheme = own.steps().stepper().scheme();
      scheme.complete_struck(state);
      own.add_between(scheme, state);
    } else {
      own.energy_->add(state);
    }
  }

  static void leave(void* who, const State<Real>& state, Real work, std::size_t which) { static_cast<Simulated*>(who)->list_.leave(state, work, which); }

  Residuals find_residuals() { return find_residuals(simulation_.state()); }

  Residuals find_residuals(const State<Real>& state) {
    const Residuals row = residuals_of(state);
    worst_ = worst_of(worst_, row);
    return row;
  }

  Residuals residuals_of(const State<Real>& state) {
    if constexpr (requires { steps().residuals(state); }) {
      return steps().residuals(state);
    } else {
      residual_.resize(state.lambda.size());
      rate_.resize(state.lambda.size());
      subject_.constraint_residual(state.q.data(), state.v.data(), residual_.data(), rate_.data());
      return {static_cast<double>(largest(residual_)), static_cast<double>(largest(rate_)), 0.0};
    }
  }

  void summarise_steps(const auto& counts, Json& summary) const {
    summary["steps"] = counts.steps;
    summary["rejected"] = counts.rejected;
    summary["events"] = counts.events;
    Json by_element = Json::object();
    for (std::size_t i = 0; i < counts.by_indicator.size(); ++i)
      if (const long n = counts.by_indicator[i]; n > 0) {
        Json& known = by_element[subject_.description().indicators[i].element];
        known = known.is_null() ? n : known.template get<long>() + n;
      }
    summary["events_by_element"] = by_element;
  }

  void summarise_newton(Json& summary) const {
    const auto& newton = steps().newton();
    const Weights<Real> weights = newton.step_weights();
    if (subject_.description().method != decltype(subject_.description().method)::classical)
      summary["penalty"] = number_or_null(static_cast<double>(weights.constraint / weights.stiffness));
    summary["substeps"] = newton.substeps();
    summary["pivoting_fallbacks"] = steps().solver().fallbacks();
  }

  void summarise_residuals(Json& summary) const {
    Residuals worst = worst_;
    if constexpr (requires { steps().worst_residuals(); }) worst = steps().worst_residuals();
    Json residuals{{"position", number_or_null(worst.position)}, {"velocity", number_or_null(worst.velocity)}};
    if (is_newton) residuals["acceleration"] = number_or_null(worst.acceleration);
    summary["residuals"] = residuals;
  }

  Subject& subject_;
  const RunSettings& settings_;
  const Json& file_;
  ModelData<Real> data_;
  Guards<Subject> guards_;
  std::optional<EnergyBalance<Subject>> energy_;
  ImpactList<Subject> list_;
  Stepped simulation_;
  std::optional<State<Real>> state_;  ///< at the end of a step, if energy is balanced
  std::vector<Real> residual_, rate_;
  std::vector<double> measured_;
  std::optional<std::pair<State<Real>, std::vector<Real>>> kept_;
  Residuals worst_;
  long before_ = 0;  ///< steps before the row, or iterations before the step
};

}  // namespace cutjoint
