// Files that a run writes.
#pragma once

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <memory>
#include <stdexcept>
#include <string>
#include <string_view>
#include <system_error>

#include <unistd.h>

#include "cutjoint/json.hpp"
#include "cutjoint/open_file.hpp"

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

  [[noreturn]] void fail() const {
    throw std::runtime_error("cannot write " + name_ + ": " + std::generic_category().message(errno));
  }

  std::string name_;
  std::unique_ptr<std::FILE, Close> file_;
  long begin_ = 0;  ///< bytes before the first one written here, 0 for a stream
};

}  // namespace cutjoint
