// JSON as the driver reads and writes it.
#pragma once

#include <cmath>
#include <fstream>
#include <iostream>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>

#include "cutjoint/open_file.hpp"

namespace cutjoint {

using Json = nlohmann::ordered_json;

/// A double that JSON can hold: null where it is not finite.
inline Json number_or_null(double x) { return std::isfinite(x) ? Json(x) : Json(nullptr); }

/// A JSON file's content; on Windows "handle:NUMBER" is a file that the caller has opened.
inline Json read_json(const std::string& path) {
#ifdef _WIN32
  if (path.rfind("handle:", 0) == 0) return Json::parse(open_for_child(std::stoll(path.substr(7)), "rb"));
#endif
  std::ifstream in(path);
  if (!in) throw std::runtime_error("cannot read " + path);
  return Json::parse(in);
}

}  // namespace cutjoint
