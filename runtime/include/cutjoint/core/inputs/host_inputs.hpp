// Inputs that a host gives a simulation, and smooth trajectories of guides that follow them.
#pragma once

#include <cmath>
#include <limits>

#include "cutjoint/core/numbers/arrays.hpp"
#include "cutjoint/core/inputs/inputs.hpp"

namespace cutjoint {

/// A host's inputs.  An input whose value is NaN follows the scene.  A value that was `put` with rate and acceleration at a time is
/// extrapolated; a value written to `values` is constant (zero-order hold).
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

  /// Copy one input.
  void take(std::size_t i, const HostInputs& other) {
    put(i, other.times_[i], other.put_[i], other.rates_[i], other.accelerations_[i]);
    values[i] = other.values[i];
  }

  bool is_given(std::size_t i) const { return values[i] == values[i]; }

  /// Whether an input has a value without derivatives.
  bool is_constant(std::size_t i) const { return is_given(i) && !(is_put(i) && (rates_[i] != Real(0) || accelerations_[i] != Real(0))); }

  /// Whether it has a value with derivatives.
  bool has_derivatives(std::size_t i) const { return is_given(i) && !is_constant(i); }

  /// Value, rate and acceleration of a given input at a time.
  void at(std::size_t i, Real t, Real* numbers) const {
    const bool is_extrapolated = is_put(i);
    const Real since = t - times_[i], rate = is_extrapolated ? rates_[i] : Real(0), acceleration = is_extrapolated ? accelerations_[i] : Real(0);
    numbers[0] = values[i] + since * (rate + since / 2 * acceleration);
    numbers[1] = rate + since * acceleration;
    numbers[2] = acceleration;
  }

  static void fill(void* host, Real t, Real* input) {
    const HostInputs& given = *static_cast<const HostInputs*>(host);
    for (std::size_t i = 0; i < n; ++i)
      if (given.is_given(i)) given.at(i, t, input + numbers_per_input * i);
  }

  /// Begin at time 0: derivatives given before the present time are discarded, those given now hold from time 0.
  void begin(Real now) {
    for (std::size_t i = 0; i < n; ++i) {
      const bool is_extrapolated = is_put(i) && times_[i] == now;
      put(i, Real(0), values[i], is_extrapolated ? rates_[i] : Real(0), is_extrapolated ? accelerations_[i] : Real(0));
    }
  }

  /// The source of these; none if all follow the scene.
  InputSource<Real> source() {
    for (const Real value : values)
      if (value == value) return {&fill, this};
    return {};
  }

  /// Whether an input is the same in another.
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

/// Inputs as a simulation uses them: those of the host, except that `guiding` inputs, which move guides, follow it without jumps of value or rate.
///
/// A jump of a guide's value or rate would open loops and violate momentum.  So the guide moves from its present value and rate to the host's
/// trajectory in two parabolic segments, which integrators integrate exactly.  Each is one step long.  If the host gives derivatives with each
/// step, the second segment is half a step long, since derivatives extrapolate worse over longer times; two more segments follow if the host
/// gives no new values.
///
/// A constant input has an estimated rate too: its last change over the call's length or that of the call before, whichever is smaller, and
/// zero if their signs differ, to avoid overshoot.  With this rate it reaches the host's value at the end of the call; with zero rate it is at
/// rest there after two steps.  A jump in progress is finished first, again to avoid overshoot.
template <class Real, std::size_t n, int... guiding>
class SmoothedInputs {
 public:
  using Inputs = HostInputs<Real, n>;

  /// Whether any input moves a guide.
  static constexpr bool any = sizeof...(guiding) > 0;

  /// Whether this one does.
  static constexpr bool is_guiding(std::size_t i) { return ((static_cast<std::size_t>(guiding) == i) || ...); }

  /// The inputs that drive steps.
  Inputs& used() { return used_; }

  /// Set the host's values without smoothing.
  void begin(const Inputs& given) {
    used_ = given_ = given;
    trajectories_.fill({});
    planned_ = -std::numeric_limits<Real>::infinity();
  }

  /// Whether the host's inputs are unchanged.
  bool is_unchanged(const Inputs& given) const { return given == given_; }

  /// Whether those that move no guide are.
  bool others_are_unchanged(const Inputs& given) const {
    bool stay = true;
    for (std::size_t i = 0; i < n; ++i) stay = stay && (is_guiding(i) || given.is_same(i, used_));
    return stay;
  }

  /// Take the inputs that move no guide.
  void take_others(const Inputs& given) {
    for (std::size_t i = 0; i < n; ++i) {
      if (is_guiding(i)) continue;
      used_.take(i, given);
      given_.take(i, given);
    }
  }

  /// Whether a call from this time begins a new trajectory, or a new segment of one.
  bool is_due(const Inputs& given, Real t, Real rounding) const {
    if (!is_unchanged(given)) return true;
    bool due = false;
    each([&](const Trajectory& trajectory, std::size_t) {
      due = due || (trajectory.part != 0 && !(t < trajectory.end - rounding)) || ((trajectory.derivative != Real(0) || trajectory.last != Real(0)) && t != planned_);
    });
    return due;
  }

  /// Set the values that the host's inputs reach after some time.
  void look_ahead(Real t, Real time) {
    each([&](const Trajectory& trajectory, std::size_t i) {
      if (!given_.is_given(i)) return;
      Real there[numbers_per_input];
      given_.at(i, t + time, there);
      used_.put(i, t, there[0] + (given_.is_constant(i) ? time * trajectory.derivative : Real(0)), Real(0), Real(0));
    });
  }

  /// Whether a guide is catching up with a jump, in which loops may open.
  bool is_catching_up() const {
    bool catches = false;
    each([&](const Trajectory& trajectory, std::size_t) { catches = catches || (trajectory.part != 0 && trajectory.jumps != 0); });
    return catches;
  }

  /// The end of the segment that ends first, or infinity.
  Real next_end() const {
    Real next = std::numeric_limits<Real>::infinity();
    each([&](const Trajectory& trajectory, std::size_t) { next = trajectory.part != 0 && trajectory.end < next ? trajectory.end : next; });
    return next;
  }

  /// Enter the segments that begin at this time; return whether there are any.
  bool advance_piece(Real t, Real rounding) {
    bool entered = false;
    each([&](Trajectory& trajectory, std::size_t i) {
      if (trajectory.part == 0 || t < trajectory.end - rounding) return;
      entered = true;
      if (trajectory.part == 1 && trajectory.again != Real(0)) {
        Real now[numbers_per_input], wanted[numbers_per_input];
        used_.at(i, trajectory.end, now);
        given_.at(i, trajectory.end + 2 * trajectory.again, wanted);
        set_segments(trajectory, i, trajectory.end, now, trajectory.again, trajectory.again, wanted);
        trajectory.again = Real(0);
      } else if (trajectory.part == 1) {
        used_.put(i, trajectory.end, trajectory.value, trajectory.rate, trajectory.acceleration);
        trajectory.end = trajectory.last_end;
        trajectory.part = 2;
      } else {
        if (trajectory.derivative == Real(0)) used_.take(i, given_);  // else the guide still moves when the next call begins
        trajectory.part = 0;
      }
    });
    return entered;
  }

  /// Begin a call from t to `until` with steps of length dt: plan trajectories to the host's inputs. Return whether an acceleration jumps.
  /// `scene(i, t, numbers)` evaluates the scene's law of an input.
  bool begin_call(const Inputs& given, Real t, Real until, Real dt, auto scene) {
    bool jumps = advance_piece(t, Real(1e-9) * dt);
    if (t == planned_ && is_unchanged(given)) return jumps;
    each([&](Trajectory& trajectory, std::size_t i) { jumps = plan(trajectory, i, given, t, until - t, dt, scene) || jumps; });
    planned_ = t;
    return jumps;
  }

 private:
  /// The present segments: how the second one begins, and when both end; `again` is the length of the two further segments, if any.
  /// `derivative` is the rate with which the input is followed, `last` that of the last change of a constant one; `arrival` is the end of a jump.
  struct Trajectory {
    Real end{0}, last_end{0}, value{0}, rate{0}, acceleration{0}, again{0}, derivative{0}, last{0}, arrival{0};
    long part = 0;   ///< 1 or 2; 0: the input of the host or the scene
    long jumps = 0;  ///< whether the host's value is farther away than a step's displacement
  };

  static constexpr std::size_t places[sizeof...(guiding) + 1] = {static_cast<std::size_t>(guiding)..., 0};

  void each(auto visit) {
    for (std::size_t k = 0; k < sizeof...(guiding); ++k) visit(trajectories_[k], places[k]);
  }
  void each(auto visit) const {
    for (std::size_t k = 0; k < sizeof...(guiding); ++k) visit(trajectories_[k], places[k]);
  }

  /// Value, rate and acceleration of an input.
  template <class Scene>
  static void read(const Inputs& inputs, std::size_t i, Real t, Scene scene, Real* numbers) {
    if (inputs.is_given(i)) inputs.at(i, t, numbers);
    else scene(i, t, numbers);
  }

  /// Plan the trajectory of one input; return whether its acceleration jumps.
  bool plan(Trajectory& trajectory, std::size_t i, const Inputs& given, Real t, Real length, Real dt, auto scene) {
    const bool is_same = given.is_same(i, given_), is_constant = given.is_constant(i);
    if (is_same && trajectory.derivative == Real(0)) {
      trajectory.last = Real(0);
      return false;
    }
    const Real last = is_constant && given_.is_constant(i) ? (given.values[i] - given_.values[i]) / length : Real(0);
    trajectory.derivative = smaller_rate(last, trajectory.last);
    trajectory.last = last;
    given_.take(i, given);
    Real now[numbers_per_input], wanted[numbers_per_input];
    read(used_, i, t, scene, now);
    if (is_constant) {
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
    const Real last_part = given.has_derivatives(i) ? one / 2 : one, second = is_long && length - first > last_part ? length - first : last_part;
    trajectory.again = given.has_derivatives(i) ? one : Real(0);
    trajectory.jumps = is_jump(now, wanted[0], wanted[1], one);
    if (is_constant) wanted[0] += trajectory.derivative * (first + second);
    else read(given, i, t + (first + second), scene, wanted);
    set_segments(trajectory, i, t, now, first, second, wanted);
    return true;
  }

  /// Whether an input or its rate is off by more than a tenth of a step's displacement.
  static bool is_jump(const Real* now, Real value, Real rate, Real step) {
    const Real near = Real(0.1) * step * std::abs(now[1]);
    return !(std::abs(value - now[0]) < near && step * std::abs(rate - now[1]) < near);
  }

  /// Use the input of the host or the scene.
  void stay(Trajectory& trajectory, std::size_t i) {
    used_.take(i, given_);
    trajectory.part = 0;
  }

  /// Move along two parabolic segments to another value and rate.
  void set_segments(Trajectory& trajectory, std::size_t i, Real t, const Real* now, Real first, Real second, const Real* wanted) {
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

  /// The smaller of two rates by magnitude; 0 if their signs differ.
  static Real smaller_rate(Real a, Real b) {
    if (!(a * b > Real(0))) return Real(0);
    return std::abs(a) < std::abs(b) ? a : b;
  }

  Inputs used_, given_;
  Fixed<Trajectory, sizeof...(guiding)> trajectories_;
  Real planned_{0};  ///< when trajectories were planned last
};

}  // namespace cutjoint
