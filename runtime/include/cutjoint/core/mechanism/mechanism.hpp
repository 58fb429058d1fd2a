// The contract of a mechanism between generated code (or the generic solver) and the integrators.
#pragma once

#include <span>

#include "cutjoint/core/numbers/arrays.hpp"
#include "cutjoint/core/mechanism/chart.hpp"
#include "cutjoint/core/mechanism/contract.hpp"

namespace cutjoint {

/// A mechanism.  All arrays belong to the caller and have the lengths of its lists; nothing allocates.  It knows these lengths, `sizes`, or has a `description`.
///
/// - `load` computes what depends on parameters alone,
/// - `begin_step` what depends on time and on inputs, which their source gives (inputs.hpp); `motion` is 1 in a run and 0 for a mechanism
///   at rest, whose guides and drives stand still,
/// - `evaluate` the accelerations for given multipliers, and the correction that the augmented update adds to these,
/// - `constraint_residual` the residual of the cut joints and its rate,
/// - `report` the columns; generated code also has `energy`, the kinetic energy and, unless vdot is v itself, the power of all forces, guides and drives,
/// - `project` the displacement (or velocity change) that removes given violations of the residual (or its rate) at least
///   cost in the metric of the masses: M dz + Phi_q^T mu = 0, Phi_q dz = -violation, up to the fraction that a finite penalty leaves; optional for one that
///   only starts runs, with the closure `penalty`.
///
/// If the rates of guides may jump, the mechanism or system has `energy` too, and `events` for steps across events, unless its coordinates are
/// natural.  For omitted forces, `guard` is the smallest margin of each, negative where the force would act.  With controllers
/// `sample` is the next value of each (sampling.hpp).
template <class M>
concept Mechanism = requires(M& m, typename M::real_type* out, const typename M::real_type* in, typename M::real_type t,
                             const Stabilisation<typename M::real_type>& s, const Road<typename M::real_type>* roads) {
  typename M::real_type;
  m.load(in, s, roads);
  m.begin_step(t, t);
  m.evaluate(in, in, in, out, out);
  m.constraint_residual(in, in, out, out);
  m.report(in, in, in, in, out);
};

/// The charts of a mechanism.
template <class M>
std::span<const Chart> charts_of(const M& mechanism) {
  if constexpr (Sized<M>) return M::charts;
  else return mechanism.description().charts;
}

/// The event indicators of a mechanism or system.
template <class M>
using IndicatorPlaces = std::conditional_t<Sized<M>, std::span<const IndicatorPlace>, std::vector<IndicatorPlace>>;

/// All of them if the class knows them, else only if `watched`, or if guides may jump: steps that pass over a jump would lose its impulse.
template <class M>
IndicatorPlaces<M> indicators_of(const M& mechanism, [[maybe_unused]] bool watched = true) {
  if constexpr (Sized<M>) {
    return M::indicators;
  } else {
    std::vector<IndicatorPlace> places;
    if (!watched && !mechanism.description().guides_jump) return places;
    for (const auto& each : mechanism.description().indicators) places.push_back({each.road, each.across});
    return places;
  }
}

/// Whether the rates of guides may jump, as known at compile time; a class with known sizes has `guides_jump`.
template <class M>
constexpr bool can_jump = !Sized<M> || requires { M::guides_jump; };

/// Whether they may jump.
template <class M>
bool may_jump([[maybe_unused]] const M& mechanism) {
  if constexpr (Sized<M>) return can_jump<M>;
  else return mechanism.description().guides_jump;
}

/// Nominal values of the first-order states of a mechanism or system, none if all are 1.  If `arm_of` is not 1, those of all accelerations
/// come first: 1 for lengths, and 1/arm for angles.
template <class M>
std::span<const double> nominals_of(const M& subject) {
  if constexpr (requires { M::nominals; }) return M::nominals;
  else if constexpr (requires { subject.description(); }) return subject.description().nominals;
  else return {};
}

/// The number of first-order states of a mechanism or system.
template <class M>
std::size_t number_of_states(const M& subject) {
  if constexpr (requires { M::sizes.states; }) return M::sizes.states;
  else if constexpr (requires { subject.description(); }) return subject.description().states;
  else return 0;
}

/// A characteristic length (m) of the mechanism if it is far from a metre, else 1; it scales equations between directions.
template <class M>
double arm_of(const M& subject) {
  if constexpr (requires { M::arm; }) return M::arm;
  else if constexpr (requires { subject.description(); }) return subject.description().arm;
  else return 1.0;
}

/// `nominals_of`, if `arm_of` is not 1; else none: sizes of rates are then those in SI units.
std::span<const double> scaled_nominals_of(const auto& subject) {
  return arm_of(subject) == 1.0 ? std::span<const double>{} : nominals_of(subject);
}

/// The first equation of each cut joint.
template <class M>
std::span<const int> cuts_of(const M& mechanism) {
  if constexpr (Sized<M>) return M::cuts;
  else return mechanism.description().cuts;
}

}  // namespace cutjoint
