// Requests to end a run before its end time.
#pragma once

#include <signal.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <chrono>
#include <thread>

namespace cutjoint {

namespace stopping {

static_assert(std::atomic<bool>::is_always_lock_free);  // signal handlers use them
inline std::atomic<bool> requested{false}, heeded{false};

inline void request(int = 0) { requested.store(true, std::memory_order_relaxed); }

inline bool is_ignored(int signal) {
  struct sigaction action {};
  return sigaction(signal, nullptr, &action) == 0 && action.sa_handler == SIG_IGN;
}

}  // namespace stopping

/// True if the run shall end after the present step.
inline bool stop_requested() { return stopping::requested.load(std::memory_order_relaxed); }

/// A run ends between two of its steps, since a stop is requested.
struct Stopped {};

/// From here on SIGINT and SIGTERM request a stop, and somebody looks at that.  The second signal ends the program at once.
inline void heed_stop_requests() {
  stopping::heeded = true;
  struct sigaction action {};
  action.sa_handler = [](int signal) { stopping::request(signal); };
  action.sa_flags = SA_RESETHAND | SA_RESTART;
  for (const int signal : {SIGINT, SIGTERM})
    if (!stopping::is_ignored(signal)) sigaction(signal, &action, nullptr);
}

/// Errors of writing are reported by the call that writes, not by a signal that ends the program.
inline void report_write_errors() {
  signal(SIGPIPE, SIG_IGN);
  signal(SIGXFSZ, SIG_IGN);
}

/// The end of standard input requests a stop: it comes when whoever holds the other end of the pipe closes it or is killed.
///
/// A program that does not stop within ten seconds, or does not look at requests yet, is ended.
inline void stop_with_standard_input() {
  std::thread([] {
    char byte;
    ssize_t count;
    do count = read(STDIN_FILENO, &byte, 1);
    while (count > 0 || (count < 0 && errno == EINTR));
    stopping::request();
    if (stopping::heeded) std::this_thread::sleep_for(std::chrono::seconds(10));
    _exit(2);
  }).detach();
}

}  // namespace cutjoint
