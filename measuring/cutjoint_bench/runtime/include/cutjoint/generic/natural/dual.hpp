// Numbers with derivatives by the points, directions and rates that one force element depends on.
#pragma once

#include <unsupported/Eigen/AutoDiff>

#include "cutjoint/generic/algebra.hpp"

namespace cutjoint::generic::natural {

/// A number with its derivatives by N variables.
template <class Real, int N>
using Dual = Eigen::AutoDiffScalar<Eigen::Matrix<Real, N, 1>>;

/// A vector as the variables `first` to `first` + 2.
template <class Real, int N>
Vector3<Dual<Real, N>> variables(const Vector3<Real>& x, int first) {
  using S = Dual<Real, N>;
  return Vector3<S>(S(x[0], N, first), S(x[1], N, first + 1), S(x[2], N, first + 2));
}

template <class Real>
const Real& value_of(const Real& x) {
  return x;
}

template <class D>
auto value_of(const Eigen::AutoDiffScalar<D>& x) {
  return x.value();
}

/// The value of a function of x whose derivative is known.
template <class Real>
Real function_of(const Real&, const Real& value, const Real&) {
  return value;
}

template <class Real, int N>
Dual<Real, N> function_of(const Dual<Real, N>& x, const Real& value, const Real& derivative) {
  return {value, derivative * x.derivatives()};
}

/// m += factor dy/d(variables first to first + 2) of a vector y.
template <class Real, int N, class Block>
void add_derivatives(Real factor, const Vector3<Dual<Real, N>>& y, int first, Block&& m) {
  for (int i = 0; i < 3; ++i) m.row(i) += factor * y[i].derivatives().template segment<3>(first).transpose();
}

}  // namespace cutjoint::generic::natural
