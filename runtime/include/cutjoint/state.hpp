// Failures of runs, and the states of mechanisms.
#pragma once

#include "cutjoint/core/simulation/fault.hpp"
#include "cutjoint/core/mechanism/state.hpp"
#include "cutjoint/any_mechanism.hpp"
#include "cutjoint/json.hpp"

namespace cutjoint {

/// A numerical failure with all that a user needs to find its cause.
struct Failure : std::runtime_error {
  double time;
  long step;
  std::string element;  ///< the coordinate or equation with the worst residual
  double residual;
  std::string advice;
  std::vector<std::string> guards{};  ///< forces left out of the model that would act

  Failure(const std::string& what, double time_, long step_, std::string element_, double residual_, std::string advice_)
      : std::runtime_error(what), time(time_), step(step_), element(std::move(element_)), residual(residual_), advice(std::move(advice_)) {}
};

/// The names of the velocities of a mechanism, or of a system's unknowns.
const List<const char*>& speeds_of(const auto& d) {
  if constexpr (requires { d.unknowns(); }) return d.unknowns();
  else return d.speeds;
}

/// A fault of a core with the name of the failed element, and optionally of the method.
Failure failure_of(const Fault& fault, const auto& d, std::string_view method = "") {
  std::string what = method.empty() ? "" : std::string(method) + ": ";
  what += text_of(fault.cause);
  if (fault.cause == Cause::not_converged || fault.cause == Cause::newton_not_converged) what += " in " + std::to_string(fault.iterations) + " iterations";
  const auto index = static_cast<std::size_t>(fault.index);
  if (fault.list == FaultList::indicators)
    what.replace(0, std::string("a force").size(), "'" + std::string(d.indicators[index].element) + "' (" + std::string(d.indicators[index].place) + ")");
  if (fault.list == FaultList::controllers)
    what.replace(0, std::string("a controller").size(), "the controller '" + std::string(d.controllers[index].name) + "' (" + std::string(d.controllers[index].place) + ")");
  const bool is_speed = fault.list == FaultList::speeds || fault.list == FaultList::states;
  const std::string name(is_speed                                ? speeds_of(d)[index]
                         : fault.list == FaultList::coordinates ? d.coordinates[index]
                         : fault.list == FaultList::equations   ? d.equations[index]
                         : fault.list == FaultList::indicators    ? d.indicators[index].element
                         : fault.list == FaultList::controllers ? d.controllers[index].name
                                                                : "");
  return Failure(what, fault.t, fault.step, name, fault.value, advice_of(fault));
}

/// Throws Failure if there is a fault.
void require_none(const Fault& fault, const auto& d, std::string_view method = "") {
  if (fault) throw failure_of(fault, d, method);
}

/// Put a failure into a summary.
inline void report(const Failure& failure, Json& summary) {
  summary["status"] = "failed";
  summary["message"] = failure.what();
  summary["time"] = number_or_null(failure.time);
  summary["step"] = failure.step;
  summary["element"] = failure.element;
  summary["residual"] = number_or_null(failure.residual);
  summary["advice"] = failure.advice;
  if (!failure.guards.empty()) summary["guards"] = failure.guards;
}

}  // namespace cutjoint
