// Values of a run file, each read with its range; values out of range are rejected by name.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string_view>
#include <type_traits>
#include <utility>

#include "cutjoint/json.hpp"

namespace cutjoint {

[[noreturn]] inline void refuse(std::string_view key, const std::string& what) {
  throw std::runtime_error("run file: '" + std::string(key) + "' " + what);
}

/// The value under a key.
inline const Json& value_of(const Json& object, const char* key) {
  const auto found = object.find(key);
  if (found == object.end()) refuse(key, "is missing");
  return *found;
}

/// The object under a key.
inline const Json& read_object(const Json& object, const char* key) {
  const Json& value = value_of(object, key);
  if (!value.is_object()) refuse(key, "is " + value.dump() + " and not an object");
  return value;
}

/// Words or names joined as in a sentence.
std::string listed(const auto& words) {
  std::string list;
  for (const std::string_view word : words) list.append(list.empty() ? "" : ", ").append(word);
  return list;
}

/// Rejects a key that is not one of `known`.
void require_keys(const Json& object, const auto& known) {
  for (const auto& [key, value] : object.items())
    if (std::find(known.begin(), known.end(), key) == known.end()) refuse(key, known.empty() ? "is unknown" : "is not one of " + listed(known));
}

/// The largest number that is read into a type.
template <class Real>
constexpr double largest_read = std::is_same_v<Real, float> ? double(std::numeric_limits<float>::max()) : std::numeric_limits<double>::max();

/// A JSON value as a finite number.
template <class Real>
Real number_of(const Json& value, std::string_view key) {
  if (!value.is_number()) refuse(key, "is " + value.dump() + " and not a number");
  const auto number = value.get<double>();
  if (!(std::abs(number) <= largest_read<Real>)) refuse(key, "is " + value.dump() + " and has no finite value in the number type of the run");
  return Real(number);
}

/// The number under a key.
template <class Real>
Real read_number(const Json& object, const char* key) { return number_of<Real>(value_of(object, key), key); }

/// An integer from `least` to `most`.
inline int read_integer(const Json& object, const char* key, int least, int most = std::numeric_limits<int>::max()) {
  const Json& value = value_of(object, key);
  if (!value.is_number_integer()) refuse(key, "is " + value.dump() + " and not an integer");
  const bool representable = !value.is_number_unsigned() || value.get<std::uint64_t>() <= std::uint64_t(std::numeric_limits<int>::max());
  if (!representable || value.get<std::int64_t>() < least || value.get<std::int64_t>() > most)
    refuse(key, "is " + value.dump() + " and not from " + std::to_string(least) + " to " + std::to_string(most));
  return value.get<int>();
}

/// Read true or false.
inline bool read_flag(const Json& object, const char* key) {
  const Json& value = value_of(object, key);
  if (!value.is_boolean()) refuse(key, "is " + value.dump() + " and neither true nor false");
  return value.get<bool>();
}

/// Read a keyword as its value.
template <class Value, std::size_t n>
Value read_word(const Json& object, const char* key, const std::array<std::pair<std::string_view, Value>, n>& meanings) {
  const Json& value = value_of(object, key);
  std::array<std::string_view, n> words;
  for (std::size_t i = 0; i < n; ++i) {
    words[i] = meanings[i].first;
    if (value.is_string() && value.template get_ref<const std::string&>() == words[i]) return meanings[i].second;
  }
  refuse(key, "is " + value.dump() + " and not one of " + listed(words));
}

}  // namespace cutjoint
