// Mixed precision: factors of a matrix rounded to double.
#pragma once

#include <vector>

#include "cutjoint/lagrangian/solver.hpp"
#include "cutjoint/state.hpp"

namespace cutjoint {

/// A solver in double for matrices and right-hand sides of another type.  Newton's iteration corrects what the rounding leaves, as it
/// corrects an inexact tangent: the residual is evaluated in the longer type.
template <class Solver, class Real>
class RoundedSolver final : public LinearSolver<Real> {
 public:
  void analyse(const Pattern& pattern) override {
    solver_.analyse(pattern);
    values_.resize(pattern.row.size());
    x_.resize(static_cast<std::size_t>(pattern.size));
  }

  Breakdown factor(const Real* values) override {
    for (std::size_t i = 0; i < values_.size(); ++i) values_[i] = static_cast<double>(values[i]);
    return solver_.factor(values_.data());
  }

  Breakdown solve(Real* x) override {
    for (std::size_t i = 0; i < x_.size(); ++i) x_[i] = static_cast<double>(x[i]);
    const Breakdown broken = solver_.solve(x_.data());
    for (std::size_t i = 0; i < x_.size(); ++i) x[i] = Real(x_[i]);
    return broken;
  }

 private:
  Solver solver_;
  std::vector<double> values_, x_;
};

}  // namespace cutjoint
