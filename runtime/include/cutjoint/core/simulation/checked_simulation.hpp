// A simulation for the C interface: the caller's memory, checked calls, statuses, names.
#pragma once

#include <cstdint>
#include <cstring>
#include <new>

#include "cutjoint/core/simulation/simulation.hpp"

namespace cutjoint {

/// Statuses of calls: 0, negative for a rejected call, positive for causes of faults of the motion.
enum CallStatus : int { call_ok = 0, no_simulation = -1, no_such_index = -2, not_started = -3, not_finite = -4, no_array = -5, time_passed = -6 };

/// A number that a trimmed start finds: the index of a speed whose coordinate moves, or that is a rate itself, of an input or a parameter; its value in the
/// start of the file, the size of its changes, and its bounds.
struct TrimmedNumber {
  enum Kind { move, rate, input, parameter } kind;
  int index;
  double begin, size, lower, upper;
};

template <class Model>
class Trimming;

/// A start value: the index of a coordinate or velocity, -1 at the end of a list, and its value.
struct StartValue {
  int index;
  double value;
};

/// The element of a table; null for an index out of range.
const char* element_of(const auto& table, int index) {
  return index < 0 || static_cast<std::size_t>(index) >= std::size(table) ? nullptr : table[index];
}

/// The index of a name in a table that ends with a null pointer, -1 if it is not there.
int find_in(const auto& table, const char* name) {
  for (int i = 0; name && table[i]; ++i)
    if (std::strcmp(table[i], name) == 0) return i;
  return -1;
}

/// A checksum of whole words: a change of one word always changes it.
inline std::uint64_t checksum_of(const void* bytes, std::size_t length) {
  std::uint64_t sum = 0xcbf29ce484222325ULL;
  for (std::size_t i = 0; i < length; i += sizeof sum) {
    std::uint64_t word;
    std::memcpy(&word, static_cast<const char*>(bytes) + i, sizeof word);
    sum = (sum ^ word) * 0x100000001b3ULL;
    sum ^= sum >> 32;
  }
  return sum;
}

inline bool is_finite(double x) { return x - x == 0.0; }

inline bool all_finite(const double* numbers, std::size_t length) {
  bool finite = true;
  for (std::size_t i = 0; i < length; ++i) finite = finite && is_finite(numbers[i]);
  return finite;
}

/// Text in a caller's memory, truncated to its size.
struct Text {
  char* next;
  std::size_t left;

  Text& operator<<(const char* words) {
    for (; words && *words && left > 1; --left) *next++ = *words++;
    *next = '\0';
    return *this;
  }

  /// A nonnegative number with three digits; integers below a million with all digits.
  Text& operator<<(double number) {
    int exponent = 0;
    if (!(number <= std::numeric_limits<double>::max())) return *this << "infinity";
    if (number < 1e6 && number == static_cast<double>(static_cast<long>(number))) return write(static_cast<long>(number), 1);
    for (; number >= 9.995; number /= 10.0) ++exponent;
    for (; number < 0.9995; number *= 10.0) --exponent;
    const auto digits = static_cast<long>(100.0 * number + 0.5);
    write(digits / 100, 1) << ".";
    write(digits % 100, 2) << (exponent < 0 ? "e-" : "e");
    return write(exponent < 0 ? -exponent : exponent, 1);
  }

 private:
  Text& write(long number, int least) {
    if (number > 9 || least > 1) write(number / 10, least - 1);
    const char digit[] = {static_cast<char>('0' + number % 10), '\0'};
    return *this << digit;
  }
};

/// The meaning of a status.
inline const char* text_of_status(int status) {
  switch (status) {
    case no_simulation: return "the simulation is a null pointer, or its memory holds none";
    case no_such_index: return "an index is out of range";
    case not_started: return "the simulation has not been started";
    case not_finite: return "a number is not finite, or out of its range";
    case no_array: return "an array is a null pointer, or no snapshot of this model and version, or a damaged one";
    case time_passed: return "the time to advance to has passed";
    default: return text_of(static_cast<Cause>(status));
  }
}

/// A simulation of a `Model`, which has
/// - `Sim`, the type of the simulation, and `mark`, a number that identifies its memory,
/// - sizes of its lists: `parameters`, `inputs`, `coordinates`, `speeds`, `start_coordinates`, `start_speeds`, `outputs`,
/// - `settings`, `values` of the parameters, `roads`, `violation_limits`, and the start, `default_coordinates`, `coordinates_near` if there are some, and `default_speeds`,
/// - tables of names and places,
/// - `set_step`, which sets the length of steps and the settings that follow from it.
///
/// Calls are static, since a simulation may be a null pointer.  They return a status, and change nothing if it is negative.
template <class Model>
class CheckedSimulation {
 public:
  using Sim = typename Model::Sim;

  unsigned long long mark = Model::mark;
  Sim sim{Model::settings, Model::values, Model::roads, Model::violation_limits};
  Fault fault{};

  /// Create a simulation in memory, with the scene's start; a null pointer if the memory is too small.
  template <class Own>
  static Own* create(void* memory, std::size_t bytes) {
    constexpr std::size_t aligned = alignof(Own);
    const std::size_t skip = (aligned - reinterpret_cast<std::uintptr_t>(memory) % aligned) % aligned;
    if (!memory || bytes < skip + sizeof(Own)) return nullptr;
    auto* own = ::new (static_cast<char*>(memory) + skip) Own{};
    reset_start(own);
    return own;
  }

  static bool holds_one(const CheckedSimulation* s) { return s && s->mark == Model::mark; }
  static bool is_started(const CheckedSimulation* s) { return holds_one(s) && s->sim.is_started(); }

  static int status_of(CheckedSimulation* s, const Fault& fault) {
    s->fault = fault;
    return static_cast<int>(fault.cause);
  }

  static int set_step(CheckedSimulation* s, double dt) {
    if (!holds_one(s)) return no_simulation;
    if (!is_finite(dt) || !(dt > 0.0)) return not_finite;
    Model::set_step(s->sim.settings(), dt);
    return call_ok;
  }

  static int set_iterations(CheckedSimulation* s, int iterations) {
    if (!holds_one(s)) return no_simulation;
    if (iterations < 0 || iterations > 1000000) return not_finite;
    FixedPoint& how = s->sim.settings().fixed_point;
    how.fixed_cost = iterations > 0;
    how.iterations = iterations > 0 ? iterations : Model::settings.fixed_point.iterations;
    return call_ok;
  }

  static int set_tolerance(CheckedSimulation* s, double relative, double absolute) {
    if (!holds_one(s)) return no_simulation;
    if (!is_finite(relative) || !(relative > 0.0) || !is_finite(absolute) || !(absolute > 0.0)) return not_finite;
    s->sim.set_tolerance(relative, absolute);
    return call_ok;
  }

  static int set_max_steps(CheckedSimulation* s, long steps) {
    if (!holds_one(s)) return no_simulation;
    if (steps < 1) return not_finite;
    s->sim.settings().most_steps = steps;
    return call_ok;
  }

  static int set_equilibrium(CheckedSimulation* s, int wanted) {
    if (!holds_one(s)) return no_simulation;
    s->sim.settings().equilibrium = wanted != 0;
    return call_ok;
  }

  static int set_parameter(CheckedSimulation* s, int index, double value) {
    if (const int status = ask_index(s, index, Model::parameters, value)) return status;
    s->sim.parameters()[static_cast<std::size_t>(index)] = value;
    return call_ok;
  }

  static int set_input(CheckedSimulation* s, int index, double value, double rate, double acceleration) {
    if (const int status = ask_index(s, index, Model::inputs, value, rate, acceleration)) return status;
    s->sim.inputs().put(static_cast<std::size_t>(index), s->sim.state().t, value, rate, acceleration);
    return call_ok;
  }

  static int release_input(CheckedSimulation* s, int index) {
    if (const int status = ask_index(s, index, Model::inputs)) return status;
    s->sim.inputs().values[static_cast<std::size_t>(index)] = std::numeric_limits<double>::quiet_NaN();
    return call_ok;
  }

  static double input(CheckedSimulation* s, int index) {
    const bool known = is_started(s) && index >= 0 && index < Model::inputs;
    return known ? s->sim.get_input(static_cast<std::size_t>(index)) : std::numeric_limits<double>::quiet_NaN();
  }

  static double* inputs(CheckedSimulation* s) { return holds_one(s) ? s->sim.inputs().values.data() : nullptr; }

  static int set_start_coordinate(CheckedSimulation* s, int index, double value) {
    if (const int status = ask_index(s, index, Model::start_coordinates, value)) return status;
    s->sim.start_state().q[static_cast<std::size_t>(index)] = value;
    if (unsigned char& given = s->sim.given_coordinates()[static_cast<std::size_t>(index)]; given == not_given) given = given_as_fixed;
    return call_ok;
  }

  static int set_start_speed(CheckedSimulation* s, int index, double value) {
    if (const int status = ask_index(s, index, Model::start_speeds, value)) return status;
    s->sim.start_state().v[static_cast<std::size_t>(index)] = value;
    s->sim.given_speeds()[static_cast<std::size_t>(index)] = 1;
    return call_ok;
  }

  static int reset_start(CheckedSimulation* s) {
    if (!holds_one(s)) return no_simulation;
    s->sim.forget_start();
    if constexpr (requires { Model::coordinates_near; })
      for (const int index : Model::coordinates_near) s->sim.given_coordinates()[static_cast<std::size_t>(index)] = given_as_guess;
    for (const StartValue& start : Model::default_coordinates)
      if (start.index >= 0) set_start_coordinate(s, start.index, start.value);
    for (const StartValue& start : Model::default_speeds)
      if (start.index >= 0) set_start_speed(s, start.index, start.value);
    if constexpr (!Model::settings.equilibrium) s->sim.leave_states();
    return call_ok;
  }

  static int start(CheckedSimulation* s) {
    if (!holds_one(s)) return no_simulation;
    if constexpr (requires { typename Model::Trim; }) return status_of(s, Trimming<Model>(*s).start());
    else return status_of(s, s->sim.start());
  }

  static int step(CheckedSimulation* s) { return when_started(s, [s] { return s->sim.step(); }); }

  static int advance(CheckedSimulation* s, double time) {
    if (const int status = ask_started(s)) return status;
    if (const int status = ask_time(s, time)) return status;
    return status_of(s, s->sim.advance(time));
  }

  static int advance_to_event(CheckedSimulation* s, double time, int* event) {
    if (const int status = ask_started(s)) return status;
    if (!event) return no_array;
    if (const int status = ask_time(s, time)) return status;
    return status_of(s, s->sim.advance_to_event(time, *event));
  }

  static double next_time(CheckedSimulation* s) { return is_started(s) ? s->sim.next_time() : 0.0; }

  /// `outputs`, unless it is a null pointer, receives those at the end of each step.
  static int run(CheckedSimulation* s, long steps, double* outputs) {
    if (const int status = ask_started(s)) return status;
    for (long i = 0; i < steps; ++i) {
      if (const int status = status_of(s, s->sim.step())) return status;
      if (outputs) std::memcpy(outputs + i * Model::outputs, s->sim.report(), Model::outputs * sizeof(double));
    }
    return call_ok;
  }

  static int set_state(CheckedSimulation* s, double time, const double* coordinates, const double* speeds) {
    if (const int status = ask_started(s)) return status;
    if (!coordinates || !speeds) return no_array;
    if (!is_finite(time) || !all_finite(coordinates, Model::coordinates) || !all_finite(speeds, Model::speeds)) return not_finite;
    s->sim.skip_samples(time);
    return status_of(s, s->sim.go_to(time, coordinates, speeds));
  }

  static double next_sample(const CheckedSimulation* s) { return is_started(s) ? s->sim.next_sample() : 0.0; }

  static int take_samples(CheckedSimulation* s) { return when_started(s, [s] { return s->sim.take_samples(); }); }

  static int displace(CheckedSimulation* s, const double* displacements) {
    if (const int status = ask_started(s)) return status;
    if (!displacements) return no_array;
    if (!all_finite(displacements, Model::speeds)) return not_finite;
    return status_of(s, s->sim.displace(displacements));
  }

  static int constraint_jacobian(CheckedSimulation* s, double* jacobian) {
    if (const int status = ask_started(s)) return status;
    if (!jacobian) return no_array;
    s->sim.jacobian(jacobian);
    return call_ok;
  }

  static double constraint_violation(CheckedSimulation* s, int* equation) {
    const ConstraintViolation violation = is_started(s) ? s->sim.violation() : ConstraintViolation{};
    if (equation) *equation = violation.equation;
    return violation.size;
  }

  /// `statistics` is a record of C with the members of `StepStatistics`.
  static int last_step(CheckedSimulation* s, auto* statistics) {
    if (const int status = ask_started(s)) return status;
    if (!statistics) return no_array;
    const StepStatistics found = s->sim.statistics();
    *statistics = {found.violation, found.violation_rate, found.change, found.pivot, found.iterations, found.evaluations, found.equation};
    return call_ok;
  }

  static int set_limit(CheckedSimulation* s, int which, double limit) {
    if (const int status = ask_index(s, which, Limits::number)) return status;
    if (!(limit >= 0.0)) return not_finite;
    s->sim.limits().set(which, limit);
    return call_ok;
  }

  static double time(const CheckedSimulation* s) { return holds_one(s) ? s->sim.state().t : 0.0; }
  static const double* outputs(CheckedSimulation* s) { return is_started(s) ? s->sim.report() : nullptr; }
  static const double* coordinates(const CheckedSimulation* s) { return is_started(s) ? s->sim.state().q.data() : nullptr; }
  static const double* speeds(const CheckedSimulation* s) { return is_started(s) ? s->sim.state().v.data() : nullptr; }
  static const double* accelerations(CheckedSimulation* s) { return is_started(s) ? s->sim.complete_state().vdot.data() : nullptr; }
  static const double* multipliers(CheckedSimulation* s) { return is_started(s) ? s->sim.complete_state().lambda.data() : nullptr; }
  static const double* parameters(const CheckedSimulation* s) { return holds_one(s) ? s->sim.parameters().data() : nullptr; }

  static std::size_t snapshot_size() { return size_with<typename Sim::Memory>(); }

  static int save(const CheckedSimulation* s, void* snapshot) {
    if (const int status = ask_started(s)) return status;
    return snapshot ? write<typename Sim::Memory>([s] { return s->sim.memory(); }, snapshot) : no_array;
  }

  static int restore(CheckedSimulation* s, const void* snapshot, std::size_t bytes) {
    if (!holds_one(s)) return no_simulation;
    if (bytes != snapshot_size()) return no_array;
    return read<typename Sim::Memory>(snapshot, [s](const auto& memory) { s->sim.restore(memory); });
  }

  /// The memory of a started simulation, without mark and checksum, at a place that is aligned for it; `put_back` returns to it.
  static void keep(const CheckedSimulation* s, void* memory) { ::new (memory) typename Sim::Memory(s->sim.memory()); }
  static void put_back(CheckedSimulation* s, const void* memory) { s->sim.restore(*static_cast<const typename Sim::Memory*>(memory)); }

  /// The meaning of the last status, name and line of the failed element, and advice, in at most `bytes` bytes.
  static int failure_text(const CheckedSimulation* s, char* text, std::size_t bytes) {
    if (!text || bytes == 0) return holds_one(s) ? no_array : no_simulation;
    if (!holds_one(s)) {
      Text{text, bytes} << text_of_status(no_simulation);
      return no_simulation;
    }
    const Fault& fault = s->fault;
    Text words{text, bytes};
    words << (fault ? text_of(fault.cause) : "no start or step has failed; the status text says what a negative status means");
    const char *name = nullptr, *place = nullptr;
    const auto look_up = [&](const auto& names, const auto& places) { name = element_of(names, fault.index), place = element_of(places, fault.index); };
    switch (fault.list) {
      case FaultList::states:
      case FaultList::speeds:
        fault.at_start ? look_up(Model::start_speed_names, Model::start_speed_places) : look_up(Model::speed_names, Model::speed_places);
        break;
      case FaultList::equations:
        fault.at_start ? look_up(Model::start_equation_names, Model::start_equation_places) : look_up(Model::equation_names, Model::equation_places);
        break;
      case FaultList::guards: look_up(Model::guard_names, Model::guard_places); break;
      case FaultList::coordinates: look_up(Model::coordinate_names, Model::coordinate_places); break;
      case FaultList::indicators: look_up(Model::event_names, Model::event_locations); break;
      case FaultList::controllers:
        if constexpr (requires { Model::controller_names; }) look_up(Model::controller_names, Model::controller_places);
        break;
      case FaultList::aims:
        if constexpr (requires { typename Model::Trim; }) look_up(Model::aim_names, Model::aim_places);
        break;
      case FaultList::limits: name = element_of(limit_names, fault.index); break;
      case FaultList::none: break;
    }
    if (name) words << ": '" << name << "'";
    if (place) words << " (" << place << ")";
    if (fault.list == FaultList::limits) {
      words << " is " << fault.value << ", the limit " << fault.size;
      if (const char* joint = element_of(Model::equation_names, fault.equation)) words << ", at '" << joint << "' (" << element_of(Model::equation_places, fault.equation) << ")";
    }
    if (fault) words << "; " << advice_of(fault);
    return call_ok;
  }

 protected:
  static int ask_started(const CheckedSimulation* s) { return !holds_one(s) ? no_simulation : s->sim.is_started() ? call_ok : not_started; }

  /// The status of a call with an index below a number, and values that must be finite.
  static int ask_index(const CheckedSimulation* s, int index, int number, auto... values) {
    if (!holds_one(s)) return no_simulation;
    if (index < 0 || index >= number) return no_such_index;
    return (is_finite(values) && ...) ? call_ok : not_finite;
  }

  static int when_started(CheckedSimulation* s, auto call) {
    const int status = ask_started(s);
    return status ? status : status_of(s, call());
  }

  /// The bytes of a snapshot: mark, memory, checksum.
  template <class Memory>
  static constexpr std::size_t size_with() {
    static_assert(sizeof(Memory) % sizeof(std::uint64_t) == 0 && sizeof Model::mark == sizeof(std::uint64_t));
    return sizeof Model::mark + sizeof(Memory) + sizeof(std::uint64_t);
  }

  /// Padding is 0, so that equal states have equal snapshots: the memory is constructed in place, not copied.
  template <class Memory, class Make>
  static int write(Make make, void* snapshot) {
    static_assert(std::is_trivially_copyable_v<Memory>);
    alignas(Memory) char bytes[sizeof(Memory)] = {};
    ::new (bytes) Memory(make());
    std::memcpy(snapshot, &Model::mark, sizeof Model::mark);
    char* const behind = static_cast<char*>(snapshot) + sizeof Model::mark;
    std::memcpy(behind, bytes, sizeof bytes);
    const std::uint64_t sum = checksum_of(bytes, sizeof bytes);
    std::memcpy(behind + sizeof bytes, &sum, sizeof sum);
    return call_ok;
  }

  template <class Memory, class Take>
  static int read(const void* snapshot, Take take) {
    if (!snapshot || std::memcmp(snapshot, &Model::mark, sizeof Model::mark) != 0) return no_array;
    alignas(Memory) char bytes[sizeof(Memory)];
    std::memcpy(bytes, static_cast<const char*>(snapshot) + sizeof Model::mark, sizeof bytes);
    const std::uint64_t sum = checksum_of(bytes, sizeof bytes);
    if (std::memcmp(static_cast<const char*>(snapshot) + sizeof Model::mark + sizeof bytes, &sum, sizeof sum) != 0) return no_array;
    take(*reinterpret_cast<const Memory*>(bytes));
    return call_ok;
  }

 private:
  /// The largest number of steps of one call.
  static constexpr double most_steps = 1e9;

  static int ask_time(CheckedSimulation* s, double time) {
    if (!is_finite(time)) return not_finite;
    if (time < s->sim.state().t) return time_passed;
    return time - s->sim.state().t <= most_steps * s->sim.settings().dt ? call_ok : not_finite;
  }
};

}  // namespace cutjoint
