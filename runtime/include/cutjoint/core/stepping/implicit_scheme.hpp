// Scheme for implicit steps: it keeps the states at the ends of attempts.
#pragma once

#include "cutjoint/core/stepping/interpolant.hpp"
#include "cutjoint/core/stepping/stepper.hpp"

namespace cutjoint::stepping {

/// The scheme of stepper.hpp over stages such as radau/stages.hpp. Steps follow the tolerance if the stages estimate an error; else one step per sample.
template <class Stages>
class ImplicitScheme {
 public:
  using Real = typename Stages::Real;
  using Subject = typename Stages::Subject;
  using State = StateOf<Subject>;
  using Vector = typename Interpolant<Subject>::Vector;
  using Attempt = stepping::Attempt<Real>;

  static constexpr int order = Stages::order;
  static constexpr bool reaches_beyond = true, divides = Stages::estimates;

  ImplicitScheme(Stages& stages, const Tolerances<Real>& tolerances, bool adaptive)
      : stages_(stages), interpolant_(stages.charts(), stages.present()), before_(stages.present()), trial_(before_), unsettled_(trial_.v), between_(stages.size()),
        tolerances_(tolerances), adaptive_(adaptive) {
    if constexpr (Stages::estimates) stages_.set_tolerances(tolerances);
  }

  bool adaptive() const { return adaptive_; }
  Real time() const { return present().t; }
  auto& cells() { return stages_.cells(); }
  const Stages& stages() const { return stages_; }

  /// Start and length of the last accepted step.
  std::pair<Real, Real> last_step() const { return {before_.t, h_last_}; }

  /// First step: accelerations change no velocity by more than the square root of the tolerance.
  Real begin(Real, const Vector&, Real left) const {
    using std::abs, std::pow;
    Real h = left;
    for (std::size_t i = 0; i < present().v.size(); ++i) {
      const Real usual = tolerances_.size(i, present().v.size());
      const Real size = usual + abs(present().v[i]), allowed = tolerances_.of(abs(present().v[i]), i, present().v.size()) / size;
      h = std::min(h, pow(allowed, Real(0.25)) * size / (usual / tolerances_.time() + abs(present().vdot[i])));
    }
    return h;
  }

  Attempt attempt(Real h, bool whole, long number) {
    Attempt attempt{Real(0), stages_.attempt(h, whole, number)};
    if constexpr (Stages::estimates) {
      if (!attempt.found && share_ < Real(1)) attempt.found = attempt_by_tolerance(h, whole, number);
      if (attempt.found && adaptive_) attempt.size = stages_.error(h);
      if (attempt.found && !adaptive_) follow_error(stages_.error(h));
    }
    if (!attempt.found) attempt.size = std::numeric_limits<Real>::infinity();
    return attempt;
  }

  void advance(Real) { cells().advance(); }

  Fault accept(Real h) {
    if (const Fault fault = stages_.accept(h, before_)) return fault;
    interpolant_.join(h, before_, present(), stages_.moved());
    h_last_ = h;
    trial_ = present();
    unsettled_ = trial_.v;
    return {};
  }

  Real follow(Real s) {
    put(s, trial_);
    return trial_.t = before_.t + s * h_last_;
  }

  void follow_to(Real t) {
    put((t - before_.t) / h_last_, trial_);
    trial_.t = t;
  }

  bool seek() { return stages_.seek(trial_); }
  std::size_t found() { return stages_.found(trial_); }

  Fault finish() {
    unsettled_ = trial_.v;
    const Fault fault = stages_.project(trial_);
    stages_.go_to(trial_);
    return fault;
  }

  Fault restart() { return stages_.restart(); }

  Fault adopt() {
    stages_.adopt();
    return stages_.restart();
  }

  const Real* pose() const { return present().q.data(); }

  void read_struck(Real t, State& state) {
    state = present();
    state.t = t;
    state.v = unsettled_;
  }

  void complete_struck(State& state) { stages_.accelerate(state); }

  void take_speeds(const Speeds<Subject>& v) {
    trial_ = present();
    trial_.v = v;
    stages_.go_to(trial_);
  }

  void read_end(State& state) {
    state = present();
    stages_.accelerate(state);
  }

  void read_between(Real t, State& state) {
    follow_to(t);
    state.q = trial_.q;
    state.v = trial_.v;
    if constexpr (Stages::estimates) stages_.accelerate(state);  // those of equal steps are between those of their ends
  }

  Fault read(Real t, bool lies_between, Vector& y) {
    trial_ = present();
    if (lies_between) follow_to(t);
    if constexpr (Stages::estimates) {
      if (const Fault fault = stages_.project(trial_)) return fault;
      residuals_ = stages_.residuals();
    }
    std::copy(trial_.v.begin(), trial_.v.end(), std::copy(trial_.q.begin(), trial_.q.end(), y.begin()));
    return {};
  }

  /// A step that could grow only a little keeps its length, to reuse its factors.
  Real length(Real last, Real allowed) const { return allowed >= last && allowed <= Real(1.2) * last ? last : allowed; }

  const Residuals& residuals() const { return residuals_; }  ///< of the last sample

  Fault give_up(const Attempt& attempt, long, long number) { return stages_.give_up(attempt.found, adaptive_, number, attempt.size); }

  /// Memory for the next steps and samples.
  struct Memory {
    typename Stages::Memory stages;
    typename Interpolant<Subject>::Memory interpolant;
    Real before, h_last, share;
  };

  Memory memory() const { return {stages_.memory(), interpolant_.memory(), before_.t, h_last_, share_}; }

  void restore(const Memory& memory) {
    stages_.restore(memory.stages);
    interpolant_.restore(memory.interpolant);
    before_.t = memory.before;
    h_last_ = memory.h_last;
    trial_ = present();
    if constexpr (Stages::estimates) take_share(memory.share);
  }

 private:
  const State& present() const { return stages_.present(); }

  /// Equal steps: the next iterations end when they leave a small share of the step's error, which may be far below the tolerance.
  void follow_error(Real size) {
    if (std::isfinite(static_cast<double>(size))) take_share(std::clamp(share_ * size, Real(1e-10), Real(1)));
  }

  void take_share(Real share) {
    share_ = share;
    stages_.set_tolerances(tolerances_.part(share_));
  }

  /// Whether stages converge to the tolerance itself, as near singular poses, where iterations get no closer.
  bool attempt_by_tolerance(Real h, bool whole, long number) {
    const Real share = share_;
    take_share(Real(1));
    const bool found = stages_.attempt(h, whole, number);
    if (!found) take_share(share);
    return found;
  }

  /// Coordinates and velocities at the fraction s of the last step.
  void put(Real s, State& state) {
    interpolant_.at(s, between_);
    const auto middle = between_.begin() + static_cast<std::ptrdiff_t>(state.q.size());
    std::copy(between_.begin(), middle, state.q.begin());
    std::copy(middle, between_.end(), state.v.begin());
  }

  Stages& stages_;
  Interpolant<Subject> interpolant_;
  State before_, trial_;
  Speeds<Subject> unsettled_;  ///< trial state before projection
  Vector between_;
  Tolerances<Real> tolerances_;
  Residuals residuals_;
  Real h_last_{1}, share_{1};  ///< `share_`: fraction of the tolerance that equal steps use
  bool adaptive_;
};

}  // namespace cutjoint::stepping
