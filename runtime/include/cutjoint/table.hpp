// Tables of numbers over time, as CSV and as plain doubles.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "cutjoint/json.hpp"
#include "cutjoint/mechanism.hpp"
#include "cutjoint/output_file.hpp"
#include "cutjoint/shortest_text.hpp"

namespace cutjoint {

/// Writes rows of numbers: as shortest round-trip text, as doubles, or both.  Throws if a file cannot be written.
class Table {
 public:
  /// The table written as text to the run file's entry `key`, and as doubles, row by row, to `key`_rows; one of them may be missing, or "".
  Table(const Json& file, const std::string& key) {
    const auto rows = file.find(key + "_rows"), text = file.find(key);
    if (rows != file.end()) doubles_.emplace(*rows);
    if (!doubles_ || (text != file.end() && *text != "")) text_.emplace(file.at(key));
  }

  static bool is_requested(const Json& file, const std::string& key) { return file.contains(key) || file.contains(key + "_rows"); }

  void header(std::span<const Named> columns) {
    line_ = "t";
    for (const Named& column : columns) line_.append(",").append(column.name);
    finish_header();
  }

  void header(std::span<const std::string_view> columns) {
    line_ = "t";
    for (const std::string_view column : columns) line_.append(",").append(column);
    finish_header();
  }

  template <class Time, class Real>
  void row(Time t, const std::vector<Real>& values) {
    numbers_.resize(values.size() + 1);
    numbers_[0] = static_cast<double>(t) + 0.0;  // never -0
    for (std::size_t i = 0; i < values.size(); ++i) numbers_[i + 1] = static_cast<double>(values[i]) + 0.0;
    if (doubles_) doubles_->write({reinterpret_cast<const char*>(numbers_.data()), numbers_.size() * sizeof(double)});
    if (text_) write_text();
    ++rows_;
  }

  /// Write what is still in memory.
  void close() {
    for (auto* file : {&text_, &doubles_})
      if (*file) (*file)->close();
  }

  long rows() const { return rows_; }

  /// The end of a table.
  struct End {
    long rows, bytes;
  };

  End end() const { return {rows_, bytes_}; }

  /// Remove the rows after an earlier end of the table.
  void cut(const End& end) {
    if (text_) text_->cut(end.bytes);
    if (doubles_) doubles_->cut(end.rows * static_cast<long>(numbers_.size() * sizeof(double)));
    rows_ = end.rows;
    bytes_ = end.bytes;
  }

 private:
  void write_text() {
    line_.resize(numbers_.size() * (ShortestText::longest + 1));
    char* end = line_.data();
    for (const double number : numbers_) {
      end = ShortestText::write(end, number);
      *end++ = ',';
    }
    end[-1] = '\n';
    write({line_.data(), static_cast<std::size_t>(end - line_.data())});
  }

  void finish_header() {
    line_ += '\n';
    if (text_) write(line_);
  }

  void write(std::string_view text) {
    text_->write(text);
    bytes_ += static_cast<long>(text.size());
  }

  std::optional<OutputFile> text_, doubles_;
  std::string line_;
  std::vector<double> numbers_;
  long rows_ = 0, bytes_ = 0;  ///< bytes_: of the text
};

}  // namespace cutjoint
