// Steps in real time.
#pragma once

#include <chrono>
#include <cstddef>
#include <thread>
#if __has_include(<sys/mman.h>)
#include <sys/mman.h>
#endif

#include "cutjoint/table.hpp"

namespace cutjoint {

/// Begins each step when it is due, and records its duration and its lateness, which is negative if it ended in time.
///
/// After a late step the next one begins immediately.  All memory is allocated before the first step, and locked if permitted.
class Pace {
 public:
  Pace(long steps, double dt) : dt_(dt), took_(static_cast<std::size_t>(steps)), late_(took_.size()) {
#ifdef MCL_CURRENT
    static_cast<void>(mlockall(MCL_CURRENT));
#endif
    begin_ = Clock::now();
  }

  /// Wait until a step, counted from 0, is due.  A sleep may end tens of microseconds late, so the last part is a busy wait.
  void wait(long step) {
    const Clock::time_point due = at(step);
    if (Clock::now() < due - awake_) std::this_thread::sleep_until(due - awake_);
    while (Clock::now() < due) {
    }
    from_ = Clock::now();
  }

  /// End the step.
  void finish(long step) {
    const Clock::time_point now = Clock::now();
    took_[static_cast<std::size_t>(step)] = seconds(now - from_);
    late_[static_cast<std::size_t>(step)] = seconds(now - at(step + 1));
  }

  /// Write the first steps into a table over their end times.
  void write(Table& table, long steps) const {
    static constexpr std::string_view columns[] = {"duration", "lateness"};
    table.header(std::span(columns));
    std::vector<double> row(2);
    for (std::size_t i = 0; i < static_cast<std::size_t>(steps); ++i) {
      row = {took_[i], late_[i]};
      table.row(static_cast<double>(i + 1) * dt_, row);
    }
  }

 private:
  using Clock = std::chrono::steady_clock;

  static double seconds(Clock::duration length) { return std::chrono::duration<double>(length).count(); }

  Clock::time_point at(long step) const {
    return begin_ + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(static_cast<double>(step) * dt_));
  }

  static constexpr std::chrono::microseconds awake_{200};

  double dt_;
  std::vector<double> took_, late_;
  Clock::time_point begin_, from_;
};

}  // namespace cutjoint
