// The state of a mechanism and how a run can fail.
#pragma once

#include <stdexcept>
#include <string>
#include <vector>

#include "cutjoint/mechanism.hpp"

namespace cutjoint {

/// Time, coordinates, speeds, accelerations and multipliers; SI units, lengths as in the description of the mechanism or system.
template <class Real>
struct State {
  Real t{0};
  std::vector<Real> q, v, vdot, lambda;

  State(std::size_t coordinates, std::size_t speeds, std::size_t equations)
      : q(coordinates), v(speeds), vdot(speeds), lambda(equations) {}

  explicit State(const Description& d) : State(d.coordinates.size(), d.speeds.size(), d.equations.size()) {
    for (const Chart& chart : d.charts)
      if (chart.ball) q[static_cast<std::size_t>(chart.q + chart.scalars)] = Real(1);
  }
};

/// A numerical failure with all that a user needs to look further.
struct Failure : std::runtime_error {
  double time;
  long step;
  std::string element;  ///< the coordinate or equation with the worst residual
  double residual;
  std::string advice;

  Failure(const std::string& what, double time_, long step_, std::string element_, double residual_, std::string advice_)
      : std::runtime_error(what), time(time_), step(step_), element(std::move(element_)), residual(residual_), advice(std::move(advice_)) {}
};

}  // namespace cutjoint
