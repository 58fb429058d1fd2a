// Files that a run writes: tables of numbers over time, as CSV and as plain doubles.
#pragma once

#include <cerrno>
#include <cstdio>
#include <memory>
#include <optional>
#include <span>
#include <system_error>
#include <unistd.h>

#include "cutjoint/json.hpp"
#include "cutjoint/any_mechanism.hpp"
#include "cutjoint/shortest_text.hpp"

namespace cutjoint {

/// A file written from its present position, a path from its beginning.  All errors are thrown with the file's name, at the latest when it is closed.
class OutputFile {
 public:
  /// `place` is a path, or a descriptor (on Windows a handle) that is open for writing, with a name for messages: {"descriptor": 5, "name": "run.csv"}.
  explicit OutputFile(const Json& place)
      : name_(place.is_string() ? place.get<std::string>() : place.at("name").get<std::string>()),
        file_(place.is_string() ? std::fopen(name_.c_str(), "wb") : open_for_child(place.at("descriptor").get<long long>(), "wb")) {
    if (!file_) fail();
    begin_ = std::max(0L, std::ftell(file_.get()));
  }

  void write(std::string_view text) {
    if (std::fwrite(text.data(), 1, text.size(), file_.get()) != text.size()) fail();
  }

  /// Truncate to the first bytes written here; a stream is unchanged.
  void cut(long bytes) {
    if (std::fflush(file_.get()) != 0) fail();
    if (std::fseek(file_.get(), begin_ + bytes, SEEK_SET) == 0 && ::ftruncate(::fileno(file_.get()), begin_ + bytes) != 0) fail();
  }

  /// Write what is still in memory and close the file.
  void close() {
    if (file_ && std::fclose(file_.release()) != 0) fail();
  }

 private:
  struct Close {
    void operator()(std::FILE* file) const { std::fclose(file); }
  };

  [[noreturn]] void fail() const { throw std::runtime_error("cannot write " + name_ + ": " + std::generic_category().message(errno)); }

  std::string name_;
  std::unique_ptr<std::FILE, Close> file_;
  long begin_ = 0;  ///< bytes before the first one written here, 0 for a stream
};

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

  /// Write the names of columns, which may have units too.
  void header(const auto& columns) {
    line_ = "t";
    for (const auto& column : columns) {
      if constexpr (requires { column.name; }) line_.append(",").append(column.name);
      else line_.append(",").append(column);
    }
    line_ += '\n';
    if (text_) write(line_);
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
