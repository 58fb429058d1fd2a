// The start of a run in relative coordinates, as its run file asks for it.
#pragma once

#include <algorithm>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

#include "cutjoint/domains.hpp"
#include "cutjoint/effective_mass.hpp"
#include "cutjoint/mechanism.hpp"
#include "cutjoint/run_file.hpp"
#include "cutjoint/settings.hpp"
#include "cutjoint/start.hpp"
#include "cutjoint/state.hpp"

namespace cutjoint {

/// Loads a mechanism with the settings of a run and finds the state from which the run starts.
template <Mechanism M>
class InitialState {
 public:
  using Real = typename M::real_type;

  InitialState(M& mechanism, const RunSettings& settings, const Json& file)
      : mechanism_(mechanism), d_(mechanism.description()), settings_(settings), file_(file), state_(d_), data_(d_, file) {
    penalties_.assign(d_.cuts.size(), finds_penalties() ? Real(1) : Real(*settings_.stabilisation.penalty));  // until a pose is known
    data_.load_mechanism(mechanism_, settings_.stabilisation, penalties_);
  }

  InitialState(const InitialState&) = delete;
  InitialState& operator=(const InitialState&) = delete;

  /// A mechanism at rest, which no guide moves.  Throws Failure.
  const State<Real>& at_rest();

  /// A mechanism in motion, with speeds that keep its loops closed.  Throws Failure.
  const State<Real>& in_motion();

  /// Adds to a failure to start what is known of its cause.
  Failure explain(const Failure& failure) { return explain_by_domains(mechanism_, state_, Real(0), failure); }

  /// Penalties of the cut joints, known when a start has been found; the closure `penalty` has one for all.
  const std::vector<Real>& penalties() const { return penalties_; }

  /// Independent speeds that neither run file nor loops determine.
  const std::vector<std::string>& undetermined() const { return undetermined_; }

 private:
  bool is_proximal() const { return settings_.stabilisation.closure == Closure::proximal; }

  Starter<M> starter() const { return Starter<M>(mechanism_, is_proximal()); }

  void place();

  /// Whether the run finds its penalties; the proximal closure does so up to a given one.
  bool finds_penalties() const { return is_proximal() || !settings_.stabilisation.penalty; }

  /// Penalties from the effective masses in this pose, the given one their upper bound.
  ///
  /// Masses with the other cut joints open are measured by light penalties, then those with the others held by penalties of 1e4 times these.
  void weigh();

  /// Load the mechanism with penalties of so many times the masses, `most` at most.
  void load(const std::vector<Real>& masses, Real times, Real most) {
    for (std::size_t i = 0; i < masses.size(); ++i) penalties_[i] = std::min(times * masses[i], most);
    if (!is_proximal()) penalties_.assign(penalties_.size(), common_penalty(penalties_));
    data_.load_mechanism(mechanism_, settings_.stabilisation, penalties_);
    mechanism_.begin_step(state_.t, Real(0));
  }

  /// Turn the given attitudes, of followers beside their bases, into those of outer bodies beside inner ones.
  void turn_reversed(const std::vector<bool>& given) {
    for (const Chart& chart : d_.charts) {
      const auto first = static_cast<std::size_t>(chart.q + chart.scalars);
      if (!(chart.ball && chart.reversed && given[first])) continue;
      for (std::size_t i = first + 1; i < first + 4; ++i) state_.q[i] = -state_.q[i];
    }
  }

  /// Which speeds belong to given coordinates: three to a ball's attitude, one to each of the others.
  std::vector<bool> speeds_of(const std::vector<bool>& coordinates) const {
    std::vector<bool> speeds(d_.speeds.size(), false);
    for (const Chart& chart : d_.charts) {
      const auto q = static_cast<std::size_t>(chart.q), v = static_cast<std::size_t>(chart.v);
      const auto scalars = static_cast<std::size_t>(chart.scalars);
      for (std::size_t i = 0; i < scalars; ++i) speeds[v + i] = coordinates[q + i];
      if (!chart.ball) continue;
      for (std::size_t i = 0; i < 3; ++i) speeds[v + scalars + i] = coordinates[q + scalars];
    }
    return speeds;
  }

  M& mechanism_;
  const Description& d_;
  const RunSettings& settings_;
  const Json& file_;
  State<Real> state_;
  ModelData<Real> data_;
  std::vector<Real> penalties_;
  std::vector<std::string> undetermined_;
};

template <Mechanism M>
const State<typename M::real_type>& InitialState<M>::at_rest() {
  place();
  starter().accelerate(state_, Real(0));
  return state_;
}

template <Mechanism M>
const State<typename M::real_type>& InitialState<M>::in_motion() {
  place();
  const Starter<M> starter = this->starter();
  const std::vector<bool> moving = read_given(file_.at("rates"), d_.speeds, state_.v);
  starter.make_consistent(state_, moving, Real(1));
  for (const std::string_view name : starter.undetermined(state_, moving)) undetermined_.push_back(std::string(name));
  starter.accelerate(state_, Real(1));
  starter.require_finite(state_);
  return state_;
}

template <Mechanism M>
void InitialState<M>::place() {
  const Starter<M> starter = this->starter();
  const std::vector<bool> given = read_given(file_.at("positions"), d_.coordinates, state_.q);
  turn_reversed(given);
  const std::vector<bool> placed = speeds_of(given);
  starter.assemble(state_, placed, Real(0));
  if (finds_penalties() && !d_.cuts.empty()) weigh();
  if (settings_.pose == Pose::equilibrium) starter.equilibrate(state_, placed);
  starter.assemble(state_, placed, Real(0));
}

template <Mechanism M>
void InitialState<M>::weigh() {
  const Real unbound = std::numeric_limits<Real>::infinity();
  const Real most = settings_.stabilisation.penalty ? Real(*settings_.stabilisation.penalty) : unbound;
  const auto masses = [&] { return EffectiveMasses<M>(mechanism_, state_, penalties_, is_proximal()); };
  load(masses().open(), Real(1e-3), unbound);
  const std::vector<Real> open = masses().open();
  load(open, Real(1e4), unbound);
  const std::vector<Real> held = masses().held();
  const bool is_fixed_point = settings_.integrator == Integrator::trapezoidal;
  load(penalties_of_cuts(held, open, is_fixed_point ? Real(settings_.dt) : Real(0)), Real(1), most);
}

extern template class InitialState<AnyMechanism<double>>;  // initial_state.cpp of the driver, since it takes long to compile

}  // namespace cutjoint
