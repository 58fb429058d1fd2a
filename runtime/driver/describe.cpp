// Descriptions from the constants of generated code.

#include "cutjoint/lagrangian/system.hpp"

namespace cutjoint {

namespace {

/// A list as a vector of what the description has.
template <class To, class Value>
void take(std::vector<To>& taken, const constants::List<Value>& values) { taken.assign(values.begin(), values.end()); }

void fill(Description& d, const constants::Mechanism& mechanism) {
  d.name = mechanism.name;
  take(d.charts, mechanism.charts);
  take(d.coordinates, mechanism.coordinates);
  take(d.speeds, mechanism.speeds);
  take(d.equations, mechanism.equations);
  take(d.parameters, mechanism.parameters);
  take(d.roads, mechanism.roads);
  take(d.columns, mechanism.columns);
  take(d.cuts, mechanism.cuts);
  take(d.inputs, mechanism.inputs);
  take(d.guards, mechanism.guards);
  take(d.domains, mechanism.domains);
  take(d.indicators, mechanism.indicators);
  take(d.nominals, mechanism.nominals);
  d.arm = mechanism.arm;
  take(d.controllers, mechanism.controllers);
  d.states = static_cast<std::size_t>(mechanism.states);
  d.driven = mechanism.driven;
  d.guides_jump = mechanism.guides_jump;
}

}  // namespace

const Description& describe(const constants::Mechanism& mechanism) {
  auto* d = new Description();
  fill(*d, mechanism);
  return *d;
}

const SystemDescription& describe(const constants::System& system) {
  auto* d = new SystemDescription();
  fill(*d, system.mechanism);
  d->method = system.method;
  d->pattern = {.size = system.size, .symmetric = system.symmetric, .first = {}, .row = {}};
  take(d->pattern.first, system.first);
  take(d->pattern.row, system.row);
  d->factors = system.factors;
  return *d;
}

}  // namespace cutjoint
