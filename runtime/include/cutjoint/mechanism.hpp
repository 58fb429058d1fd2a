// What a mechanism is to the runtime: the contract between generated code (or the generic twin) and the integrators.
#pragma once

#include <concepts>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "cutjoint/precision.hpp"

namespace cutjoint {

/// How one joint's coordinates follow its speeds: `scalars` coordinates from `q` on, their rates from `v` on; a ball adds a unit
/// quaternion (scalar first) after the scalars and, after their rates, an angular velocity in the inner body's axes.  The quaternion takes
/// the follower's axes to the base's; of a `reversed` joint, whose inner body is the follower, the base's to the follower's.
struct Chart {
  int q;
  int v;
  int scalars;
  bool ball;
  bool reversed = false;
};

/// A name with its unit and default value; what it names depends on the list that it stands in.
struct Named {
  std::string_view name;
  std::string_view unit;
  double value = 0.0;
};

/// A force that was left out of the model because it does not act, and the line of the model's file where it stands.
struct Guard {
  std::string_view force;
  std::string_view place;
};

/// A value at whose change of sign a force, a guide or a drive goes over to another formula; the element that it belongs to, and the line of
/// the model's file.  With a `road` the value is a place along it, which changes formula where the road does; the switch `across` has the
/// place across it (without one, that place is right of the middle).
struct Switch {
  std::string_view element;
  std::string_view place;
  int road = -1;
  int across = -1;
};

/// What must lie in its domain for a law of an element to have a value, and the line of the model's file.  Its margin is not negative there,
/// or positive if it is strict.
struct Domain {
  std::string_view what;
  std::string_view element;
  std::string_view place;
  bool strict;
};

/// Everything about a mechanism that does not change in a run.
struct Description {
  std::string_view name;
  std::vector<Chart> charts;
  std::vector<std::string_view> coordinates;  ///< names of q
  std::vector<std::string_view> speeds;       ///< names of v
  std::vector<std::string_view> equations;    ///< names of the cut joints' equations
  std::vector<Named> parameters;              ///< open parameters with defaults, SI units
  std::vector<std::string_view> roads;        ///< tyres, each with a road of its own
  std::vector<Named> columns;                 ///< reported quantities
  std::vector<int> cuts{};                    ///< first equation of each cut joint
  std::vector<Guard> guards{};                ///< forces that must not act
  std::vector<Domain> domains{};              ///< where laws may have no value
  std::vector<Switch> switches{};             ///< where formulas change
  bool driven = false;                        ///< whether guides have power, which takes accelerations and multipliers
};

/// Figures of the cut joints: penalty alpha, damping ratio xi, frequency omega in 1/s (Cuadrado et al. 2000, eq. 39).  The proximal closure
/// has a penalty for each cut joint, which `load` reads, and nothing else.
template <class Real>
struct Stabilisation {
  Real penalty{1};
  Real damping_ratio{1};
  Real frequency{10};
  const Real* penalties = nullptr;
};

template <class Real>
class Road;

/// A mechanism.  All arrays belong to the caller and have the lengths of its description's lists; nothing allocates.
///
/// - `load` computes what depends on parameters alone,
/// - `begin_step` what depends on time; `motion` is 1 in a run and 0 where a mechanism is held at rest, which stops guides and drives,
/// - `evaluate` the accelerations for given multipliers, and the correction that the augmented update adds to these,
/// - `constraint_residual` the residual of the cut joints and its rate,
/// - `report` the columns; generated code also has `energy`, the kinetic energy and the power of all forces, guides and drives,
/// - `project` the step of the speeds' integrals (or of the speeds) that closes given gaps of the residual (or its rate) and moves the
///   masses least: M dz + Phi_q^T mu = 0, Phi_q dz = -gap, up to a share of the gap that a finite penalty leaves,
/// - `guard` of each force that was left out the smallest margin, which is negative where the force would act.
template <class M>
concept Mechanism = requires(M& m, typename M::real_type* out, const typename M::real_type* in, typename M::real_type t,
                             const Stabilisation<typename M::real_type>& s, const Road<typename M::real_type>* roads) {
  typename M::real_type;
  { m.description() } -> std::convertible_to<const Description&>;
  m.load(in, s, roads);
  m.begin_step(t, t);
  m.evaluate(in, in, in, out, out);
  m.constraint_residual(in, in, out, out);
  m.report(in, in, in, in, out);
  m.project(in, in, out);
  m.guard(in, in, out);
};

/// A function was called that the compiler had no reason to make.
[[noreturn]] inline void throw_missing(const char* function) {
  throw std::logic_error(std::string("this mechanism was compiled without the function ") + function);
}

/// The base of generated mechanisms: the same contract behind virtual functions, so that one driver serves all models.
template <class Real>
class AnyMechanism {
 public:
  using real_type = Real;

  virtual ~AnyMechanism() = default;
  virtual const Description& description() const = 0;
  virtual void load(const Real* parameters, const Stabilisation<Real>& stabilisation, const Road<Real>* roads) = 0;
  virtual void begin_step(Real t, Real motion) = 0;
  virtual void evaluate(const Real* q, const Real* v, const Real* lambda, Real* vdot, Real* correction) const = 0;
  virtual void constraint_residual(const Real* q, const Real* v, Real* residual, Real* rate) const = 0;
  virtual void report(const Real* q, const Real* v, const Real* vdot, const Real* lambda, Real* column) const = 0;
  virtual void energy(const Real*, const Real*, const Real*, const Real*, Real*) const { throw_missing("energy"); }  ///< of q, v, vdot, lambda
  virtual void project(const Real* q, const Real* gap, Real* dz) const { (void)q, (void)gap, (void)dz, throw_missing("project"); }
  virtual void guard(const Real*, const Real*, Real*) const {}   ///< of q and v; only models with guards have it
  virtual void events(const Real*, const Real*, Real*) const {}  ///< of q and v, the values of the switches; only models that have some
  virtual void domains(const Real*, const Real*, Real*) const {}  ///< of q and v, the margins of the domains; only models that have some
};

/// condition ? yes : no, both evaluated.
template <class Real>
constexpr Real where(bool condition, Real yes, Real no) {
  return condition ? yes : no;
}

}  // namespace cutjoint
