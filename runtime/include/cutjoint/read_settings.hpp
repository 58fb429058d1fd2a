// Settings of a run file, each read with its range: what is out of it is refused by name.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <string>
#include <string_view>
#include <type_traits>

#include "cutjoint/json.hpp"

namespace cutjoint {

[[noreturn]] inline void refuse(std::string_view key, const std::string& what) {
  throw std::runtime_error("run file: '" + std::string(key) + "' " + what);
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
Real read_number(const Json& object, const char* key) {
  return number_of<Real>(object.at(key), key);
}

/// A number above zero.
template <class Real>
Real read_positive(const Json& object, const char* key) {
  const Real number = read_number<Real>(object, key);
  if (!(number > Real(0))) refuse(key, "is " + object.at(key).dump() + " and not above zero");
  return number;
}

/// A number from `least` to `most`.
template <class Real>
Real read_between(const Json& object, const char* key, double least, double most) {
  const Real number = read_number<Real>(object, key);
  if (!(number >= Real(least) && number <= Real(most)))
    refuse(key, "is " + object.at(key).dump() + " and not from " + Json(least).dump() + " to " + Json(most).dump());
  return number;
}

/// An integer from `least` to `most`.
inline int read_integer(const Json& object, const char* key, int least, int most = std::numeric_limits<int>::max()) {
  const Json& value = object.at(key);
  if (!value.is_number_integer()) refuse(key, "is " + value.dump() + " and not an integer");
  const bool representable = !value.is_number_unsigned() || value.get<std::uint64_t>() <= std::uint64_t(std::numeric_limits<int>::max());
  if (!representable || value.get<std::int64_t>() < least || value.get<std::int64_t>() > most)
    refuse(key, "is " + value.dump() + " and not from " + std::to_string(least) + " to " + std::to_string(most));
  return value.get<int>();
}

/// One of several words, `usual` where the key is not there.
template <std::size_t n>
std::string read_word(const Json& object, const char* key, const std::array<std::string_view, n>& words, std::string_view usual) {
  const auto found = object.find(key);
  if (found == object.end()) return std::string(usual);
  if (!found->is_string() || std::find(words.begin(), words.end(), found->template get<std::string>()) == words.end()) {
    std::string list;
    for (const std::string_view word : words) list.append(list.empty() ? "" : ", ").append(word);
    refuse(key, "is " + found->dump() + " and not one of " + list);
  }
  return found->template get<std::string>();
}

/// The length of steps: its square, by which accelerations are multiplied, has a value.
template <class Real>
Real read_dt(const Json& numerics) {
  const Real dt = read_positive<Real>(numerics, "dt");
  const double quarter = static_cast<double>(dt * dt / Real(4)), rest = static_cast<double>(Real(1) / (dt * dt));
  if (!(quarter > 0.0 && std::isfinite(quarter) && rest > 0.0 && std::isfinite(rest)))
    refuse("dt", "is " + numerics.at("dt").dump() + ", whose square has no value in the number type of the run");
  return dt;
}

/// The steps of a run and how many of them belong to a row of its table; cutjoint/model/steps.py has the same.
struct Steps {
  long number;
  long stride;
};

/// The rows that a table has at most.
constexpr double most_rows = 1e8;

/// The steps of a run with a row each `output_step`, or each step; with more, times of neighbouring steps are one number.
template <class Real>
Steps read_steps(const Json& file, bool row_each = false) {
  read_dt<Real>(file.at("numerics"));
  const auto dt = read_number<double>(file.at("numerics"), "dt");
  const auto end = read_between<double>(file, "end", 0.0, largest_read<Real>);
  const auto every = row_each ? dt : read_positive<double>(file, "output_step");
  if (end == 0.0) return {0, 1};
  if (!(dt <= end * (1 + 1e-9)))
    refuse("dt", "is longer than the run, which has the end " + file.at("end").dump());
  const double exact = end / dt, most = std::is_same_v<Real, float> ? 0x1p24 : 0x1p53;
  if (!(exact <= most)) refuse("end", "is " + file.at("end").dump() + " and more than " + Json(most).dump() + " steps away");
  const double number = std::max(1.0, std::ceil(exact - 1e-9)), stride = std::clamp(std::floor(every / dt + 0.5), 1.0, number);
  if (!(number / stride <= most_rows)) refuse("end", "is " + file.at("end").dump() + " and more than " + Json(most_rows).dump() + " rows away");
  return {static_cast<long>(number), static_cast<long>(stride)};
}

}  // namespace cutjoint
