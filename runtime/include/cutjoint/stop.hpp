// Requests to end a run before its end time.
#pragma once

#include <signal.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <chrono>
#include <cstddef>
#include <thread>

namespace cutjoint {

namespace stopping {

static_assert(std::atomic<bool>::is_always_lock_free);  // signal handlers use them
inline std::atomic<bool> requested{false}, handled{false};

inline void request(int = 0) { requested.store(true, std::memory_order_relaxed); }

/// Let the first signal request a stop, unless the parent process has it ignored.
inline void handle(int number) {
#ifdef SA_RESETHAND
  struct sigaction action {};
  if (sigaction(number, nullptr, &action) == 0 && action.sa_handler == SIG_IGN) return;
  action = {};
  action.sa_handler = [](int signal) { request(signal); };
  action.sa_flags = SA_RESETHAND | SA_RESTART;
  sigaction(number, &action, nullptr);
#else  // Windows, where a handler is for one signal
  if (signal(number, [](int signal) { request(signal); }) == SIG_IGN) signal(number, SIG_IGN);
#endif
}

}  // namespace stopping

/// Whether the run shall end after the present step.
inline bool stop_requested() { return stopping::requested.load(std::memory_order_relaxed); }

/// Thrown between two steps if a stop is requested.
struct Stopped {};

/// From now on SIGINT and SIGTERM request a stop, which is checked.  The second signal ends the program immediately.
inline void handle_stop_requests() {
  stopping::handled = true;
  for (const int number : {SIGINT, SIGTERM}) stopping::handle(number);
}

/// Report write errors by the writing call, not by a signal that ends the program.
inline void report_write_errors() {
#ifdef SIGXFSZ  // Windows has no such signals
  signal(SIGPIPE, SIG_IGN);
  signal(SIGXFSZ, SIG_IGN);
#endif
}

/// The end of standard input requests a stop: it comes when the process at the other end of the pipe closes it or is killed.
///
/// A program that does not stop within ten seconds, or does not check requests yet, is ended.
inline void stop_with_standard_input() {
  std::thread([] {
    char byte;
    std::ptrdiff_t count;
    do count = read(STDIN_FILENO, &byte, 1);
    while (count > 0 || (count < 0 && errno == EINTR));
    stopping::request();
    if (stopping::handled) std::this_thread::sleep_for(std::chrono::seconds(10));
    _exit(2);
  }).detach();
}

}  // namespace cutjoint
