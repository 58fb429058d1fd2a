// Inputs that a host gives a simulation, and how guides follow them.
#pragma once

#include <cmath>
#include <cstddef>
#include <limits>

#include "cutjoint/core/numbers/arrays.hpp"
#include "cutjoint/core/inputs/inputs.hpp"

namespace cutjoint {

/// A host's inputs.  An input whose value is no number follows the scene.  A value that was `put` with its rate and acceleration at a time
/// goes on like that; one that was written instead is held.
template <class Real, std::size_t n>
struct HostInputs {
  Fixed<Real, n> values;

  HostInputs() { values.fill(std::numeric_limits<Real>::quiet_NaN()); }

  void put(std::size_t i, Real t, Real value, Real rate, Real acceleration) {
    values[i] = put_[i] = value;
    rates_[i] = rate;
    accelerations_[i] = acceleration;
    times_[i] = t;
  }

  /// One input becomes that of others.
  void take(std::size_t i, const HostInputs& other) {
    put(i, other.times_[i], other.put_[i], other.rates_[i], other.accelerations_[i]);
    values[i] = other.values[i];
  }

  bool is_given(std::size_t i) const { return values[i] == values[i]; }

  /// Whether an input has a value without derivatives.
  bool is_held(std::size_t i) const { return is_given(i) && !(is_put(i) && (rates_[i] != Real(0) || accelerations_[i] != Real(0))); }

  /// Whether it has derivatives.
  bool is_going(std::size_t i) const { return is_given(i) && !is_held(i); }

  /// Value, rate and acceleration of an input that is given.
  void at(std::size_t i, Real t, Real* numbers) const {
    const bool goes_on = is_put(i);
    const Real since = t - times_[i], rate = goes_on ? rates_[i] : Real(0), acceleration = goes_on ? accelerations_[i] : Real(0);
    numbers[0] = values[i] + since * (rate + since / 2 * acceleration);
    numbers[1] = rate + since * acceleration;
    numbers[2] = acceleration;
  }

  static void fill(void* host, Real t, Real* input) {
    const HostInputs& given = *static_cast<const HostInputs*>(host);
    for (std::size_t i = 0; i < n; ++i)
      if (given.is_given(i)) given.at(i, t, input + numbers_per_input * i);
  }

  /// Begin at time 0: derivatives that were given before the present time are forgotten, those given now hold from then on.
  void begin(Real now) {
    for (std::size_t i = 0; i < n; ++i) {
      const bool goes_on = is_put(i) && times_[i] == now;
      put(i, Real(0), values[i], goes_on ? rates_[i] : Real(0), goes_on ? accelerations_[i] : Real(0));
    }
  }

  /// A source that gives these; none where all follow the scene.
  InputSource<Real> source() {
    for (const Real value : values)
      if (value == value) return {&fill, this};
    return {};
  }

  /// Whether another would give the same of an input.
  bool is_same(std::size_t i, const HostInputs& other) const {
    const bool follow = !is_given(i) && !other.is_given(i);
    return follow || (values[i] == other.values[i] && put_[i] == other.put_[i] && rates_[i] == other.rates_[i] &&
                      accelerations_[i] == other.accelerations_[i] && times_[i] == other.times_[i]);
  }

  bool operator==(const HostInputs& other) const {
    bool same = true;
    for (std::size_t i = 0; i < n; ++i) same = same && is_same(i, other);
    return same;
  }

 private:
  bool is_put(std::size_t i) const { return values[i] == put_[i]; }

  Fixed<Real, n> put_, rates_, accelerations_, times_;
};

/// Inputs as a simulation uses them: as the host gives them, but those that move guides, `guiding`, follow it without a jump of value or rate.
///
/// A guide whose value or rate jumped would leave loops open and lose the momentum of what it carries.  So it goes from where it is, and as
/// fast as it moves, along two parabolas to the host's trajectory.  They are what integrators integrate without error, so that loops stay as
/// closed as behind a law.  Each is as long as a step.  A host may give derivatives with each step.  Then the first parabola aims at its
/// trajectory half a step later, since derivatives extrapolate worse over longer times; two more parabolas follow where the host gives no others.
///
/// An input that is held has a rate too: its last change over the time of the call, or over that of the call before if this is smaller.  It
/// has none where the two have other signs, so that nothing goes beyond a value to which it jumps.  With such a rate it is at the held
/// value at the end of the call, and without it at rest there after two steps.  A jump that is being made comes to its end first, so that
/// nothing goes beyond then either.
template <class Real, std::size_t n, int... guiding>
class FollowedInputs {
 public:
  using Inputs = HostInputs<Real, n>;

  /// Whether any input moves a guide.
  static constexpr bool any = sizeof...(guiding) > 0;

  /// Whether one does.
  static constexpr bool is_guiding(std::size_t i) { return ((static_cast<std::size_t>(guiding) == i) || ...); }

  /// The inputs that drive steps.
  Inputs& used() { return used_; }

  /// Be where the host is.
  void begin(const Inputs& given) {
    used_ = heard_ = given;
    trajectories_.fill({});
    planned_ = -std::numeric_limits<Real>::infinity();
  }

  /// Whether the host gives what it gave before.
  bool hears_nothing(const Inputs& given) const {
    return given == heard_;
  }

  /// Whether it gives inputs that move no guide as before.
  bool others_stay(const Inputs& given) const {
    bool stay = true;
    for (std::size_t i = 0; i < n; ++i) stay = stay && (is_guiding(i) || given.is_same(i, used_));
    return stay;
  }

  /// Take the other inputs as the host gives them.
  void take_others(const Inputs& given) {
    for (std::size_t i = 0; i < n; ++i) {
      if (is_guiding(i)) continue;
      used_.take(i, given);
      heard_.take(i, given);
    }
  }

  /// Whether a call from a time on begins another trajectory, or another part of one.
  bool is_due(const Inputs& given, Real t, Real rounding) const {
    if (!hears_nothing(given)) return true;
    bool due = false;
    each([&](const Trajectory& trajectory, std::size_t) {
      due = due || (trajectory.part != 0 && !(t < trajectory.end - rounding)) || ((trajectory.derivative != Real(0) || trajectory.last != Real(0)) && t != planned_);
    });
    return due;
  }

  /// Be where the host goes, so much time ahead of what it gives.
  void look_ahead(Real t, Real time) {
    each([&](const Trajectory& trajectory, std::size_t i) {
      if (!heard_.is_given(i)) return;
      Real there[numbers_per_input];
      heard_.at(i, t + time, there);
      used_.put(i, t, there[0] + (heard_.is_held(i) ? time * trajectory.derivative : Real(0)), Real(0), Real(0));
    });
  }

  /// Whether a guide catches up with a jump, which may leave loops open: they are straight for the integrator, but not for the joints.
  bool is_catching_up() const {
    bool catches = false;
    each([&](const Trajectory& trajectory, std::size_t) { catches = catches || (trajectory.part != 0 && trajectory.jumps != 0); });
    return catches;
  }

  /// The end of the part of an input trajectory that ends first, infinity where none does.
  Real next_end() const {
    Real next = std::numeric_limits<Real>::infinity();
    each([&](const Trajectory& trajectory, std::size_t) { next = trajectory.part != 0 && trajectory.end < next ? trajectory.end : next; });
    return next;
  }

  /// At a time, go over to the next parts of trajectories; whether there was any.
  bool go_over(Real t, Real rounding) {
    bool goes = false;
    each([&](Trajectory& trajectory, std::size_t i) {
      if (trajectory.part == 0 || t < trajectory.end - rounding) return;
      goes = true;
      if (trajectory.part == 1 && trajectory.again != Real(0)) {
        Real now[numbers_per_input], wanted[numbers_per_input];
        used_.at(i, trajectory.end, now);
        heard_.at(i, trajectory.end + 2 * trajectory.again, wanted);
        go(trajectory, i, trajectory.end, now, trajectory.again, trajectory.again, wanted);
        trajectory.again = Real(0);
      } else if (trajectory.part == 1) {
        used_.put(i, trajectory.end, trajectory.value, trajectory.rate, trajectory.acceleration);
        trajectory.end = trajectory.last_end;
        trajectory.part = 2;
      } else {
        if (trajectory.derivative == Real(0)) used_.take(i, heard_);  // else the guide still moves where the next call begins
        trajectory.part = 0;
      }
    });
    return goes;
  }

  /// At a time, the begin of a call up to `until` with steps of length dt, go on to where the host is now; whether an acceleration jumps.
  /// `scene(i, t, numbers)` is what the scene's law gives an input.
  template <class Scene>
  bool go_on(const Inputs& given, Real t, Real until, Real dt, Scene scene) {
    bool jumps = go_over(t, Real(1e-9) * dt);
    if (t == planned_ && hears_nothing(given)) return jumps;
    each([&](Trajectory& trajectory, std::size_t i) { jumps = plan(trajectory, i, given, t, until - t, dt, scene) || jumps; });
    planned_ = t;
    return jumps;
  }

 private:
  /// The parts after the present one: where and how the second one begins, and when both end; `again` is the length of the parts of another
  /// trajectory that comes instead.  `derivative` is the rate at which the input is followed, `last` that of the last change of a held one; by `arrival` a jump is made.
  struct Trajectory {
    Real end{0}, last_end{0}, value{0}, rate{0}, acceleration{0}, again{0}, derivative{0}, last{0}, arrival{0};
    long part = 0;   ///< 1 or 2; 0: as the host or the scene has it
    long jumps = 0;  ///< whether the host is farther away than it goes in a step
  };

  static constexpr std::size_t places[sizeof...(guiding) + 1] = {static_cast<std::size_t>(guiding)..., 0};

  template <class Do>
  void each(Do visit) {
    for (std::size_t k = 0; k < sizeof...(guiding); ++k) visit(trajectories_[k], places[k]);
  }
  template <class Do>
  void each(Do visit) const {
    for (std::size_t k = 0; k < sizeof...(guiding); ++k) visit(trajectories_[k], places[k]);
  }

  /// Value, rate and acceleration of an input.
  template <class Scene>
  static void read(const Inputs& inputs, std::size_t i, Real t, Scene scene, Real* numbers) {
    if (inputs.is_given(i)) inputs.at(i, t, numbers);
    else scene(i, t, numbers);
  }

  /// Plan the trajectory of one input; whether its acceleration jumps.
  template <class Scene>
  bool plan(Trajectory& trajectory, std::size_t i, const Inputs& given, Real t, Real length, Real dt, Scene scene) {
    const bool is_same = given.is_same(i, heard_), is_held = given.is_held(i);
    if (is_same && trajectory.derivative == Real(0)) {
      trajectory.last = Real(0);
      return false;
    }
    const Real last = is_held && heard_.is_held(i) ? (given.values[i] - heard_.values[i]) / length : Real(0);
    trajectory.derivative = smaller(last, trajectory.last);
    trajectory.last = last;
    heard_.take(i, given);
    Real now[numbers_per_input], wanted[numbers_per_input];
    read(used_, i, t, scene, now);
    if (is_held) {
      if (given.values[i] == now[0] && now[1] == Real(0) && trajectory.derivative == Real(0)) return stay(trajectory, i), now[2] != Real(0);
      wanted[0] = given.values[i] - trajectory.derivative * length;
      wanted[1] = trajectory.derivative;
    } else {
      read(given, i, t, scene, wanted);
      if (wanted[0] == now[0] && wanted[1] == now[1]) return stay(trajectory, i), wanted[2] != now[2];
    }
    const bool is_long = trajectory.derivative != Real(0) && length > Real(1.5) * dt;
    const Real whole = Real(static_cast<long>(length / dt / 2 + Real(0.25))) * dt, one = length < dt ? length : dt;
    const Real longest = is_long ? whole : one, left = trajectory.arrival - t;
    const Real first = trajectory.part != 0 && left > Real(1e-9) * dt && left < longest * (1 - Real(1e-9)) ? left : longest;
    const Real last_part = given.is_going(i) ? one / 2 : one, second = is_long && length - first > last_part ? length - first : last_part;
    trajectory.again = given.is_going(i) ? one : Real(0);
    trajectory.jumps = is_jump(now, wanted[0], wanted[1], one);
    if (is_held) wanted[0] += trajectory.derivative * (first + second);
    else read(given, i, t + (first + second), scene, wanted);
    go(trajectory, i, t, now, first, second, wanted);
    return true;
  }

  /// Whether an input is farther from where it should be by now, or from its rate, than a tenth of its way in a step.
  static bool is_jump(const Real* now, Real value, Real rate, Real step) {
    const Real near = Real(0.1) * step * std::abs(now[1]);
    return !(std::abs(value - now[0]) < near && step * std::abs(rate - now[1]) < near);
  }

  /// Be as the host or the scene has it.
  void stay(Trajectory& trajectory, std::size_t i) {
    used_.take(i, heard_);
    trajectory.part = 0;
  }

  /// Go along two parabolas to another value and rate.
  void go(Trajectory& trajectory, std::size_t i, Real t, const Real* now, Real first, Real second, const Real* wanted) {
    const Real between = (2 * (wanted[0] - now[0]) - first * now[1] - second * wanted[1]) / (first + second);
    used_.put(i, t, now[0], now[1], (between - now[1]) / first);
    trajectory.end = t + first;
    trajectory.last_end = t + (first + second);
    trajectory.value = now[0] + first * (now[1] + between) / 2;
    trajectory.rate = between;
    trajectory.acceleration = (wanted[1] - between) / second;
    trajectory.arrival = std::abs(between - wanted[1]) < Real(0.1) * std::abs(now[1] - wanted[1]) ? trajectory.end : trajectory.last_end;
    trajectory.part = 1;
  }

  /// The one of two rates that is nearer to 0; 0 where they have other signs.
  static Real smaller(Real a, Real b) {
    if (!(a * b > Real(0))) return Real(0);
    return std::abs(a) < std::abs(b) ? a : b;
  }

  Inputs used_, heard_;
  Fixed<Trajectory, sizeof...(guiding)> trajectories_;
  Real planned_{0};  ///< when trajectories were planned last
};

}  // namespace cutjoint
