// Accurate solutions to measure others by, as the driver sees them.
#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "cutjoint/json.hpp"
#include "cutjoint/reference/controlled.hpp"
#include "cutjoint/reference/extrapolation.hpp"
#include "cutjoint/reference/fehlberg.hpp"
#include "cutjoint/reference/natural.hpp"
#include "cutjoint/reference/row_by_row.hpp"
#include "cutjoint/core/mechanism/relative.hpp"
#include "cutjoint/run_file.hpp"

namespace cutjoint::reference {

/// The equation of a mechanism whose unknowns have names.
template <Mechanism M>
class NamedRelative : public Relative<M> {
 public:
  using Relative<M>::Relative;

  std::string name(std::size_t i) const {
    const Description& d = this->mechanism_.description();
    return std::string(i < d.coordinates.size() ? d.coordinates[i] : d.speeds[i - d.coordinates.size()]);
  }
};

/// A mechanism in relative coordinates with extrapolation.
template <Mechanism M>
class RelativeReference : public RowByRow<NamedRelative<M>, Controlled<NamedRelative<M>, Extrapolation>, M> {
  using Base = RowByRow<NamedRelative<M>, Controlled<NamedRelative<M>, Extrapolation>, M>;

 public:
  using Real = typename M::real_type;

  RelativeReference(M& mechanism, const RunSettings& settings, const Json& file)
      : Base(mechanism, dynamics_, settings), mechanism_(mechanism), data_(mechanism.description(), file),
        dynamics_(mechanism, Real(settings.tolerance) / 10000) {}

  void begin(const State<double>& start, const std::vector<double>& penalties, double) {
    data_.load_mechanism(mechanism_, this->settings().stabilisation, converted<Real>(penalties));
    Base::begin(State<Real>(start));
  }

  void prepare() { Base::prepare(Real(this->settings().tolerance)); }

 private:
  M& mechanism_;
  ModelData<Real> data_;
  NamedRelative<M> dynamics_;
};

/// A system in natural coordinates with Fehlberg's formula.
template <class S>
class NaturalReference : public RowByRow<Natural<S>, Controlled<Natural<S>, Fehlberg>, S> {
  using Base = RowByRow<Natural<S>, Controlled<Natural<S>, Fehlberg>, S>;

 public:
  using Real = typename S::real_type;

  NaturalReference(S& system, const RunSettings& settings, const Json& file)
      : Base(system, dynamics_, settings), system_(system), data_(system.description(), file),
        solver_(choose_solver(system, "emitted")), dynamics_(system, *solver_) {
    data_.drive(system);
    system.load(data_.parameters().data(), data_.roads().data());
  }

  void begin(const State<double>& start, const std::vector<double>&, double motion) {
    const State<Real> relative(start);
    const SystemDescription& d = system_.description();
    State<Real> natural(d.coordinates.size(), d.coordinates.size(), d.equations.size());
    natural.t = relative.t;
    system_.begin_step(relative.t, Real(motion));
    system_.initial_coordinates(relative.q.data(), relative.v.data(), natural.q.data(), natural.v.data());
    Base::begin(natural);
  }

  void prepare() { Base::prepare(Real(this->settings().tolerance)); }

 private:
  S& system_;
  ModelData<Real> data_;
  std::unique_ptr<LinearSolver<Real>> solver_;
  Natural<S> dynamics_;
};

}  // namespace cutjoint::reference
