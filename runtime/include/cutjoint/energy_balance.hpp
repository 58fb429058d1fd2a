// The balance of work and energy of a run: a check independent of the integrator.
#pragma once

#include <array>
#include <chrono>
#include <cstdio>
#include <optional>

#include "cutjoint/core/mechanism/retraction.hpp"
#include "cutjoint/state.hpp"

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

/// Adds the seconds of its lifetime to a number.
class Stopwatch {
 public:
  explicit Stopwatch(double& seconds) : seconds_(seconds) {}
  Stopwatch(const Stopwatch&) = delete;
  Stopwatch& operator=(const Stopwatch&) = delete;
  ~Stopwatch() { seconds_ += std::chrono::duration<double>(std::chrono::steady_clock::now() - begin_).count(); }

 private:
  double& seconds_;
  std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();
};

/// Integrates the power of all forces, guides and drives of a mechanism or system over the steps of a run, by three-point Gauss quadrature.
template <class Subject>
class EnergyBalance {
 public:
  using Real = typename Subject::real_type;

  /// Begin at a start.
  EnergyBalance(Subject& subject, const State<Real>& start)
      : subject_(subject), charts_(subject.description().charts), joints_(start.v.size() - subject.description().states), last_(start), between_(start), shift_(start.v), rate_(start.v), delta_(start.v),
        speeds_(start.v), book_(start.t, measure(start)[0]) {}

  /// Add a step; `between` interpolates a state at a time within it.  Accelerations and multipliers, which matter to guides, are interpolated
  /// linearly unless it sets them too.  A step of zero length, as after an impact, does no work.  Leaves the subject at the
  /// end's time.  Throws Failure if the motion diverges.
  void add(const State<Real>& end, auto between) {
    using std::abs, std::sqrt;
    const Real h = end.t - last_.t;
    if (!(h > Real(0))) {
      last_ = end;
      subject_.begin_step(end.t, Real(1));
      return;
    }
    const Real aside = sqrt(Real(15)) / 10;
    const std::array<Real, 3> places{Real(0.5) - aside, Real(0.5), Real(0.5) + aside}, weights{Real(5) / 18, Real(8) / 18, Real(5) / 18};
    Real work(0), exchanged(0);
    for (std::size_t i = 0; i < places.size(); ++i) {
      between_.t = last_.t + places[i] * h;
      if (subject_.description().driven) blend(end, places[i]);
      between(between_.t, between_);
      const Real power = measure(between_)[1];
      work += weights[i] * h * power;
      exchanged += weights[i] * h * abs(power);
    }
    book_.add(end.t, measure(end)[0], work, exchanged, fastest(end));
    last_ = end;
    if (book_.runs_away()) give_up(end);
  }

  /// Add a step with cubic coordinates between its ends.
  void add(const State<Real>& end) {
    if (end.t > last_.t) join(end);
    add(end, [&](Real t, State<Real>& state) { follow(end, (t - last_.t) / (end.t - last_.t), state); });
  }

  /// Add an impact of guides: the state after it, and the `work` (J) of their impulses.
  void strike(const State<Real>& after, Real work) {
    book_.strike(work);
    last_ = after;
  }

  /// Measures the time of these checks, to exclude it from that of steps.
  Stopwatch time() { return Stopwatch(seconds_); }

  double seconds() const { return seconds_; }

  /// The time from which results of a failed run are invalid, if energy was created.
  std::optional<double> doubtful_since() const { return book_.doubtful_since(); }

  /// The time up to which results remain valid.
  double settled() const { return book_.settled(); }

  void summarise(Json& summary) const { book_.summarise(summary); }

 private:
  /// Kinetic energy and power.
  std::array<Real, 2> measure(const State<Real>& state) {
    std::array<Real, 2> energy{};
    subject_.begin_step(state.t, Real(1));
    if constexpr (requires { subject_.energy(nullptr, nullptr, nullptr, nullptr, nullptr); })
      subject_.energy(state.q.data(), state.v.data(), state.vdot.data(), state.lambda.data(), energy.data());
    else throw_no_energy();
    return energy;
  }

  void blend(const State<Real>& end, Real s) {
    for (std::size_t i = 0; i < end.vdot.size(); ++i) between_.vdot[i] = last_.vdot[i] + s * (end.vdot[i] - last_.vdot[i]);
    for (std::size_t i = 0; i < end.lambda.size(); ++i) between_.lambda[i] = last_.lambda[i] + s * (end.lambda[i] - last_.lambda[i]);
  }

  /// The displacement from the last state to another in the chart of the former, and its rate there.
  void join(const State<Real>& end) {
    rate_ = end.v;
    for (std::size_t i = 0; charts_.empty() && i < joints_; ++i) shift_[i] = end.q[i] - last_.q[i];
    displacement<Real>(charts_, last_.q.data(), end.q.data(), shift_.data());
    chart_rates<Real>(charts_, shift_.data(), end.v.data(), rate_.data());
  }

  /// The state at the fraction s of the step; first-order states by a cubic too.
  void follow(const State<Real>& end, Real s, State<Real>& state) {
    const Real h = end.t - last_.t, left = 1 - s;
    for (std::size_t i = 0; i < joints_; ++i) {
      delta_[i] = s * s * (1 + 2 * left) * shift_[i] + h * s * left * (left * last_.v[i] - s * rate_[i]);
      state.v[i] = 6 * s * left * shift_[i] / h + left * (1 - 3 * s) * last_.v[i] + s * (3 * s - 2) * rate_[i];
    }
    for (std::size_t i = joints_; i < state.v.size(); ++i)
      state.v[i] = last_.v[i] + s * s * (1 + 2 * left) * (end.v[i] - last_.v[i]) + h * s * left * (left * last_.vdot[i] - s * end.vdot[i]);
    displace(charts_, last_.q, delta_.data(), state.q);
    speeds_ = state.v;
    chart_speeds<Real>(charts_, delta_.data(), speeds_.data(), state.v.data());
  }

  std::size_t index_of_fastest(const State<Real>& state) const {
    using std::abs;
    std::size_t found = 0;
    for (std::size_t i = 0; i < joints_; ++i)
      if (!(abs(state.v[i]) <= abs(state.v[found]))) found = i;
    return found;
  }

  Real fastest(const State<Real>& state) const {
    using std::abs;
    return joints_ == 0 ? Real(0) : abs(state.v[index_of_fastest(state)]);
  }

  [[noreturn]] void give_up(const State<Real>& end) const {
    const std::size_t i = index_of_fastest(end);
    const char* const name = speeds_of(subject_.description())[i];
    char since[32];
    std::snprintf(since, sizeof since, "%.6g", doubtful_since().value_or(0.0));
    throw Failure("the motion runs away: since t = " + std::string(since) + " s its energy comes from no force, guide or drive",
                  static_cast<double>(end.t), 0, std::string(name), static_cast<double>(end.v[i]),
                  "a force may feed the motion, or change faster than steps follow; try: a smaller dt or tolerance");
  }

  Subject& subject_;
  const List<Chart>& charts_;
  std::size_t joints_;  ///< speeds, before first-order states
  State<Real> last_, between_;
  std::vector<Real> shift_, rate_, delta_, speeds_;
  EnergyBook<Real> book_;
  double seconds_ = 0.0;
};

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
