// Samples so close to a jump of a column that another run may have them on its other side.
#pragma once

#include "cutjoint/core/mechanism/retraction.hpp"
#include "cutjoint/state.hpp"

namespace cutjoint {

/// Reports the columns of a subject at a state extrapolated in time by its velocities and accelerations.  Accelerations, multipliers and
/// functions of time alone are constant: this shows jumps of columns that depend on coordinates and velocities.
template <class Subject>
void report_moved(Subject& subject, const State<typename Subject::real_type>& state, typename Subject::real_type time,
                  typename Subject::real_type* column) {
  using Real = typename Subject::real_type;
  std::vector<Real> q = state.q, v = state.v, shift = state.v;
  for (std::size_t i = 0; i < v.size(); ++i) {
    shift[i] = time * state.v[i];
    v[i] += time * state.vdot[i];
  }
  displace(subject.description().charts, state.q, shift.data(), q);
  subject.report(q.data(), v.data(), state.vdot.data(), state.lambda.data(), column);
}

/// Finds the columns that jump near a sample.
template <class Real>
class NearJumps {
 public:
  /// Looks for jumps at most `within` (s) before or after a sample.
  NearJumps(double within, std::size_t columns) : within_(within), before_(columns), after_(columns), probe_(columns) {}

  /// Check a sample at time t with values `here`; `report` gives those at a time after it, or before it if negative.
  void look(Real t, const std::vector<Real>& here, auto report) {
    using std::abs;
    report(-within_, before_.data());
    report(within_, after_.data());
    for (std::size_t i = 0; i < here.size(); ++i) {
      const Real before = abs(before_[i] - here[i]), after = abs(after_[i] - here[i]);
      if (std::max(before, after) > std::max(2 * std::min(before, after), Real(rounding) * abs(here[i])))
        find(t, i, here[i], after > before ? within_ : -within_, std::max(before, after), report);
    }
  }

  void summarise(Json& summary, const List<Named>& columns) const {
    Json found = Json::array();
    for (const Found& each : found_)
      found.push_back(Json{{"time", each.time}, {"column", columns[each.column].name}, {"after", each.after}, {"size", each.size}});
    if (!found_.empty()) summary["near_jumps"] = found;
  }

 private:
  static constexpr double rounding = 1e-8;
  static constexpr int halvings = 24;

  struct Found {
    double time;
    std::size_t column;
    double after, size;
  };

  /// Whether a column that differs by `change` at an `end` jumps before it, and where.  The difference of a continuous column decreases with the distance.
  void find(Real t, std::size_t column, Real here, Real end, Real change, auto report) {
    using std::abs;
    Real near(0), far = end, at_near = here, at_far = here;
    for (int i = 0; i < halvings; ++i) {
      const Real middle = (near + far) / 2;
      report(middle, probe_.data());
      const bool is_far = abs(probe_[column] - here) > change / 2;
      (is_far ? far : near) = middle;
      (is_far ? at_far : at_near) = probe_[column];
    }
    if (far == end) return;
    const Real size = abs(at_far - at_near);
    if (size > change / 2) found_.push_back({static_cast<double>(t), column, static_cast<double>(far), static_cast<double>(size)});
  }

  Real within_;
  std::vector<Real> before_, after_, probe_;
  std::vector<Found> found_;
};

}  // namespace cutjoint
