// Descriptions from the constants of generated code.
#include "cutjoint/constants.hpp"

#include "cutjoint/lagrangian/system.hpp"

namespace cutjoint {

namespace {

/// A list as a vector of what the description has.
template <class To, class Value>
void take(std::vector<To>& taken, const constants::List<Value>& values, auto&& made) {
  taken.reserve(static_cast<std::size_t>(values.length));
  for (const Value& value : values) taken.push_back(made(value));
}

template <class Value>
void take(std::vector<Value>& taken, const constants::List<Value>& values) {
  taken.assign(values.begin(), values.end());
}

void take(std::vector<std::string_view>& taken, const constants::List<const char*>& values) { taken.assign(values.begin(), values.end()); }

void take(std::vector<Named>& taken, const constants::List<constants::Named>& values) {
  take(taken, values, [](const constants::Named& x) { return Named{.name = x.name, .unit = x.unit, .value = x.value}; });
}

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
  take(d.guards, mechanism.guards, [](const constants::Guard& x) { return Guard{.force = x.force, .place = x.place, .ends = x.ends, .left_out = x.left_out}; });
  take(d.domains, mechanism.domains,
       [](const constants::Domain& x) { return Domain{.what = x.what, .element = x.element, .place = x.place, .strict = x.strict, .remedy = x.remedy}; });
  take(d.indicators, mechanism.indicators,
       [](const constants::EventIndicator& x) { return EventIndicator{.element = x.element, .place = x.place, .road = x.road, .across = x.across}; });
  take(d.nominals, mechanism.nominals, [](double x) { return x; });
  d.arm = mechanism.arm;
  take(d.controllers, mechanism.controllers, [](const constants::Controller& x) { return Controller{.name = x.name, .place = x.place, .times = x.times}; });
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
