// The driver: a run file (JSON) in, a table (CSV, doubles) and a summary (JSON) out.
#pragma once

#include <deque>

#include "cutjoint/initial_state.hpp"
#include "cutjoint/near_jumps.hpp"
#include "cutjoint/pace.hpp"
#include "cutjoint/read_settings.hpp"
#include "cutjoint/stop.hpp"

namespace cutjoint {

/// Runs one mechanism as requested by a run file: it starts in relative coordinates, and the method continues from there.
///
/// A method has
///
/// - `columns` and `report`, the names and values of what it reports, and `time`,
/// - if jumps near samples can be detected, `report_moved`, the values at a time after the last report, or before it,
/// - `coordinates` and `position`, the names and values of its coordinates at the last report,
/// - `begin`, which takes over a start with the penalties of its cut joints, `prepare`, which prepares for steps, and `step` with the step's number; they throw Failure,
///   and `step` throws Stopped if a stop is requested within it,
/// - if other code may continue a run, `keep`, which saves its state, and `kept`, that state for a run file,
/// - `step_columns` and `measure_step`, iterations and residuals of the last step,
/// - `summarise`, which adds statistics of the steps to a summary,
/// - `explain`, which adds the known cause to a failure of a step,
/// - if it can balance work and energy, `energy`, the balance if requested,
/// - if available, `state`, that of its last step,
/// - if it iterates to a fixed point, `differentiate`, the Jacobians of its accelerations at the last state.
template <Mechanism M, class Method>
class Run {
 public:
  using Real = typename Method::Real;

  Run(M& mechanism, Method& method, const RunSettings& settings, const Json& file)
      : initial_state_(mechanism, settings, file), method_(method), settings_(settings), file_(file) {}

  /// Do the run's task and return its summary.  A Failure or a request to stop is part of the summary, and the table has the rows up to then.
  /// Throws if a file cannot be written.
  Json perform() {
    Json summary;
    try {
      summary = do_task(settings_.task);
      summary["status"] = stopped_ ? "interrupted" : "done";
      if (stopped_) summary["time"] = number_or_null(static_cast<double>(method_.time()));
      if constexpr (requires { method_.state(); })
        if (file_.value("with_state", false)) summary["state"] = method_.state();
    } catch (const Failure& failure) {
      summary = counts();
      report(begun_ ? explain(failure) : initial_state_.explain(failure), summary);
      if constexpr (requires { method_.kept(); })
        if (!failure.guards.empty() && !doubtful_since()) summary["kept"] = method_.kept();
    }
    if (begun_ && !goes_on()) summary["start"] = initial_state_.found();
    if (table_) summary["rows"] = table_->rows();
    if (table_) summary["bytes"] = table_->end().bytes;
    for (auto* table : {&steps_table_, &coordinates_, &table_})  // the run's is the last: when its lock is released, the others are complete
      if (*table) (*table)->close();
    return summary;
  }

 private:
  Failure explain(const Failure& failure) {
    if constexpr (requires(M& mechanism) { method_.explain(failure, mechanism); }) return method_.explain(failure, initial_state_.mechanism());
    else return method_.explain(failure);
  }

  Json do_task(Task task) {
    if (task == Task::equilibrium) {
      const auto& start = initial_state_.at_rest();
      method_.begin(start, initial_state_.penalties(), 0.0);
      Json found = columns();
      found["locking_forces"] = initial_state_.reactions();
      return found;
    }
    const auto& start = initial_state_.in_motion();
    method_.begin(start, initial_state_.penalties(), 1.0);
    begun_ = true;
    return task == Task::realtime ? keep_pace() : simulate();
  }

  Json columns() {
    std::vector<Real> values(method_.columns().size());
    method_.report(values.data());
    Json table = Json::object();
    for (std::size_t i = 0; i < values.size(); ++i)
      table[std::string(method_.columns()[i].name)] = number_or_null(static_cast<double>(values[i]));
    return Json{{"columns", table}};
  }

  /// Steps in blocks, from one row of the table to the next, or one by one if each is measured.  Only the steps themselves are timed.
  Json simulate() {
    method_.prepare();
    const double dt = settings_.dt;
    const auto [steps, stride] = count_steps<Real>(settings_);
    handle_stop_requests();
    open_tables();
    if (goes_on()) {
      steps_ = first_ = std::lround(static_cast<double>(method_.time()) / dt);
      written_ = static_cast<double>(method_.time());
    } else {
      write();
    }
    const long block = steps_table_ ? 1 : stride;
    for (long first = steps_; first < steps; first = steps_) {
      if constexpr (requires { method_.keep(); }) method_.keep();  // other code may continue from there
      const long last = std::min((first / block + 1) * block, steps);
      try {
        advance(first, last);
      } catch (Failure& failure) {
        number(failure);
        if (const auto since = doubtful_since()) remove_rows_after(*since);
        else if (failure.guards.empty()) write_last(dt);
        throw;
      }
      if (steps_ < last) {
        stopped_ = true;
        write_last(dt);
        break;
      }
      if (steps_table_) steps_table_->row(method_.time(), method_.measure_step());
      if (last % stride == 0 || last == steps) write();
      progress(last, steps);
    }
    return counts();
  }

  /// Steps in real time, without rows; the times of the steps are written to a table, also if a step fails.
  Json keep_pace() {
    method_.prepare();
    const double dt = settings_.dt;
    const long steps = count_steps<Real>(settings_, true).number;
    handle_stop_requests();
    Pace pace(steps, dt);
    try {
      for (; steps_ < steps && !stop_requested(); ++steps_) {
        pace.wait(steps_);
        method_.step(steps_ + 1);
        pace.finish(steps_);
      }
    } catch (Failure& failure) {
      number(failure);
      write(pace);
      throw;
    }
    stopped_ = steps_ < steps;
    write(pace);
    return counts();
  }

  /// Sets the number of a step for what happens within it.
  void number(Failure& failure) const {
    if (failure.step == 0) failure.step = steps_ + 1;
  }

  /// Steps up to `last`, fewer if a stop is requested.
  void advance(long first, long last) {
    const double checked = seconds_of_checks();
    const auto begin = std::chrono::steady_clock::now();
    try {
      for (long n = first; n < last && !stop_requested(); ++n) {
        method_.step(n + 1);
        steps_ = n + 1;
      }
    } catch (const Stopped&) {
    }
    seconds_ += std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count() - (seconds_of_checks() - checked);
  }

  /// Whether other code has written the rows before this run.
  bool goes_on() const { return file_.contains("initial_state"); }

  void open_tables() {
    const auto open = [this](std::optional<Table>& table, const char* key, const auto& columns) {
      table.emplace(file_, key);
      if (!goes_on()) table->header(columns);
    };
    open(table_, "out", method_.columns());
    values_.resize(method_.columns().size());
    if constexpr (requires { method_.report_moved(Real(0), values_.data()); })
      if (settings_.jumps_within) near_jumps_.emplace(*settings_.jumps_within, values_.size());
    if (Table::is_requested(file_, "steps_out")) open(steps_table_, "steps_out", Method::step_columns);
    if (Table::is_requested(file_, "coordinates_out")) open(coordinates_, "coordinates_out", method_.coordinates());
  }

  void write() {
    method_.report(values_.data());
    table_->row(method_.time(), values_);
    if constexpr (requires { method_.report_moved(Real(0), values_.data()); })
      if (near_jumps_) near_jumps_->look(method_.time(), values_, [&](Real time, Real* column) { method_.report_moved(time, column); });
    if (coordinates_) coordinates_->row(method_.time(), method_.position());
    written_ = static_cast<double>(method_.time());
    remember();
  }

  /// Save where the tables end, as long as later rows may have to be removed.
  void remember() {
    if constexpr (requires { method_.energy(); }) {
      if (!method_.energy()) return;
      ends_.push_back({written_, table_->end(), coordinates_ ? coordinates_->end() : Table::End{}});
      while (ends_.size() > 1 && ends_[1].time <= method_.energy()->settled()) ends_.pop_front();
    }
  }

  /// The time spent on the balance of work and energy, s.
  double seconds_of_checks() const {
    if constexpr (requires { method_.energy(); })
      if (method_.energy()) return method_.energy()->seconds();
    return 0.0;
  }

  std::optional<double> doubtful_since() const {
    if constexpr (requires { method_.energy(); })
      if (method_.energy()) return method_.energy()->doubtful_since();
    return std::nullopt;
  }

  /// Remove the rows after a time, except the first.
  void remove_rows_after(double since) {
    while (ends_.size() > 1 && ends_.back().time > since) ends_.pop_back();
    table_->cut(ends_.back().table);
    if (coordinates_) coordinates_->cut(ends_.back().coordinates);
  }

  /// Write the row of the last converged state, unless written.
  void write_last(double dt) {
    if (static_cast<double>(method_.time()) > written_ + 1e-9 * dt) write();
  }

  void write(const Pace& pace) {
    table_.emplace(file_, "out");
    pace.write(*table_, steps_);
  }

  Json counts() const {
    Json summary{{"steps", steps_ - first_}, {"seconds", seconds_}, {"undetermined", initial_state_.undetermined()}, {"locking_forces", initial_state_.reactions()}};
    method_.summarise(summary);
    if (near_jumps_) near_jumps_->summarise(summary, method_.columns());
    return summary;
  }

  /// Progress: a line of JSON on standard output each twentieth of the run, and once after ten seconds with the time taken.
  void progress(long step, long steps) {
    const long mark = 20 * step / steps;
    const bool slow = !slow_ && seconds_ > 10.0;
    if (mark == mark_ && !slow) return;
    mark_ = mark;
    Json line{{"progress", static_cast<double>(step) / static_cast<double>(steps)}};
    if (slow) {
      slow_ = true;
      line["slow"] = counts();
      line["slow"]["time"] = static_cast<double>(method_.time());
    }
    std::cout << line << std::endl;
  }

  /// The time of a row, and the ends of the tables there.
  struct RowEnd {
    double time;
    Table::End table, coordinates;
  };

  InitialState<M> initial_state_;
  Method& method_;
  const RunSettings& settings_;
  const Json& file_;
  std::vector<Real> values_;
  std::optional<NearJumps<Real>> near_jumps_;
  std::optional<Table> table_, steps_table_, coordinates_;
  std::deque<RowEnd> ends_;  ///< of the rows that may have to be removed, and the one before
  bool begun_ = false;                  ///< whether the method has taken over a start
  bool stopped_ = false;                ///< by request, before the end
  bool slow_ = false;                   ///< whether the run has been reported as slow
  long steps_ = 0, first_ = 0, mark_ = -1;  ///< steps_: from the start on, the first by other code
  double seconds_ = 0.0, written_ = 0.0;  ///< written_: the time of the last row
};

/// The run of a file by a method of mechanisms or systems.
template <class Method, class Subject>
Json run_by(AnyMechanism<double>& start, Subject& subject, const RunSettings& settings, const Json& file) {
  Method method(subject, settings, file);
  return Run(start, method, settings, file).perform();
}

}  // namespace cutjoint
