// A mechanism in relative coordinates as an ordinary differential equation.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "cutjoint/core/largest.hpp"
#include "cutjoint/mechanism.hpp"
#include "cutjoint/state.hpp"

namespace cutjoint {

/// y = (q, v).  The multipliers are corrected in each evaluation until what is left would change the accelerations by a share `tolerance` or
/// less, so that no penalty is left in them; what the loops drift apart comes from the integrator alone.
template <Mechanism M>
class Relative {
 public:
  using Real = typename M::real_type;

  Relative(M& mechanism, Real tolerance)
      : mechanism_(mechanism), d_(mechanism.description()), n_(d_.coordinates.size()), state_(d_),
        tolerance_(std::max(tolerance, 16 * std::numeric_limits<Real>::epsilon())), before_(d_.speeds.size()), correction_(d_.equations.size()) {}

  std::size_t size() const { return n_ + d_.speeds.size(); }
  std::string name(std::size_t i) const { return std::string(i < n_ ? d_.coordinates[i] : d_.speeds[i - n_]); }

  /// Take over coordinates, speeds, and multipliers to begin with.
  std::vector<Real> begin(const State<Real>& start) {
    state_ = start;
    std::vector<Real> y(start.q);
    y.insert(y.end(), start.v.begin(), start.v.end());
    return y;
  }

  void derive(Real t, const std::vector<Real>& y, std::vector<Real>& slope) {
    take(t, y);
    accelerate();
    for (const Chart& chart : d_.charts) follow(chart, slope);
    std::copy(state_.vdot.begin(), state_.vdot.end(), slope.begin() + static_cast<std::ptrdiff_t>(n_));
  }

  /// Quaternions get their length back.
  void project(Real, std::vector<Real>& y) const {
    using std::sqrt;
    for (const Chart& chart : d_.charts) {
      if (!chart.ball) continue;
      Real* e = y.data() + chart.q + chart.scalars;
      const Real length = sqrt(e[0] * e[0] + e[1] * e[1] + e[2] * e[2] + e[3] * e[3]);
      for (int i = 0; i < 4; ++i) e[i] /= length;
    }
  }

  /// Multipliers for the next evaluation to begin with.
  void guess(const std::vector<Real>& lambda) { state_.lambda = lambda; }

  /// The state with its accelerations and multipliers.
  const State<Real>& solve(Real t, const std::vector<Real>& y) {
    take(t, y);
    accelerate();
    return state_;
  }

  /// The same; what that takes is no part of a step.
  const State<Real>& complete(Real t, const std::vector<Real>& y) {
    const long counted = evaluations_;
    solve(t, y);
    evaluations_ = counted;
    return state_;
  }

  long evaluations() const { return evaluations_; }

 protected:
  void take(Real t, const std::vector<Real>& y) {
    const auto middle = y.begin() + static_cast<std::ptrdiff_t>(n_);
    state_.t = t;
    std::copy(y.begin(), middle, state_.q.begin());
    std::copy(middle, y.end(), state_.v.begin());
  }

  M& mechanism_;
  const Description& d_;
  std::size_t n_;
  State<Real> state_;

 private:
  /// A pass adds its correction to the multipliers; how far that moves the accelerations is known from a pass not long ago.
  void accelerate() {
    constexpr int most = 40, fresh = 8;
    mechanism_.begin_step(state_.t, Real(1));
    Real last = std::numeric_limits<Real>::infinity(), owed(0);
    for (int pass = 0; pass < most; ++pass) {
      before_ = state_.vdot;
      mechanism_.evaluate(state_.q.data(), state_.v.data(), state_.lambda.data(), state_.vdot.data(), correction_.data());
      ++evaluations_;
      if (d_.equations.empty()) return;
      const Real size = Real(1) + largest(state_.vdot), change = pass > 0 ? largest_change() : Real(0);
      if (pass == 1 && owed > Real(0)) {
        effect_ = change / owed;
        age_ = 0;
      }
      owed = largest(correction_);
      for (std::size_t i = 0; i < correction_.size(); ++i) state_.lambda[i] += correction_[i];
      if (age_ < fresh && Real(10) * effect_ * owed <= tolerance_ * size) break;
      if (pass > 1 && !(change < last)) break;  // what is left is rounding
      if (pass > 0) last = change;
    }
    ++age_;
  }

  Real largest_change() const {
    using std::abs;
    Real result(0);
    for (std::size_t i = 0; i < before_.size(); ++i)
      if (const Real x = abs(state_.vdot[i] - before_[i]); x > result || x != x) result = x;
    return result;
  }

  /// Rates of the coordinates: of a quaternion e, (0, omega)/2 e with the angular velocity on the left.
  void follow(const Chart& chart, std::vector<Real>& slope) const {
    for (int i = 0; i < chart.scalars; ++i)
      slope[static_cast<std::size_t>(chart.q + i)] = state_.v[static_cast<std::size_t>(chart.v + i)];
    if (!chart.ball) return;
    const Real* w = state_.v.data() + chart.v + chart.scalars;
    const Real* e = state_.q.data() + chart.q + chart.scalars;
    Real* rate = slope.data() + chart.q + chart.scalars;
    rate[0] = (-w[0] * e[1] - w[1] * e[2] - w[2] * e[3]) / Real(2);
    rate[1] = (w[0] * e[0] + w[1] * e[3] - w[2] * e[2]) / Real(2);
    rate[2] = (w[1] * e[0] + w[2] * e[1] - w[0] * e[3]) / Real(2);
    rate[3] = (w[2] * e[0] + w[0] * e[2] - w[1] * e[1]) / Real(2);
  }

  Real tolerance_;
  std::vector<Real> before_, correction_;
  Real effect_{0};  ///< of a correction of 1 on the accelerations
  int age_ = 1000;  ///< evaluations since it was seen
  long evaluations_ = 0;
};

}  // namespace cutjoint
