// Accurate solutions to measure others by, as the driver sees them.
#pragma once

#include <array>
#include <optional>
#include <string_view>
#include <vector>

#include "cutjoint/guards.hpp"
#include "cutjoint/json.hpp"
#include "cutjoint/reference/controlled.hpp"
#include "cutjoint/reference/extrapolation.hpp"
#include "cutjoint/reference/fehlberg.hpp"
#include "cutjoint/reference/natural.hpp"
#include "cutjoint/reference/relative.hpp"
#include "cutjoint/run_file.hpp"

namespace cutjoint::reference {

/// Whether a run file asks for an accurate solution.
inline bool is_reference(const Json& file) { return file.value("integrator", "") == "reference"; }

/// Goes on from a start with steps as long as the run file's `tolerance` allows, from one row of the table to the next; guards are
/// checked at the rows.
template <class Dynamics, template <class> class Integrator, class Subject>
class Reference {
 public:
  using Real = typename Dynamics::Real;

  Reference(Subject& subject, Dynamics& dynamics, const Json& file)
      : subject_(subject), dynamics_(dynamics), file_(file), guards_(subject) {}

  const std::vector<Named>& columns() const { return subject_.description().columns; }

  /// Take over a start in the coordinates of the dynamics.
  void begin(const State<Real>& start) {
    y_ = dynamics_.begin(start);
    origin_ = t_ = start.t;
    check(0);
  }

  void prepare() {
    dt_ = read_number<Real>(file_.at("numerics"), "dt");
    controlled_.emplace(dynamics_, read_number<Real>(file_.at("numerics"), "tolerance"));
  }

  void step(long number) {
    const Real until = origin_ + Real(number) * dt_;
    controlled_->advance(t_, until, y_, number);
    t_ = until;
    check(number);
  }

  Real time() const { return t_; }

  void report(Real* column) {
    const State<Real>& x = dynamics_.complete(t_, y_);
    subject_.report(x.q.data(), x.v.data(), x.vdot.data(), x.lambda.data(), column);
  }

  static constexpr std::array<std::string_view, 1> step_columns{"steps"};

  std::vector<double> measure_step() const { return {static_cast<double>(controlled_->steps())}; }

  void summarise(Json& summary) const {
    summary["evaluations"] = dynamics_.evaluations();
    summary["iterations"] = controlled_ ? controlled_->steps() : 0;
  }

 private:
  void check(long number) {
    if (!guards_.empty()) guards_.check(dynamics_.complete(t_, y_), number);
  }

  Subject& subject_;
  Dynamics& dynamics_;
  const Json& file_;
  Guards<Subject> guards_;
  std::optional<Controlled<Dynamics, Integrator>> controlled_;
  std::vector<Real> y_;
  Real origin_{0}, t_{0}, dt_{0};
};

/// A mechanism in relative coordinates with extrapolation.
template <Mechanism M>
class RelativeReference : public Reference<Relative<M>, Extrapolation, M> {
 public:
  using Real = typename M::real_type;

  RelativeReference(M& mechanism, const Json& file)
      : Reference<Relative<M>, Extrapolation, M>(mechanism, dynamics_, file), inputs_(mechanism.description(), file),
        dynamics_(mechanism, read_number<Real>(file.at("numerics"), "tolerance") / 10000) {
    inputs_.load_mechanism(mechanism, file.at("stabilisation"), {});
  }

  void begin(const State<double>& start, double) { Reference<Relative<M>, Extrapolation, M>::begin(State<Real>(start)); }

 private:
  Inputs<Real> inputs_;
  Relative<M> dynamics_;
};

/// A system in natural coordinates with Fehlberg's formula.
template <class S>
class NaturalReference : public Reference<Natural<S>, Fehlberg, S> {
 public:
  using Real = typename S::real_type;

  NaturalReference(S& system, const Json& file)
      : Reference<Natural<S>, Fehlberg, S>(system, dynamics_, file), system_(system), inputs_(system.description(), file),
        solver_(choose_solver(system, "emitted")), dynamics_(system, *solver_) {
    inputs_.load_system(system);
  }

  void begin(const State<double>& start, double motion) {
    const State<Real> relative(start);
    const SystemDescription& d = system_.description();
    State<Real> natural(d.coordinates.size(), d.coordinates.size(), d.equations.size());
    natural.t = relative.t;
    system_.begin_step(relative.t, Real(motion));
    system_.place(relative.q.data(), relative.v.data(), natural.q.data(), natural.v.data());
    Reference<Natural<S>, Fehlberg, S>::begin(natural);
  }

 private:
  S& system_;
  Inputs<Real> inputs_;
  std::unique_ptr<LinearSolver<Real>> solver_;
  Natural<S> dynamics_;
};

}  // namespace cutjoint::reference
