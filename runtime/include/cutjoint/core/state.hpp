// The state of a mechanism.
#pragma once

#include <cstddef>
#include <span>
#include <type_traits>
#include <vector>

#include "cutjoint/core/arrays.hpp"
#include "cutjoint/core/mechanism.hpp"

namespace cutjoint {

/// Arrays that are vectors, for whatever mechanism.
template <class Real>
struct Vectors {
  using CoordinatesArray = std::vector<Real>;
  using SpeedsArray = std::vector<Real>;
  using EquationsArray = std::vector<Real>;
};

/// Arrays of a mechanism whose class knows its sizes.
template <class M>
struct Insides {
  using CoordinatesArray = Coordinates<M>;
  using SpeedsArray = Speeds<M>;
  using EquationsArray = Equations<M>;
};

/// The numbers of an array in another type.
template <class Real, class Other>
std::vector<Real> converted(const std::vector<Other>& values) {
  std::vector<Real> result;
  result.reserve(values.size());
  for (const Other value : values) result.push_back(static_cast<Real>(value));
  return result;
}

/// Time, coordinates, speeds, accelerations and multipliers; SI units, lengths as in the lists of the mechanism or system.
template <class Real, class Arrays = Vectors<Real>>
struct State {
  Real t{0};
  typename Arrays::CoordinatesArray q;
  typename Arrays::SpeedsArray v, vdot;
  typename Arrays::EquationsArray lambda;

  State(std::size_t coordinates, std::size_t speeds, std::size_t equations)
      : q(coordinates), v(speeds), vdot(speeds), lambda(equations) {}

  /// The design position at rest of what has a description: coordinates nought, balls not turned.
  template <class Described>
    requires requires(const Described& d) { d.coordinates.size(), d.charts.size(); }
  explicit State(const Described& d) : State(d.coordinates.size(), d.speeds.size(), d.equations.size()) {
    set_balls(d.charts);
  }

  /// The same numbers in another type.
  template <class Other>
  explicit State(const State<Other>& other)
      : t(static_cast<Real>(other.t)), q(converted<Real>(other.q)), v(converted<Real>(other.v)), vdot(converted<Real>(other.vdot)),
        lambda(converted<Real>(other.lambda)) {}

  /// Balls are not turned.
  void set_balls(std::span<const Chart> charts) {
    for (const Chart& chart : charts)
      if (chart.ball) q[static_cast<std::size_t>(chart.q + chart.scalars)] = Real(1);
  }
};

/// The state of a mechanism.
template <class M>
using StateOf =
    State<typename M::real_type, std::conditional_t<Sized<M>, Insides<M>, Vectors<typename M::real_type>>>;

/// The design position at rest: coordinates nought, balls not turned.
template <class M>
StateOf<M> blank(const M& mechanism) {
  const Sizes sizes = sizes_of(mechanism);
  StateOf<M> state(sizes.coordinates, sizes.speeds, sizes.equations);
  state.set_balls(charts_of(mechanism));
  return state;
}

/// The largest absolute values of Phi, Phid and Phidd.
struct Residuals {
  double position = 0.0;
  double velocity = 0.0;
  double acceleration = 0.0;
};

}  // namespace cutjoint
