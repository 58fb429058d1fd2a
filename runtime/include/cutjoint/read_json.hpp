// Values of a run file, which the compiler's run/ has checked: only what it could not have written has a message of JSON alone.
#pragma once

#include <algorithm>
#include <array>
#include <optional>
#include <string_view>

#include "cutjoint/json.hpp"

namespace cutjoint {

/// The number under a key.
template <class Real>
Real read_number(const Json& object, const char* key) { return Real(object.at(key).get<double>()); }

/// The same; none for null.
inline std::optional<double> read_optional(const Json& object, const char* key) {
  return object.at(key).is_null() ? std::nullopt : std::optional(object.at(key).get<double>());
}

/// The numbers under a key.
template <class Real>
std::vector<Real> read_numbers(const Json& object, const char* key) {
  const auto numbers = object.at(key).get<std::vector<double>>();
  return {numbers.begin(), numbers.end()};
}

/// The value of a keyword.
template <class Value>
Value read_word(const Json& object, const char* key, std::initializer_list<std::pair<std::string_view, Value>> meanings) {
  const auto word = object.at(key).get<std::string_view>();
  for (const auto& [name, value] : meanings)
    if (name == word) return value;
  throw std::runtime_error(std::string("run file: ") + key + " is " + object.at(key).dump());
}

}  // namespace cutjoint
