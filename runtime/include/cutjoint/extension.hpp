// Additions of other packages to a driver: constants of the type `Added`, in a header that is included before the driver's own file.
#pragma once

#include <initializer_list>
#include <map>

#include "cutjoint/json.hpp"
#include "cutjoint/any_mechanism.hpp"
#include "cutjoint/settings.hpp"

namespace cutjoint {

/// Integrators of mechanisms or systems: their names in run files, and the runs by them (run.hpp, `run_by`).
template <class Subject>
using Integrators = std::map<std::string, Json (*)(AnyMechanism<double>& start, Subject& subject, const RunSettings& settings, const Json& file)>;

/// The integrators that are added to a driver.
template <class Subject>
Integrators<Subject>& added_integrators() {
  static Integrators<Subject> all;
  return all;
}

/// Whether an integrator is among them.
template <class Subject>
bool is_added(const std::string& name) { return added_integrators<Subject>().contains(name); }

/// Adds to integrators, or to the solvers of `library_solvers`, before the program begins.
struct Added {
  template <class All>
  Added(All& all, std::initializer_list<typename All::value_type> more) {
    for (const auto& one : more) all.insert(all.end(), one);
  }
};

}  // namespace cutjoint
