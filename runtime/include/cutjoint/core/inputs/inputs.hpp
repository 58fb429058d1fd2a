// Inputs of a mechanism or system: parameters that are read at every step.
#pragma once

namespace cutjoint {

/// Value, rate and acceleration of an input, in this order.  Laws read the value; guides need all three.
inline constexpr int numbers_per_input = 3;

/// Events of inputs at the beginning of a step: whether accelerations jump, whether a guide's jump may leave loops open, and whether a guide's trajectory
/// has several pieces within the step.
struct StepBegin {
  bool jumps = false, opens = false, parts = false;
};

/// A source of inputs.  `fill` receives the array of a step, three numbers for each input in the order of the description, with the values
/// of the scene's laws at time t.  It overwrites the inputs of the source.  It is called with any t in a step or substep
/// and must depend on t alone until the step ends.  `host` is its first argument.  Without `fill` the scene's laws are the only source.
/// `begin` is called at the beginning of each step, from t to `until`, and returns its events.
template <class Real>
struct InputSource {
  void (*fill)(void* host, Real t, Real* input) = nullptr;
  void* host = nullptr;
  StepBegin (*begin)(void* host, Real t, Real until) = nullptr;
};

/// The array of a step: `length` numbers, those of the inputs, then those that monitor the scene's laws.
template <class Real, int length>
class StepInputs {
 public:
  void drive_by(const InputSource<Real>& source) { source_ = source; }

  /// The array at time t: the scene's laws, overwritten by the source.
  const Real* at(Real t, const auto& generated) {
    generated.scene_inputs(t, input_);
    if (source_.fill) source_.fill(source_.host, t, input_);
    return input_;
  }

  /// The array of the last time.
  const Real* last() const { return input_; }

 private:
  InputSource<Real> source_;
  Real input_[length] = {};
};

/// Value, rate and acceleration at `at` of the cubic with these values and rates at 0 and at `length`.
template <class Real>
void interpolate(Real at, Real length, Real begin, Real begin_rate, Real end, Real end_rate, Real* numbers) {
  const Real derivative = (end - begin) / length;
  const Real second = (3 * derivative - 2 * begin_rate - end_rate) / length, third = (begin_rate + end_rate - 2 * derivative) / (length * length);
  numbers[0] = begin + at * (begin_rate + at * (second + at * third));
  numbers[1] = begin_rate + at * (2 * second + 3 * at * third);
  numbers[2] = 2 * second + 6 * at * third;
}

}  // namespace cutjoint
