// A failure in the summary of a run.
#pragma once

#include "cutjoint/json.hpp"
#include "cutjoint/state.hpp"

namespace cutjoint {

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
