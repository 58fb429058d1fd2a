// Descriptions as generated code has them, constants, and what they list.  This includes no header of the standard library, which takes longer to
// compile than they do.
#pragma once

#include "cutjoint/core/mechanism/chart.hpp"

namespace cutjoint {

struct Description;
struct SystemDescription;

/// The Lagrangian methods of Cuadrado et al. 2000 in natural coordinates, augmented (section 2.1) and classical (section 2.2), and the former in
/// the relative coordinates of the recursion.
enum class Lagrangian { augmented, classical, recursive_newton };

/// A name with its unit and default value; what it names depends on the list that it stands in.
struct Named {
  const char* name;
  const char* unit;
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

namespace constants {

/// The values of an array that lasts.
template <class Value>
struct List {
  const Value* first = nullptr;
  int length = 0;

  constexpr List() = default;
  template <int number>
  constexpr List(const Value (&values)[number]) : first(values), length(number) {}

  const Value* begin() const { return first; }
  const Value* end() const { return first + length; }
};

/// A mechanism (`Description` of mechanism.hpp).
struct Mechanism {
  const char* name;
  List<Chart> charts{};
  List<const char*> coordinates{};
  List<const char*> speeds{};
  List<const char*> equations{};
  List<Named> parameters{};
  List<const char*> roads{};
  List<Named> columns{};
  List<int> cuts{};
  List<Named> inputs{};
  List<Guard> guards{};
  List<Domain> domains{};
  List<EventIndicator> indicators{};
  List<Controller> controllers{};
  List<double> nominals{};
  double arm = 1.0;
  int states = 0;
  bool driven = false;
  bool guides_jump = false;
};

/// A system (`SystemDescription` of lagrangian/system.hpp).
struct System {
  Mechanism mechanism;
  Lagrangian method;
  int size;
  bool symmetric;
  List<int> first{};
  List<int> row{};
  int factors;
};

}  // namespace constants

/// The description, which stays until the program ends.
const Description& describe(const constants::Mechanism& mechanism);
const SystemDescription& describe(const constants::System& system);

}  // namespace cutjoint
