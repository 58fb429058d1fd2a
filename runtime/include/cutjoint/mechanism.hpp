// Mechanisms behind virtual functions, and what they say of themselves.
#pragma once

#include <exception>
#include <string_view>
#include <vector>

#include "cutjoint/core/inputs.hpp"
#include "cutjoint/core/mechanism.hpp"
#include "cutjoint/precision.hpp"

namespace cutjoint {

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

/// A value at whose change of sign a force, a guide or a drive goes over to another formula, or a tyre at a break of its road; the element that it
/// belongs to, and the line of the model's file.
struct Switch {
  std::string_view element;
  std::string_view place;
  int road = -1;
  int across = -1;
};

/// Where switches are watched.
inline std::vector<SwitchPlace> places_of(const std::vector<Switch>& switches) {
  std::vector<SwitchPlace> places;
  for (const Switch& each : switches) places.push_back({each.road, each.across});
  return places;
}

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
  std::vector<Named> inputs{};                ///< inputs with the model's values, SI units
  std::vector<Guard> guards{};                ///< forces that must not act
  std::vector<Domain> domains{};              ///< where laws may have no value
  std::vector<Switch> switches{};             ///< where formulas change
  bool driven = false;                        ///< whether guides have power, which takes accelerations and multipliers
};

/// A function was called that the compiler had no reason to make.
class MissingFunction : public std::exception {
 public:
  explicit MissingFunction(const char* message) : message_(message) {}
  const char* what() const noexcept override { return message_; }

 private:
  const char* message_;
};

[[noreturn]] inline void throw_no_energy() { throw MissingFunction("this mechanism was compiled without the function energy"); }
[[noreturn]] inline void throw_no_projection() { throw MissingFunction("this mechanism was compiled without the function project"); }

/// The base of generated mechanisms: the same contract behind virtual functions, so that one driver serves all models.
template <class Real>
class AnyMechanism {
 public:
  using real_type = Real;

  virtual ~AnyMechanism() = default;
  virtual const Description& description() const = 0;
  virtual void load(const Real* parameters, const Stabilisation<Real>& stabilisation, const Road<Real>* roads) = 0;
  virtual void begin_step(Real t, Real motion) = 0;
  virtual void drive_by(const InputSource<Real>&) {}  ///< only models with inputs have it
  virtual void evaluate(const Real* q, const Real* v, const Real* lambda, Real* vdot, Real* correction) const = 0;
  virtual void constraint_residual(const Real* q, const Real* v, Real* residual, Real* rate) const = 0;
  virtual void report(const Real* q, const Real* v, const Real* vdot, const Real* lambda, Real* column) const = 0;
  virtual void energy(const Real*, const Real*, const Real*, const Real*, Real*) const { throw_no_energy(); }  ///< of q, v, vdot, lambda
  virtual void project(const Real* q, const Real* gap, Real* dz) const { (void)q, (void)gap, (void)dz, throw_no_projection(); }
  virtual void guard(const Real*, const Real*, Real*) const {}   ///< of q and v; only models with guards have it
  virtual void events(const Real*, const Real*, Real*) const {}  ///< of q and v, the values of the switches; only models that have some
  virtual void domains(const Real*, const Real*, Real*) const {}  ///< of q and v, the margins of the domains; only models that have some
};

}  // namespace cutjoint
