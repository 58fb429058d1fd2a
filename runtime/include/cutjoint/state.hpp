// The state of a mechanism and how a run can fail.
#pragma once

#include <stdexcept>
#include <string>
#include <vector>

#include "cutjoint/mechanism.hpp"

namespace cutjoint {

/// The numbers of an array in another type.
template <class Real, class Other>
std::vector<Real> converted(const std::vector<Other>& values) {
  std::vector<Real> result;
  result.reserve(values.size());
  for (const Other value : values) result.push_back(static_cast<Real>(value));
  return result;
}

/// Time, coordinates, speeds, accelerations and multipliers; SI units, lengths as in the description of the mechanism or system.
template <class Real>
struct State {
  Real t{0};
  std::vector<Real> q, v, vdot, lambda;

  State(std::size_t coordinates, std::size_t speeds, std::size_t equations)
      : q(coordinates), v(speeds), vdot(speeds), lambda(equations) {}

  /// The same numbers in another type.
  template <class Other>
  explicit State(const State<Other>& other)
      : t(static_cast<Real>(other.t)), q(converted<Real>(other.q)), v(converted<Real>(other.v)), vdot(converted<Real>(other.vdot)),
        lambda(converted<Real>(other.lambda)) {}

  explicit State(const Description& d) : State(d.coordinates.size(), d.speeds.size(), d.equations.size()) {
    for (const Chart& chart : d.charts)
      if (chart.ball) q[static_cast<std::size_t>(chart.q + chart.scalars)] = Real(1);
  }
};

/// The largest absolute values of Phi, Phid and Phidd.
struct Residuals {
  double position = 0.0;
  double velocity = 0.0;
  double acceleration = 0.0;
};

/// A numerical failure with all that a user needs to look further.
struct Failure : std::runtime_error {
  double time;
  long step;
  std::string element;  ///< the coordinate or equation with the worst residual
  double residual;
  std::string advice;
  std::vector<std::string> guards{};  ///< forces left out of the model that would act

  Failure(const std::string& what, double time_, long step_, std::string element_, double residual_, std::string advice_)
      : std::runtime_error(what), time(time_), step(step_), element(std::move(element_)), residual(residual_), advice(std::move(advice_)) {}
};

}  // namespace cutjoint
