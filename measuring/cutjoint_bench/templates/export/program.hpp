// The program around an exported model: command line, table of results, summary as one line of JSON.
#pragma once

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <exception>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>

#include "mechanics.hpp"

namespace exported {

/// `tolerance` is for integrators that choose their steps, which `dt` divides at least.
struct Options {
  double dt = 1e-3, end = 1, output_step = 0, tolerance = 1e-6;
  std::string integrator, out = "table.csv", task = "simulate";
};

/// What a column reports of a point: x y z vx vy vz wx wy wz, 0 to 8; the arm from the centre of mass is that at the start.
struct Column {
  const char* name;
  int body;
  Vector arm;
  int quantity;
};

/// A body of the model, part of a rigid one.
struct Part {
  const char* name;
  int body;
  Vector arm;
};

/// Acceleration of the centre of mass, m/s2, and angular acceleration, rad/s2.
struct Acceleration {
  Vector a, alpha;
};

/// The index of no body: a point of the ground.
inline constexpr int on_ground = -1;

inline double value_of(const Motion& body, const Column& column) {
  const Point point(body, column.arm);
  const double values[] = {point.place.x,    point.place.y,    point.place.z, point.velocity.x, point.velocity.y,
                           point.velocity.z, body.w.x,         body.w.y,      body.w.z};
  return values[column.quantity];
}

inline double number(std::string_view name, const char* text) {
  char* rest = nullptr;
  const double value = std::strtod(text, &rest);
  if (*text == '\0' || *rest != '\0' || !(value >= 0)) throw std::invalid_argument(std::string(name) + " needs a positive number");
  return value;
}

inline Options read_options(int argc, char** argv) {
  Options options;
  for (int i = 1; i + 1 < argc; i += 2) {
    const std::string_view name = argv[i];
    if (name == "--dt") options.dt = number(name, argv[i + 1]);
    else if (name == "--end") options.end = number(name, argv[i + 1]);
    else if (name == "--output-step") options.output_step = number(name, argv[i + 1]);
    else if (name == "--tolerance") options.tolerance = number(name, argv[i + 1]);
    else if (name == "--integrator") options.integrator = argv[i + 1];
    else if (name == "--out") options.out = argv[i + 1];
    else if (name == "--task") options.task = argv[i + 1];
    else throw std::invalid_argument("unknown option " + std::string(name));
  }
  if (argc % 2 == 0) throw std::invalid_argument("options come in pairs: --name value");
  if (options.dt <= 0) throw std::invalid_argument("--dt needs a positive number");
  return options;
}

/// Text as a string of JSON.
inline std::string quoted(std::string_view text) {
  std::string result = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') result += '\\';
    result += static_cast<unsigned char>(c) < 0x20 ? ' ' : c;
  }
  return result + '"';
}

/// A table that is closed at the end.
class Table {
 public:
  Table(const std::string& path, std::span<const Column> columns) : file_(std::fopen(path.c_str(), "w")), columns_(columns) {
    if (file_ == nullptr) throw std::runtime_error("cannot write " + path);
    std::fputs("t", file_.get());
    for (const Column& column : columns_) std::fprintf(file_.get(), ",%s", column.name);
    std::fputs("\n", file_.get());
  }

  template <class Peer>
  void row(double t, const Peer& peer) {
    std::fprintf(file_.get(), "%.17g", t);
    for (const Column& column : columns_) {
      const Motion body = column.body == on_ground ? Motion{} : peer.motion(column.body);
      std::fprintf(file_.get(), ",%.17g", value_of(body, column));
    }
    std::fputs("\n", file_.get());
  }

 private:
  struct Close {
    void operator()(std::FILE* file) const { std::fclose(file); }
  };
  std::unique_ptr<std::FILE, Close> file_;
  std::span<const Column> columns_;
};

/// Steps from row to row; only the steps are timed.  A peer throws from step() when it cannot go on.
template <class Peer>
int simulate(Peer& peer, const Options& options, std::span<const Column> columns) {
  if (!(options.dt > 0 && options.end / options.dt <= 0x1p53))
    throw std::invalid_argument("--end over --dt is no number of steps: write seconds above zero, and no more than 9e15 steps");
  if (!(options.end == 0 || options.dt <= options.end * (1 + 1e-9))) throw std::invalid_argument("--dt is longer than --end");
  const long steps = static_cast<long>(std::max(0.0, std::ceil(options.end / options.dt - 1e-9)));
  const long stride = static_cast<long>(std::clamp(std::floor(options.output_step / options.dt + 0.5), 1.0, std::max(1.0, double(steps))));
  Table table(options.out, columns);
  table.row(0, peer);
  double seconds = 0;
  long done = 0;
  std::string message;
  while (done < steps) {
    const long last = std::min(done - done % stride + stride, steps);
    const auto begin = std::chrono::steady_clock::now();
    try {
      for (; done < last; ++done) peer.step();
    } catch (const std::exception& problem) {
      message = problem.what();
    }
    seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    if (!message.empty()) break;
    peer.observe();
    table.row(static_cast<double>(done) * options.dt, peer);
  }
  std::printf("{\"seconds\": %.9g, \"steps\": %ld, \"status\": \"%s\", \"message\": %s}\n", seconds, done,
              message.empty() ? "done" : "failed", quoted(message).c_str());
  return message.empty() ? 0 : 1;
}

/// Accelerations of the centres of mass at the start.
template <class Peer>
int accelerate(Peer& peer, std::span<const Part> parts) {
  const char* between = "{";
  for (const Part& part : parts) {
    const Acceleration found = peer.acceleration(part.body);
    const Motion& body = peer.motion(part.body);
    const Vector arm = body.R * part.arm;
    const Vector a = found.a + cross(found.alpha, arm) + cross(body.w, cross(body.w, arm));
    std::printf("%s%s: [%.17g, %.17g, %.17g]", between, quoted(part.name).c_str(), a.x, a.y, a.z);
    between = ", ";
  }
  std::puts("}");
  return 0;
}

/// `make` makes a peer from Options.  A peer has step(), motion(body), which tells the start and, after observe(), the last step, and
/// acceleration(body) at the start; it throws what it has to complain of.
template <class Make>
int run(int argc, char** argv, std::span<const Column> columns, std::span<const Part> parts, Make make) {
  try {
    const Options options = read_options(argc, argv);
    auto peer = make(options);
    if (options.task == "simulate") return simulate(peer, options, columns);
    if (options.task == "accelerations") return accelerate(peer, parts);
    throw std::invalid_argument("--task is simulate or accelerations");
  } catch (const std::exception& problem) {
    std::printf("{\"seconds\": 0, \"steps\": 0, \"status\": \"failed\", \"message\": %s}\n", quoted(problem.what()).c_str());
    return 2;
  }
}

}  // namespace exported
