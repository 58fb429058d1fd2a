// Descriptions of mechanisms and systems: constants of generated code.  This includes no header of the standard library, which takes longer to
// compile than they do.
#pragma once

#include "cutjoint/core/mechanism/chart.hpp"

namespace cutjoint {

/// The Lagrangian methods of Cuadrado et al. 2000 in natural coordinates, augmented (section 2.1) and classical (section 2.2), and the former in
/// the relative coordinates of the recursion.
enum class Lagrangian { augmented, classical, recursive_newton };

/// A name with its unit and default value; what it names depends on the list that it stands in.
struct Named {
  const char* name = "";
  const char* unit = "";
  double value = 0.0;
};

/// A force that was left out of the model because it does not act, or with `ends` a joint whose loops functions close on a range; and the line of
/// the model's file where it stands.
struct Guard {
  const char* force;
  const char* place;
  bool ends = false, left_out = false;
};

/// A value at whose change of sign a force, a guide or a drive goes over to another formula, or a tyre at a break of its road; the element that it
/// belongs to, and the line of the model's file.
struct EventIndicator {
  const char* element;
  const char* place;
  int road = -1;
  int across = -1;
};

/// A function of an element's law that has a value in its domain alone, and the line of the model's file.  Its margin is not negative there,
/// or positive if it is strict.  That of a load of friction has as its remedy the place among the margins of a factor, below which all coefficients
/// of friction leave the loads of joints values.
struct Domain {
  const char* what;
  const char* element;
  const char* place;
  bool strict;
  int remedy = -1;
};

/// What holds values between samples: its name, the line of the model's file, and the times.
struct Controller {
  const char* name;
  const char* place;
  SampleTimes times;
};

using Size = decltype(sizeof 0);

/// The arrays that programs have copied: they can be reached until the end, so that no check of memory takes them for lost.
struct Copied {
  const void* values;
  const Copied* before;
};
inline const Copied* copied = nullptr;

/// The values of an array that lasts as long as the program.
template <class Value>
struct List {
  using value_type = Value;

  const Value* first = nullptr;
  Size length = 0;

  constexpr List() = default;
  template <int number>
  constexpr List(const Value (&values)[number]) : first(values), length(number) {}

  /// A copy of values that are known when the program runs.
  template <class Values>
    requires requires(const Values& values) { values.data(), values.size(); }
  List(const Values& values) : length(values.size()) {
    Value* const copy = new Value[length];
    for (Size i = 0; i < length; ++i) copy[i] = values[i];
    first = copy;
    copied = new Copied{copy, copied};
  }

  constexpr const Value* begin() const { return first; }
  constexpr const Value* end() const { return first + length; }
  constexpr const Value* data() const { return first; }
  constexpr Size size() const { return length; }
  constexpr bool empty() const { return length == 0; }
  constexpr const Value& operator[](Size i) const { return first[i]; }
  constexpr const Value& front() const { return first[0]; }
};

/// Everything about a mechanism that does not change in a run.
struct Description {
  const char* name = "";
  List<Chart> charts{};
  List<const char*> coordinates{};    ///< names of q
  List<const char*> speeds{};         ///< names of v, first-order states last
  List<const char*> equations{};      ///< names of the cut joints' equations
  List<Named> parameters{};           ///< tunable parameters with defaults, SI units
  List<const char*> roads{};          ///< tyres, each with a road of its own
  List<Named> columns{};              ///< reported quantities
  List<int> cuts{};                   ///< first equation of each cut joint
  List<Named> inputs{};               ///< inputs with the model's values, SI units
  List<Guard> guards{};               ///< forces that must not act
  List<Domain> domains{};             ///< where laws may have no value
  List<EventIndicator> indicators{};  ///< where formulas change
  List<Controller> controllers{};     ///< what holds values between samples
  List<double> nominals{};            ///< usual sizes of the first-order states, after those of accelerations where `arm` is not 1, none where all are 1
  double arm = 1.0;                   ///< a length (m) near the mechanism's, 1 for ordinary ones
  Size states = 0;           ///< number of the first-order states
  bool driven = false;                ///< whether guides have power, which takes accelerations and multipliers
  bool guides_jump = false;           ///< whether the rates of guides may jump

  /// How many values controllers hold.
  Size discrete() const {
    Size number = 0;
    for (const Controller& controller : controllers) number += static_cast<unsigned long>(controller.times.discrete);
    return number;
  }
};

/// The places of the entries of a square sparse matrix: compressed columns, rows ascending.  Of a symmetric matrix the lower triangle.
struct Pattern {
  int size = 0;
  bool symmetric = false;
  List<int> first{};  ///< size + 1 offsets: column j has the entries first[j] .. first[j + 1] - 1
  List<int> row{};    ///< the row of each entry
};

/// Everything about a system that does not change in a run: n coordinates, m equations.  Natural coordinates are the integrals of their own speeds and
/// have no charts; relative ones have the names of their speeds.
struct SystemDescription : Description {
  Lagrangian method = Lagrangian::augmented;
  Pattern pattern{};  ///< of the tangent: n and symmetric (augmented) or n + m and whole (classical)
  int factors = 0;    ///< length of the array that `factor` fills

  /// Names of v, vdot and the force residual.
  const List<const char*>& unknowns() const { return speeds.empty() ? coordinates : speeds; }
};

/// The name of a method, as its failures have it.
constexpr const char* name_of(Lagrangian method) {
  return method == Lagrangian::augmented ? "augmented" : method == Lagrangian::classical ? "classical" : "recursive-newton";
}

}  // namespace cutjoint
