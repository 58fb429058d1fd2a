// The operations of interpreted programs, compiled with the flags of generated code, but no product is joined to a sum: results do not
// depend on the processor.
#include "cutjoint/interpreter/operations.hpp"

#include <cstring>

#include "cutjoint/core/numbers/functions.hpp"

namespace cutjoint::interpreter {

namespace {

/// The values of N lanes.
template <int N>
struct Values {
  typedef double type __attribute__((vector_size(N * sizeof(double))));
};

template <>
struct Values<1> {
  using type = double;
};

template <class T>
T load(const double* x) {
  T value;
  std::memcpy(&value, x, sizeof value);
  return value;
}

/// A function of all lanes at once, of the arguments i.
template <auto function, int... i>
struct AllLanes {
  template <int N>
  static void perform(const Instruction& n, double* memory, const Road<double>*) {
    const auto value = function(load<typename Values<N>::type>(memory + n.from[i])...);
    std::memcpy(memory + n.to, &value, sizeof value);
  }
};

/// A function of the C library, lane by lane.
template <auto function, int... i>
struct LaneByLane {
  template <int N>
  static void perform(const Instruction& n, double* memory, const Road<double>*) {
    for (int k = 0; k < N; ++k) memory[n.to + k] = function(memory[n.from[i] + k]...);
  }
};

/// One value in all lanes.
struct Spread {
  template <int N>
  static void perform(const Instruction& n, double* memory, const Road<double>*) {
    const double value = memory[n.from[0]];
    for (int k = 0; k < N; ++k) memory[n.to + k] = value;
  }
};

/// The sum of all lanes, of four by halves.
struct LaneSum {
  template <int N>
  static void perform(const Instruction& n, double* memory, const Road<double>*) {
    const double* const x = memory + n.from[0];
    double sum = N == 4 ? (x[0] + x[2]) + (x[1] + x[3]) : x[0];
    for (int k = 1; k < N && N != 4; ++k) sum += x[k];
    memory[n.to] = sum;
  }
};

/// What a road answers at x and y, or a derivative of it.
template <auto answer, int... by>
struct Lookup {
  template <int N>
  static void perform(const Instruction& n, double* memory, const Road<double>* roads) {
    memory[n.to] = (roads[n.from[2]].*answer)(memory[n.from[0]], memory[n.from[1]], by...);
  }
};

/// A condition as a number.
template <class T>
T number(auto condition) { return condition ? T{} + 1.0 : T{}; }

struct Entry {
  std::string_view name;
  int arguments;
  Perform perform[4];  ///< of 1, 2, 4 and 8 lanes
};

template <class O>
constexpr Entry entry(std::string_view name, int arguments, bool looks_up = false) {
  if (looks_up) return {name, arguments, {O::template perform<1>, nullptr, nullptr, nullptr}};
  return {name, arguments, {O::template perform<1>, O::template perform<2>, O::template perform<4>, O::template perform<8>}};
}

template <auto f>
constexpr Entry one(std::string_view name) { return entry<AllLanes<f, 0>>(name, 1); }
template <auto f>
constexpr Entry two(std::string_view name) { return entry<AllLanes<f, 0, 1>>(name, 2); }
template <auto f>
constexpr Entry three(std::string_view name) { return entry<AllLanes<f, 0, 1, 2>>(name, 3); }
template <auto f>
constexpr Entry four(std::string_view name) { return entry<AllLanes<f, 0, 1, 2, 3>>(name, 4); }
template <auto f>
constexpr Entry function_of_one(std::string_view name) { return entry<LaneByLane<f, 0>>(name, 1); }
template <auto f>
constexpr Entry function_of_two(std::string_view name) { return entry<LaneByLane<f, 0, 1>>(name, 2); }

constexpr Entry entries[] = {
    two<[](auto a, auto b) { return a + b; }>("add"),
    two<[](auto a, auto b) { return a - b; }>("sub"),
    two<[](auto a, auto b) { return a * b; }>("mul"),
    two<[](auto a, auto b) { return a / b; }>("div"),
    one<[](auto a) { return -a; }>("neg"),
    one<[](auto a) { return a; }>("copy"),
    three<[](auto a, auto b, auto c) { return a * b + c; }>("muladd"),
    three<[](auto a, auto b, auto c) { return a * b - c; }>("mulsub"),
    three<[](auto a, auto b, auto c) { return c - a * b; }>("submul"),
    four<[](auto a, auto b, auto c, auto d) { return a * b + c * d; }>("mulmuladd"),
    four<[](auto a, auto b, auto c, auto d) { return a * b - c * d; }>("mulmulsub"),
    two<[](auto a, auto b) { return number<decltype(a)>(a < b); }>("lt"),
    two<[](auto a, auto b) { return number<decltype(a)>(a <= b); }>("le"),
    two<[](auto a, auto b) { return a * b; }>("and"),  // of 1 and 0
    two<[](auto a, auto b) { return number<decltype(a)>(a + b != 0.0); }>("or"),
    one<[](auto a) { return 1.0 - a; }>("not"),
    three<[](auto condition, auto a, auto b) { return condition != 0.0 ? a : b; }>("where"),
    function_of_one<[](double a) { return std::abs(a); }>("abs"),
#define CUTJOINT_ENTRY(name, derivative) function_of_one<[](double a) { return std::name(a); }>(#name),
    CUTJOINT_FUNCTIONS(CUTJOINT_ENTRY)
    function_of_two<[](double a, double b) { return std::atan2(a, b); }>("atan2"),
    function_of_two<[](double a, double b) { return std::pow(a, b); }>("pow"),
    entry<Spread>("spread", 1),
    entry<LaneSum>("lane_sum", 1),
    entry<Lookup<&Road<double>::height>>("road_height", 3, true),
    entry<Lookup<&Road<double>::slope>>("road_slope", 3, true),
    entry<Lookup<&Road<double>::height_dx>>("road_height_dx", 3, true),
    entry<Lookup<&Road<double>::slope_dx>>("road_slope_dx", 3, true),
    entry<Lookup<&Road<double>::surface, 0, 0>>("road_surface", 3, true),
    entry<Lookup<&Road<double>::surface, 1, 0>>("road_surface_x", 3, true),
    entry<Lookup<&Road<double>::surface, 0, 1>>("road_surface_y", 3, true),
    entry<Lookup<&Road<double>::surface, 2, 0>>("road_surface_xx", 3, true),
    entry<Lookup<&Road<double>::surface, 1, 1>>("road_surface_xy", 3, true),
    entry<Lookup<&Road<double>::surface, 0, 2>>("road_surface_yy", 3, true),
    entry<Lookup<&Road<double>::friction, 0, 0>>("road_friction", 3, true),
    entry<Lookup<&Road<double>::friction, 1, 0>>("road_friction_x", 3, true),
    entry<Lookup<&Road<double>::friction, 0, 1>>("road_friction_y", 3, true),
};

}  // namespace

Operation find_operation(std::string_view name, int lanes) {
  for (const Entry& e : entries)
    if (e.name == name)
      for (int i = 0; i < 4; ++i)
        if (1 << i == lanes) return {e.perform[i], e.arguments};
  return {};
}

}  // namespace cutjoint::interpreter
