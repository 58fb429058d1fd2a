// Inputs of a mechanism or system: parameters that are read at every step.
#pragma once

namespace cutjoint {

/// Of an input in turn: its value, its rate and its acceleration.  Laws read the value; guides need all three.
inline constexpr int numbers_per_input = 3;

/// The events of inputs where a step begins: whether accelerations jump, whether a guide that jumps may leave loops open, and whether the trajectory of one
/// has parts within the step.
struct StepBegin {
  bool jumps = false, opens = false, parts = false;
};

/// A source of inputs.  `fill` receives the array of a step, with three numbers for each input in the order of the description: the values
/// of the scene's laws at time t.  It writes the inputs of the source and leaves the others.  It is called whenever a step or a part of one
/// begins, with any t in the step, and must depend on nothing but t until the step ends.  `host` is handed on as it is.  Without `fill` the
/// scene's laws alone are the source.  With `begin` the source is told of each step, from t to another time, and says what that begins with.
template <class Real>
struct InputSource {
  void (*fill)(void* host, Real t, Real* input) = nullptr;
  void* host = nullptr;
  StepBegin (*begin)(void* host, Real t, Real until) = nullptr;
};

/// The array of a step: `length` numbers, those of the inputs, then what the scene's laws are watched by.
template <class Real, int length>
class StepInputs {
 public:
  void drive_by(const InputSource<Real>& source) { source_ = source; }

  /// The array at time t: the scene's laws, then what the source gives instead.
  template <class Generated>
  const Real* at(Real t, const Generated& generated) {
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

/// A source whose host holds the values of all `count` inputs and may change them between steps.  Rates and accelerations are zero, so that
/// a guide stands still within a step and jumps between steps: a law does not mind, a guide should be interpolated.
template <class Real>
struct Held {
  const Real* values;
  int count;

  InputSource<Real> source() { return {&fill, this}; }

  static void fill(void* host, Real, Real* input) {
    const Held& held = *static_cast<const Held*>(host);
    for (int i = 0; i < held.count; ++i) {
      Real* const numbers = input + numbers_per_input * i;
      numbers[0] = held.values[i];
      numbers[1] = numbers[2] = Real(0);
    }
  }
};

/// The cubic with these values and rates at 0 and at `length`, at `at` beyond 0: value, rate and acceleration.
template <class Real>
void interpolate(Real at, Real length, Real begin, Real begin_rate, Real end, Real end_rate, Real* numbers) {
  const Real derivative = (end - begin) / length;
  const Real second = (3 * derivative - 2 * begin_rate - end_rate) / length, third = (begin_rate + end_rate - 2 * derivative) / (length * length);
  numbers[0] = begin + at * (begin_rate + at * (second + at * third));
  numbers[1] = begin_rate + at * (2 * second + 3 * at * third);
  numbers[2] = 2 * second + 6 * at * third;
}

/// A source whose host gives values, and if it likes rates, of all `count` inputs at the begin and at the end of a step or of a sampling
/// interval.  Between them an input follows the cubic with these values and rates; without rates, a straight line.
template <class Real>
struct Interpolated {
  Real begin_time, end_time;
  const Real* begin;
  const Real* end;
  const Real* begin_rates = nullptr;
  const Real* end_rates = nullptr;
  int count = 0;

  InputSource<Real> source() { return {&fill, this}; }

  static void fill(void* host, Real t, Real* input) {
    const Interpolated& x = *static_cast<const Interpolated*>(host);
    const Real length = x.end_time - x.begin_time;
    for (int i = 0; i < x.count; ++i) {
      const Real derivative = (x.end[i] - x.begin[i]) / length;
      const bool cubic = x.begin_rates && x.end_rates;
      interpolate(t - x.begin_time, length, x.begin[i], cubic ? x.begin_rates[i] : derivative, x.end[i], cubic ? x.end_rates[i] : derivative,
                  input + numbers_per_input * i);
    }
  }
};

}  // namespace cutjoint
