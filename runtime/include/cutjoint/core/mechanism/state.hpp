// The state of a mechanism, and reference sizes of its coordinates and velocities, beside which violations and changes are rounding.
#pragma once

#include "cutjoint/core/mechanism/mechanism.hpp"
#include "cutjoint/core/numbers/vectors.hpp"

namespace cutjoint {

/// The numbers of an array in another type.
template <class Real, class Other>
std::vector<Real> converted(const std::vector<Other>& values) {
  std::vector<Real> result;
  result.reserve(values.size());
  for (const Other value : values) result.push_back(static_cast<Real>(value));
  return result;
}

/// Time, coordinates, speeds, accelerations and multipliers; SI units, lengths as in the lists of the mechanism or system.
template <class Real, class Q = std::vector<Real>, class V = std::vector<Real>, class Lambda = std::vector<Real>>
struct State {
  Real t{0};
  Q q;
  V v, vdot;
  Lambda lambda;

  State() = default;
  State(std::size_t coordinates, std::size_t speeds, std::size_t equations)
      : q(coordinates), v(speeds), vdot(speeds), lambda(equations) {}

  /// The design position at rest of a mechanism with a description: coordinates 0, unit quaternions.
  template <class Described>
    requires requires(const Described& d) { d.coordinates.size(), d.charts.size(); }
  explicit State(const Described& d) : State(d.coordinates.size(), d.speeds.size(), d.equations.size()) { set_balls(d.charts); }

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

/// The state of a mechanism or system; that of two with the same sizes is the same type.
template <class M>
using StateOf = State<typename M::real_type, Coordinates<M>, Speeds<M>, Equations<M>>;

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

/// That of violations of a pose (m): 1 + the largest coordinate for a mechanism of about a metre.
/// Otherwise lengths are relative to its arm, angles are multiplied by it, and times are relative to that of falling an arm's length at 1 m/s2.
/// `nominals` are those of rates (mechanism.hpp).
template <class Numbers, class Real = std::remove_cvref_t<decltype(std::declval<const Numbers&>()[0])>>
Real pose_size(const Numbers& q, double arm, std::span<const Chart> charts, std::span<const double> nominals) {
  using std::abs;
  if (arm == 1.0) return Real(1) + largest(q);
  if (charts.empty()) return Real(arm) + largest(q, nominals.first(q.size()));
  Real size(0);
  for (const Chart& chart : charts)
    for (std::size_t i = 0; i < static_cast<std::size_t>(chart.scalars); ++i)
      size = larger(size, abs(q[static_cast<std::size_t>(chart.q) + i]) / Real(nominals[static_cast<std::size_t>(chart.v) + i]));
  return Real(arm) + size;
}

/// That of violations of velocities (m/s).
auto speed_size(const auto& v, double arm, std::span<const double> nominals) {
  auto size = largest(v, nominals);
  return decltype(size)(std::sqrt(arm)) + size;
}

/// That of accelerations (m/s2).
auto acceleration_size(const auto& vdot, std::span<const double> nominals) {
  auto size = largest(vdot, nominals);
  return decltype(size)(1) + size;
}

}  // namespace cutjoint
