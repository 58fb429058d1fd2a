// Tables of numbers over time, as CSV.
#pragma once

#include <charconv>
#include <fstream>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "cutjoint/mechanism.hpp"

namespace cutjoint {

/// Writes rows of numbers, shortest round trip.
class Table {
 public:
  explicit Table(const std::string& path) : out_(path, std::ios::binary) {
    if (!out_) throw std::runtime_error("cannot write " + path);
  }

  void header(std::span<const Named> columns) {
    line_ = "t";
    for (const Named& column : columns) line_.append(",").append(column.name);
    end();
  }

  void header(std::span<const std::string_view> columns) {
    line_ = "t";
    for (const std::string_view column : columns) line_.append(",").append(column);
    end();
  }

  template <class Time, class Real>
  void row(Time t, const std::vector<Real>& values) {
    append(static_cast<double>(t));
    for (const Real value : values) {
      line_ += ',';
      append(static_cast<double>(value));
    }
    end();
  }

 private:
  void append(double value) {
    char text[32];
    line_.append(text, std::to_chars(text, text + sizeof text, value + 0.0).ptr);
  }

  void end() {
    line_ += '\n';
    out_ << line_;
    line_.clear();
  }

  std::ofstream out_;
  std::string line_;
};

}  // namespace cutjoint
