// Values that controllers hold between their samples.
#pragma once

#include <cmath>
#include <limits>
#include <span>

#include "cutjoint/core/numbers/arrays.hpp"
#include "cutjoint/core/mechanism/chart.hpp"
#include "cutjoint/core/inputs/inputs.hpp"

namespace cutjoint {

/// The sample times of the controllers of a mechanism or system.
template <class M>
auto samples_of(const M& subject) {
  if constexpr (Sized<M>) {
    return std::span<const SampleTimes>(M::samples);
  } else {
    std::vector<SampleTimes> times;
    for (const auto& controller : subject.description().controllers) times.push_back(controller.times);
    return times;
  }
}

/// What samples at one instant have changed: `any` value, one on which the `motion` depends, and one that `outdates` the next values of later controllers.
struct SampleChanges { bool any = false, motion = false, outdates = true; };

/// Whether a mechanism or system may have controllers, as known at compile time.
template <class M>
constexpr bool may_sample = !Sized<M> || static_sizes<M>().controllers > 0;

/// The values that controllers hold (zero-order hold), and their numbers of samples.  As a source of inputs it appends these values to those of another
/// source.  Before the first sample a value is NaN, and the scene's start value is used.
template <class M>
class Sampling {
 public:
  using Real = typename M::real_type;

  struct Memory {
    Array<M, static_sizes<M>().discrete> values;
    Array<M, static_sizes<M>().controllers, long> numbers;
  };

  explicit Sampling(const M& subject)
      : times_(samples_of(subject)), first_(numbers_per_input * sizes_of(subject).inputs), next_(discrete(times_)), memory_{next_, {}} {
    if constexpr (!Sized<M>) memory_.numbers.resize(times_.size());
    begin();
  }

  /// The source that appends discrete states to another's inputs; this object must outlive its use.
  InputSource<Real> source(const InputSource<Real>& others) {
    others_ = others;
    return times_.empty() ? others : InputSource<Real>{&fill, this, others.begin ? &begin_others : nullptr};
  }

  bool any() const { return !times_.empty(); }
  std::size_t size() const { return times_.size(); }

  /// No controller has taken a sample.
  void begin() {
    std::fill(memory_.values.begin(), memory_.values.end(), std::numeric_limits<Real>::quiet_NaN());
    std::fill(memory_.numbers.begin(), memory_.numbers.end(), 0L);
  }

  /// The time of the next sample, or of the next that reads accelerations or multipliers; infinity if there is none.
  Real next(bool accelerated = false) const {
    Real next = std::numeric_limits<Real>::infinity();
    for (std::size_t i = 0; i < times_.size(); ++i)
      if (!accelerated || times_[i].accelerated) next = std::min(next, time_of(i));
    return next;
  }

  bool is_due(std::size_t i, Real t, Real rounding) const { return time_of(i) <= t + rounding; }

  /// The time was set from outside: the next samples are those after it.
  void skip_to(Real t, Real rounding) {
    for (std::size_t i = 0; i < times_.size(); ++i) {
      const double passed = (static_cast<double>(t + rounding) - times_[i].offset) / times_[i].every;
      memory_.numbers[i] = passed < 0.0 ? 0 : static_cast<long>(std::floor(passed)) + 1;
    }
  }

  /// Set the discrete states after the samples up to a time.
  void resume(Real t, Real rounding, const Array<M, static_sizes<M>().discrete>& values) {
    memory_.values = values;
    skip_to(t, rounding);
  }

  /// Set the discrete states until they are restored.
  void set_values(const Array<M, static_sizes<M>().discrete>& values) { memory_.values = values; }

  /// The destination of the next values of all controllers.
  Real* next_values() { return next_.data(); }

  /// Take over the next values of a controller; false if one is not finite, with the old ones unchanged.
  bool take(std::size_t i, SampleChanges& changes) {
    const std::size_t first = first_of(i), end = first + discrete_by(i);
    for (std::size_t k = first; k < end; ++k)
      if (!(next_[k] - next_[k] == Real(0))) return false;
    for (std::size_t k = first; k < end; ++k) {
      if (memory_.values[k] == next_[k]) continue;
      changes.any = true;
      changes.motion |= (times_[i].affects[k - first] - '0') % 2 > 0;
      changes.outdates |= times_[i].affects[k - first] > '1';
      memory_.values[k] = next_[k];
    }
    ++memory_.numbers[i];
    return true;
  }

  /// Whether its samples read accelerations or multipliers.
  bool is_accelerated(std::size_t i) const { return times_[i].accelerated; }

  /// The index of its first value.
  std::size_t first_of(std::size_t controller) const {
    std::size_t first = 0;
    for (std::size_t i = 0; i < controller; ++i) first += discrete_by(i);
    return first;
  }

  std::size_t discrete_by(std::size_t controller) const { return static_cast<std::size_t>(times_[controller].discrete); }

  /// Whether a controller's last sample was at this time.
  bool is_of(std::size_t controller, Real t, Real rounding) const {
    const Real last = time_of(controller) - Real(times_[controller].every);
    return memory_.numbers[controller] > 0 && last <= t + rounding && t <= last + rounding;
  }

  const Memory& memory() const { return memory_; }
  void restore(const Memory& memory) { memory_ = memory; }

 private:
  Real time_of(std::size_t i) const { return Real(times_[i].offset + static_cast<double>(memory_.numbers[i]) * times_[i].every); }

  static std::size_t discrete(const auto& times) {
    std::size_t number = 0;
    for (const SampleTimes& each : times) number += static_cast<std::size_t>(each.discrete);
    return number;
  }

  static void fill(void* host, Real t, Real* input) {
    const Sampling& own = *static_cast<const Sampling*>(host);
    if (own.others_.fill) own.others_.fill(own.others_.host, t, input);
    const auto& values = own.memory_.values;
    for (std::size_t i = 0; i < values.size(); ++i)
      if (values[i] == values[i]) input[own.first_ + i] = values[i];
  }

  static StepBegin begin_others(void* host, Real t, Real until) {
    const Sampling& own = *static_cast<const Sampling*>(host);
    return own.others_.begin(own.others_.host, t, until);
  }

  decltype(samples_of(std::declval<const M&>())) times_;
  std::size_t first_;
  Array<M, static_sizes<M>().discrete> next_;
  Memory memory_;
  InputSource<Real> others_;
};

/// No controllers.
template <class M>
struct NoSampling {
  struct Memory {};

  explicit NoSampling(const M&) {}

  InputSource<typename M::real_type> source(const InputSource<typename M::real_type>& others) const { return others; }
  void begin() {}
  Memory memory() const { return {}; }
  void restore(const Memory&) {}
  void skip_to(typename M::real_type, typename M::real_type) {}
};

template <class M>
using SamplingOf = std::conditional_t<may_sample<M>, Sampling<M>, NoSampling<M>>;

}  // namespace cutjoint
