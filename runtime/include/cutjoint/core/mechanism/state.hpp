// The state of a mechanism.
#pragma once

#include <algorithm>
#include <cstddef>
#include <span>
#include <vector>

#include "cutjoint/core/numbers/arrays.hpp"
#include "cutjoint/core/mechanism/mechanism.hpp"

namespace cutjoint {

/// Arrays that are vectors, for whatever mechanism.
template <class Real>
struct DynamicStorage {
  using CoordinatesArray = std::vector<Real>;
  using SpeedsArray = std::vector<Real>;
  using EquationsArray = std::vector<Real>;
};

/// Arrays of what knows its sizes.
template <class Real, std::size_t coordinates, std::size_t speeds, std::size_t equations>
struct FixedStorage {
  using CoordinatesArray = Fixed<Real, coordinates>;
  using SpeedsArray = Fixed<Real, speeds>;
  using EquationsArray = Fixed<Real, equations>;
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
template <class Real, class Arrays = DynamicStorage<Real>>
struct State {
  Real t{0};
  typename Arrays::CoordinatesArray q;
  typename Arrays::SpeedsArray v, vdot;
  typename Arrays::EquationsArray lambda;

  State() = default;
  State(std::size_t coordinates, std::size_t speeds, std::size_t equations)
      : q(coordinates), v(speeds), vdot(speeds), lambda(equations) {}

  /// The design position at rest of a mechanism with a description: coordinates 0, unit quaternions.
  template <class Described>
    requires requires(const Described& d) { d.coordinates.size(), d.charts.size(); }
  explicit State(const Described& d) : State(d.coordinates.size(), d.speeds.size(), d.equations.size()) {
    set_balls(d.charts);
  }

  /// The state's numbers in another type.
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

/// The arrays of a state of a mechanism or system.
template <class M>
struct ArraysOf {
  using type = DynamicStorage<typename M::real_type>;
};

template <Sized M>
struct ArraysOf<M> {
  using type = FixedStorage<typename M::real_type, M::sizes.coordinates, M::sizes.speeds, M::sizes.equations>;
};

/// The state of a mechanism or system; that of two with the same sizes is the same type.
template <class M>
using StateOf = State<typename M::real_type, typename ArraysOf<M>::type>;

/// The design position at rest: coordinates 0, unit quaternions.
template <class M>
StateOf<M> design_state(const M& mechanism) {
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

/// The larger ones of two states.
inline Residuals worst_of(const Residuals& a, const Residuals& b) {
  return {std::max(a.position, b.position), std::max(a.velocity, b.velocity), std::max(a.acceleration, b.acceleration)};
}

}  // namespace cutjoint
