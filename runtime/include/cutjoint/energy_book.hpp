// The energy of a run by steps, and whether it is created numerically.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>

#include "cutjoint/json.hpp"

namespace cutjoint {

/// Keeps the defect D = T - T_0 - W of the kinetic energy T and the work W done since the start, and the largest values of a run.
///
/// The energy known at a time is the largest T up to then and all that forces have exchanged.  A motion gains a level where T is `growth` times
/// what was known at most `memory` steps before and more than half of it is defect.  It runs away with the level `most`, each gained within
/// `memory` steps of the one before, or with an overwhelming one in a motion.  A coarse step over an impact, or from rest, may gain one level, but not one on
/// top of another.  What moves more slowly than about ten times `slow` (m/s, rad/s) gains none: near rest, T and D are rounding.
template <class Real>
class EnergyBook {
 public:
  /// Begin at a time with a kinetic energy.
  EnergyBook(Real t, Real kinetic) : start_(kinetic), largest_(kinetic) { entry(count_++) = {t, kinetic, Real(0)}; }

  /// Add a step that ends at t: kinetic energy, `work` done, energy `exchanged`, and the largest velocity `fastest`.
  void add(Real t, Real kinetic, Real work, Real exchanged, Real fastest) {
    using std::abs;
    work_ += work;
    exchanged_ += exchanged;
    largest_ = std::max(largest_, kinetic);
    defect_ = kinetic - start_ - work_;
    if (!(abs(defect_) <= worst_)) worst_ = abs(defect_);
    if (fastest > Real(0)) of_unit_speed_ = std::max(of_unit_speed_, kinetic / fastest / fastest);
    const Real share = Real(slow) / fastest;
    if (!(fastest <= Real(slow))) look(kinetic, kinetic * share * share);
    if (count_ > memory) levels_ = 0;
    entry(count_++) = {t, largest_ + exchanged_, defect_};
  }

  /// Add the `work` of impulses.
  void strike(Real work) {
    using std::abs;
    work_ += work;
    exchanged_ += abs(work);
  }

  bool runs_away() const { return levels_ >= most; }

  /// The time before the first level, if the motion diverges now.
  std::optional<double> doubtful_since() const {
    if (levels_ < 2) return std::nullopt;
    return static_cast<double>(since_);
  }

  /// The time before which no level can begin.
  double settled() const { return static_cast<double>(levels_ > 0 ? since_ : entries_[count_ > memory ? count_ % entries_.size() : 0].t); }

  void summarise(Json& summary) const {
    summary["energy"] = Json{{"kinetic", number_or_null(static_cast<double>(largest_))},
                             {"exchanged", number_or_null(static_cast<double>(exchanged_))},
                             {"defect", number_or_null(static_cast<double>(worst_))},
                             {"of_unit_speed", number_or_null(static_cast<double>(of_unit_speed_))}};
  }

 private:
  static constexpr double growth = 100, overwhelming = 1e12, slow = 1e-3;
  static constexpr int most = 3;
  static constexpr std::size_t memory = 1000;

  struct Entry {
    Real t{0}, known{0}, defect{0};
  };

  Entry& entry(std::size_t i) { return entries_[i % entries_.size()]; }

  /// Check whether the present energy is far above the known one, taken as at least `least`, and created numerically.
  void look(Real kinetic, Real least) {
    using std::abs;
    const Entry& oldest = entry(count_ > memory ? count_ : 0);
    if (count_ == 0 || kinetic < Real(growth) * std::max(oldest.known, least)) return;
    for (std::size_t back = 1; back <= std::min(count_, entries_.size()); ++back) {
      const Entry& then = entry(count_ - back);
      const Real known = std::max(then.known, least);
      if (kinetic < Real(growth) * known) continue;
      if (abs(defect_ - then.defect) <= kinetic / 2) {
        levels_ = 0;
        return;
      }
      if (levels_ == 0) since_ = then.t;
      const bool from_rest = then.known < least;
      levels_ = from_rest || kinetic < Real(overwhelming) * known ? levels_ + 1 : most;
      count_ = 0;
      return;
    }
  }

  Real start_, largest_, work_{0}, exchanged_{0}, defect_{0}, worst_{0}, of_unit_speed_{0}, since_{0};
  int levels_ = 0;
  std::size_t count_ = 0;  ///< of entries since the last level
  std::array<Entry, memory> entries_{};
};

}  // namespace cutjoint
