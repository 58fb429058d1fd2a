// From given coordinates and velocities to a state from which integration can begin.
#pragma once

#include "cutjoint/core/mechanism/effective_mass.hpp"
#include "cutjoint/core/constraints/stabilisation.hpp"
#include "cutjoint/core/start/start.hpp"

namespace cutjoint {

/// How a start coordinate is given: not at all, fixed, or as the initial guess.
enum GivenCoordinate : unsigned char { not_given = 0, given_as_fixed = 1, given_as_guess = 2 };

/// Loads a mechanism and finds a consistent state; with `equilibrium` at rest. `fixed_point_step`: length of the steps whose fixed-point
/// iteration limits the penalties, 0 if there is none.
template <Mechanism M>
class Initialisation {
 public:
  using Real = typename M::real_type;

  struct Settings {
    StabilisationSettings stabilisation;
    bool equilibrium = false;
    Real fixed_point_step{0};
  };

  /// `parameters` and `roads` are read whenever the mechanism is loaded.
  Initialisation(M& mechanism, const Settings& settings, const Real* parameters, const Road<Real>* roads)
      : mechanism_(mechanism), settings_(settings), parameters_(parameters), roads_(roads), starter_(mechanism, projects()), masses_(mechanism),
        fixed_(sizes_of(mechanism).speeds), reactions_(fixed_.size()), penalties_(sizes_of(mechanism).cuts) {
    load_unit_penalties();
  }

  Initialisation(const Initialisation&) = delete;
  Initialisation& operator=(const Initialisation&) = delete;

  /// A mechanism at rest without moving guides, from the state's coordinates; those `given` as fixed do not move.
  Fault rest(StateOf<M>& state, const Coordinates<M, unsigned char>& given) {
    if (const Fault fault = place(state, given)) return fault;
    starter_.find_reactions(state, fixed_, reactions_);
    return {};
  }

  /// Forces along given coordinates in an equilibrium found by `rest` or `place`, released when the motion begins; zero for others.
  const Speeds<M>& reactions() const { return reactions_; }
  void find_reactions(StateOf<M> state) {
    if (starter_.has_reactions()) starter_.find_reactions(state, fixed_, reactions_);
  }

  /// A mechanism in motion, with velocities that satisfy its loops; those `given` do not change.
  Fault move(StateOf<M>& state, const SpeedFlags<M>& given) {
    if (const Fault fault = starter_.make_consistent(state, given, Real(1))) return fault;
    starter_.accelerate(state, Real(1));
    return starter_.require_finite(state);
  }

  /// Close the loops, and find the equilibrium if requested.
  Fault place(StateOf<M>& state, const Coordinates<M, unsigned char>& given) {
    reverse_attitudes(state, given);
    find_fixed(given);
    const bool is_guessed = std::find(given.begin(), given.end(), given_as_guess) != given.end();
    if (const Fault fault = is_guessed ? starter_.assemble(state, fixed_, Real(0)) : starter_.assemble_from_design(state, fixed_, Real(0))) return fault;
    if (finds_penalties() && !penalties_.empty()) find_penalties(state);
    if (settings_.equilibrium)
      if (const Fault fault = starter_.equilibrate(state, fixed_)) return fault;
    return starter_.assemble(state, fixed_, Real(0));
  }

  /// Mark independent velocities that neither the `given` ones nor the loops determine.
  void find_undetermined(const StateOf<M>& state, const SpeedFlags<M>& given, SpeedFlags<M>& undetermined) {
    starter_.find_undetermined(state, given, undetermined);
  }

  Starter<M>& starter() { return starter_; }

  /// Penalties of the cut joints, after a start has been found; the closure `penalty` has one for all.
  const Cuts<M>& penalties() const { return penalties_; }

  /// Load the mechanism with penalties that are known.
  void load(const Cuts<M>& penalties) {
    penalties_ = penalties;
    load();
  }

  /// Load the mechanism before a pose is known.
  void load_unit_penalties() {
    const double arm = arm_of(mechanism_);
    const Real first = finds_penalties() ? Real(arm * arm * arm) : Real(*settings_.stabilisation.penalty);
    std::fill(penalties_.begin(), penalties_.end(), first);
    load();
  }

 private:
  bool projects() const { return is_projected(settings_.stabilisation.closure); }

  /// Whether penalties are computed; a projected closure computes them up to a given bound.
  bool finds_penalties() const { return projects() || !settings_.stabilisation.penalty; }

  void load() { load_mechanism(mechanism_, parameters_, roads_, settings_.stabilisation, penalties_); }

  /// Penalties from the effective masses in this pose; a given penalty is their upper bound.
  ///
  /// Masses are measured with light penalties at all cut joints, then with penalties of 1e4 times these at the others, and
  /// again with this multiple of the result while it is too light in some direction.
  void find_penalties(const StateOf<M>& state) {
    const Real unbound = std::numeric_limits<Real>::infinity();
    const Real most = settings_.stabilisation.penalty ? Real(*settings_.stabilisation.penalty) : unbound;
    masses_.measure(state, penalties_, projects());
    load(state, masses_.open(), Real(1e-3), unbound);
    masses_.measure(state, penalties_, projects());
    const Cuts<M> open = masses_.open();
    Cuts<M> closed = open;
    for (int round = 0; round == 0 || (round < 4 && masses_.has_light_penalties()); ++round) {
      load(state, closed, Real(1e4), unbound);
      masses_.measure(state, penalties_, projects());
      closed = masses_.closed(state);
    }
    load(state, penalties_of_cuts(closed, open, settings_.fixed_point_step / Real(std::sqrt(arm_of(mechanism_)))), Real(1), most);
  }

  /// Load the mechanism with penalties of a multiple of the masses, at most `most`.
  void load(const StateOf<M>& state, const Cuts<M>& masses, Real times, Real most) {
    for (std::size_t i = 0; i < masses.size(); ++i) penalties_[i] = std::min(times * masses[i], most);
    if (!projects()) std::fill(penalties_.begin(), penalties_.end(), common_penalty(penalties_));
    load();
    mechanism_.begin_step(state.t, Real(0));
  }

  /// Convert the given attitudes, of followers relative to bases, into those of outer relative to inner bodies.
  void reverse_attitudes(StateOf<M>& state, const Coordinates<M, unsigned char>& given) const {
    for (const Chart& chart : charts_of(mechanism_)) {
      const auto first = static_cast<std::size_t>(chart.q + chart.scalars);
      if (!(chart.ball && chart.reversed && given[first])) continue;
      for (std::size_t i = first + 1; i < first + 4; ++i) state.q[i] = -state.q[i];
    }
  }

  /// Which velocities belong to fixed coordinates: three for a ball's attitude, one for each other.
  void find_fixed(const Coordinates<M, unsigned char>& given) {
    for (const Chart& chart : charts_of(mechanism_)) {
      const auto q = static_cast<std::size_t>(chart.q), v = static_cast<std::size_t>(chart.v);
      const auto scalars = static_cast<std::size_t>(chart.scalars);
      for (std::size_t i = 0; i < scalars; ++i) fixed_[v + i] = given[q + i] == given_as_fixed;
      if (!chart.ball) continue;
      for (std::size_t i = 0; i < 3; ++i) fixed_[v + scalars + i] = given[q + scalars] == given_as_fixed;
    }
  }

  M& mechanism_;
  Settings settings_;
  const Real* parameters_;
  const Road<Real>* roads_;
  Starter<M> starter_;
  EffectiveMasses<M> masses_;
  SpeedFlags<M> fixed_;
  Speeds<M> reactions_;
  Cuts<M> penalties_;
};

}  // namespace cutjoint
