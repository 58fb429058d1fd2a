// Additions of other packages to a driver: constants of these types, in a header that is included before the driver's own file.
#pragma once

#include <initializer_list>
#include <stdexcept>
#include <string_view>
#include <vector>

#include "cutjoint/json.hpp"
#include "cutjoint/mechanism.hpp"
#include "cutjoint/settings.hpp"

namespace cutjoint {

/// An integrator of mechanisms or systems: its name in run files, and the run by it (run.hpp, `run_by`).
template <class Subject>
struct AddedIntegrator {
  std::string_view name;
  Json (*run)(AnyMechanism<double>& start, Subject& subject, const RunSettings& settings, const Json& file);
};

/// The added integrators of a driver.
template <class Subject>
std::vector<AddedIntegrator<Subject>>& added_integrators() {
  static std::vector<AddedIntegrator<Subject>> all;
  return all;
}

/// The names of the added integrators of a driver.
template <class Subject>
std::vector<std::string_view> added_names() {
  std::vector<std::string_view> names;
  for (const AddedIntegrator<Subject>& added : added_integrators<Subject>()) names.push_back(added.name);
  return names;
}

/// The run of a file with an added integrator.
template <class Subject>
Json run_added(AnyMechanism<double>& start, Subject& subject, const RunSettings& settings, const Json& file) {
  for (const AddedIntegrator<Subject>& added : added_integrators<Subject>())
    if (file.at("integrator") == added.name) return added.run(start, subject, settings, file);
  throw std::logic_error("no extension adds this integrator");
}

/// Appends to a list before the program begins.
struct Added {
  template <class Record>
  Added(std::vector<Record>& list, std::initializer_list<Record> more) {
    list.insert(list.end(), more);
  }
};

}  // namespace cutjoint
