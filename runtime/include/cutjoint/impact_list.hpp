// The impacts of a run.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "cutjoint/energy_balance.hpp"
#include "cutjoint/json.hpp"

namespace cutjoint {

/// The impacts in a run's summary and in its balance of work and energy.
template <class Subject>
class ImpactList {
 public:
  using Real = typename Subject::real_type;

  ImpactList(const Subject& subject, std::optional<EnergyBalance<Subject>>& energy) : subject_(subject), energy_(energy) {}

  /// Add an impact of an indicator's guide, with its work.
  void leave(const State<Real>& state, Real work, std::size_t which) {
    if (energy_) energy_->strike(state, work);
    found_.push_back({static_cast<double>(state.t), static_cast<double>(work), std::string(element_of(which))});
  }

  void summarise(Json& summary) const {
    if (found_.empty()) return;
    Json list = Json::array();
    for (const Found& each : found_) list.push_back({{"time", each.time}, {"element", each.element}, {"work", number_or_null(each.work)}});
    summary["impacts"] = std::move(list);
  }

 private:
  struct Found {
    double time, work;
    std::string element;
  };

  std::string_view element_of(std::size_t which) const {
    const auto& indicators = subject_.description().indicators;
    return which < indicators.size() ? indicators[which].element : std::string_view();
  }

  const Subject& subject_;
  std::optional<EnergyBalance<Subject>>& energy_;
  std::vector<Found> found_;
};

}  // namespace cutjoint
