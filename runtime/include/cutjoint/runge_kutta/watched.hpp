// A mechanism as an explicit method sees it.
#pragma once

#include <algorithm>
#include <optional>
#include <utility>
#include <vector>

#include "cutjoint/core/projection.hpp"
#include "cutjoint/relative.hpp"
#include "cutjoint/core/road.hpp"
#include "cutjoint/stepping/regime.hpp"

namespace cutjoint::runge_kutta {

/// The differential equation of a mechanism some of whose switches, all or none, are watched at every stage, and whose loops are closed
/// after each step.
template <Mechanism M>
class Watched : public Relative<M> {
 public:
  using Real = typename M::real_type;

  Watched(M& mechanism, const std::vector<Switch>& switches, const std::vector<Road<Real>>& roads, Real tolerance)
      : Relative<M>(mechanism, tolerance), switches_(switches), regime_(switches, roads),
        projection_(mechanism), last_(mechanism.description().equations.size()), before_last_(last_), residual_(last_), rate_(last_) {}

  /// Take over a start, in the regime in which it stands.
  std::vector<Real> begin(const State<Real>& start) {
    std::vector<Real> y = Relative<M>::begin(start);
    adopt(start.t, y);
    last_ = start.lambda;
    return y;
  }

  /// An attempt of a step from t begins, with the multipliers of the last step: those of a rejected attempt may be anything.
  void begin_attempt(Real t) {
    regime_.begin(t);
    if (known_ < 2) state_.lambda = last_;
  }

  void derive(Real t, const std::vector<Real>& y, std::vector<Real>& slope) {
    predict(t);
    Relative<M>::derive(t, y, slope);
    if (regime_.empty()) return;
    evaluate_switches();
    regime_.look(t);
    regime_.pass(t);
  }

  /// Quaternions get their length back, loops are closed, and speeds keep them closed.
  void project(Real t, std::vector<Real>& y) {
    Relative<M>::project(t, y);
    if (d_.equations.empty()) return;
    this->take(t, y);
    mechanism_.begin_step(t, Real(1));
    require_none(projection_.positions(state_), d_);
    require_none(projection_.velocities(state_), d_);
    std::copy(state_.v.begin(), state_.v.end(), std::copy(state_.q.begin(), state_.q.end(), y.begin()));
  }

  /// The largest residuals of the loops in a state: of positions and of velocities.
  std::pair<double, double> residuals(Real t, const std::vector<Real>& y) {
    this->take(t, y);
    mechanism_.begin_step(t, Real(1));
    mechanism_.constraint_residual(state_.q.data(), state_.v.data(), residual_.data(), rate_.data());
    return {static_cast<double>(largest(residual_)), static_cast<double>(largest(rate_))};
  }

  /// A state as one; accelerations and multipliers, where guides need them, from a solution that leaves no trace here.
  void inspect(Real t, const std::vector<Real>& y, State<Real>& state) {
    if (d_.driven) {
      if (!inspector_) inspector_.emplace(*this);
      state = inspector_->complete(t, y);
      return;
    }
    state.t = t;
    const auto middle = y.begin() + static_cast<std::ptrdiff_t>(state.q.size());
    std::copy(y.begin(), middle, state.q.begin());
    std::copy(middle, y.end(), state.v.begin());
  }

  /// Seek the switches that a state has out of the regime; whether there are any.
  bool seek(Real t, const std::vector<Real>& y) {
    if (regime_.empty()) return false;
    switch_at(t, y);
    return regime_.seek();
  }

  /// The first of them that a state has out of the regime; as many as there are switches if there is none.
  std::size_t found(Real t, const std::vector<Real>& y) {
    if (regime_.empty()) return 0;
    switch_at(t, y);
    return regime_.found();
  }

  /// A step ended at t, the last stage there being its end; the regime goes on.
  void advance(Real t) {
    regime_.advance();
    last_.swap(before_last_);
    std::swap(last_time_, before_last_time_);
    last_ = state_.lambda;
    last_time_ = t;
    known_ = std::min(known_ + 1, 2);
  }

  /// Go over to the regime of a state.
  void adopt(Real t, const std::vector<Real>& y) {
    known_ = 0;
    if (regime_.empty()) return;
    switch_at(t, y);
    regime_.adopt();
  }

  stepping::Regime<Real>& regime() { return regime_; }
  const std::vector<Switch>& switches() const { return switches_; }

 private:
  using Relative<M>::d_, Relative<M>::mechanism_, Relative<M>::state_;

  /// Multipliers to begin with: on the line through those of the last two steps' ends, or those of the stage before.
  void predict(Real t) {
    if (known_ < 2) return;
    const Real share = (t - last_time_) / (last_time_ - before_last_time_);
    for (std::size_t i = 0; i < last_.size(); ++i) state_.lambda[i] = last_[i] + share * (last_[i] - before_last_[i]);
  }

  void switch_at(Real t, const std::vector<Real>& y) {
    this->take(t, y);
    mechanism_.begin_step(t, Real(1));
    evaluate_switches();
  }

  void evaluate_switches() { mechanism_.events(state_.q.data(), state_.v.data(), regime_.values()); }

  const std::vector<Switch>& switches_;
  stepping::Regime<Real> regime_;
  Projection<M> projection_;
  std::optional<Relative<M>> inspector_;
  std::vector<Real> last_, before_last_, residual_, rate_;
  Real last_time_{0}, before_last_time_{0};
  int known_ = 0;
};

}  // namespace cutjoint::runge_kutta
