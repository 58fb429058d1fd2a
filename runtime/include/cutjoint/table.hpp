// Tables of numbers over time, as CSV.
#pragma once

#include <charconv>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "cutjoint/json.hpp"
#include "cutjoint/mechanism.hpp"
#include "cutjoint/output_file.hpp"

namespace cutjoint {

/// Writes rows of numbers, shortest round trip.  Throws where a file cannot be written.
class Table {
 public:
  /// The table whose place a run file has under a key, and under `key`_copy that of a second file with the same rows, if there is one.
  Table(const Json& file, const std::string& key) {
    files_.emplace_back(file.at(key));
    if (const auto copy = file.find(key + "_copy"); copy != file.end()) files_.emplace_back(*copy);
  }

  void header(std::span<const Named> columns) {
    line_ = "t";
    for (const Named& column : columns) line_.append(",").append(column.name);
    finish_line();
  }

  void header(std::span<const std::string_view> columns) {
    line_ = "t";
    for (const std::string_view column : columns) line_.append(",").append(column);
    finish_line();
  }

  template <class Time, class Real>
  void row(Time t, const std::vector<Real>& values) {
    append(static_cast<double>(t));
    for (const Real value : values) {
      line_ += ',';
      append(static_cast<double>(value));
    }
    finish_line();
    ++rows_;
  }

  /// Write what is still in memory.
  void close() {
    for (OutputFile& file : files_) file.close();
  }

  long rows() const { return rows_; }

  /// The end of a table.
  struct End {
    long rows, bytes;
  };

  End end() const { return {rows_, bytes_}; }

  /// Take back the rows after an end that the table has had.
  void cut(const End& end) {
    for (OutputFile& file : files_) file.cut(end.bytes);
    rows_ = end.rows;
    bytes_ = end.bytes;
  }

 private:
  void append(double value) {
    char text[32];
    line_.append(text, std::to_chars(text, text + sizeof text, value + 0.0).ptr);
  }

  void finish_line() {
    line_ += '\n';
    for (OutputFile& file : files_) file.write(line_);
    bytes_ += static_cast<long>(line_.size());
    line_.clear();
  }

  std::vector<OutputFile> files_;
  std::string line_;
  long rows_ = 0, bytes_ = 0;
};

}  // namespace cutjoint
