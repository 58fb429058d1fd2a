// Mechanisms behind virtual functions, and their descriptions.
#pragma once

#include <exception>

#include "cutjoint/constants.hpp"
#include "cutjoint/core/mechanism/contract.hpp"
#include "cutjoint/core/inputs/inputs.hpp"
#include "cutjoint/precision.hpp"

namespace cutjoint {

/// Reports a call of a function that was not generated.
struct MissingFunction : std::exception {
  const char* message;

  explicit MissingFunction(const char* text) : message(text) {}
  const char* what() const noexcept override { return message; }
};

[[noreturn]] inline void throw_no_energy() { throw MissingFunction("this mechanism was compiled without the function energy"); }
[[noreturn]] inline void throw_no_projection() { throw MissingFunction("this mechanism was compiled without the function project"); }

/// What generated mechanisms and systems have in common.
template <class Real, class Described>
class AnySubject {
 public:
  using real_type = Real;

  virtual ~AnySubject() = default;
  virtual const Described& description() const = 0;
  virtual void begin_step(Real t, Real motion) = 0;
  virtual void drive_by(const InputSource<Real>&) {}  ///< only models with inputs have it
  virtual void report(const Real* q, const Real* v, const Real* vdot, const Real* lambda, Real* column) const = 0;
  virtual void sample(const Real*, const Real*, const Real*, const Real*, Real*) const {}  ///< of q, v, vdot, lambda, what controllers hold next; only models with controllers
  virtual void guard(const Real*, const Real*, Real*) const {}   ///< of q and v; only models with guards have it
  virtual void events(const Real*, const Real*, Real*) const {}  ///< of q and v, the values of the indicators; only models that have some
  virtual void domains(const Real*, const Real*, const Real*, Real*) const {}  ///< of q, v, lambda, the margins of the domains; only models that have some
};

/// The base of generated mechanisms: the same contract behind virtual functions, so that one driver serves all models.
template <class Real>
class AnyMechanism : public AnySubject<Real, Description> {
 public:
  virtual void load(const Real* parameters, const Stabilisation<Real>& stabilisation, const Road<Real>* roads) = 0;
  virtual void evaluate(const Real* q, const Real* v, const Real* lambda, Real* vdot, Real* correction) const = 0;
  virtual void constraint_residual(const Real* q, const Real* v, Real* residual, Real* rate) const = 0;
  virtual void energy(const Real*, const Real*, const Real*, const Real*, Real*) const {}  ///< of q, v, vdot, lambda; the kinetic energy alone if vdot is v; only models that need it have it
  virtual void project(const Real* q, const Real* violation, Real* dz) const { (void)q, (void)violation, (void)dz, throw_no_projection(); }
};

}  // namespace cutjoint
