// Calls of functions supplied by the user of a model.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>

namespace cutjoint {

/// A function of a model: it writes its value to `result` and, unless `partials` is null, its derivative with respect to each argument.
/// It must be pure, since steps may be rejected and repeated.
using Supplied = void (*)(const double* arguments, double* result, double* partials);

/// A function with several results, or one that reads a memory; `partials` has a row for each result.
using SuppliedWithMemory = void (*)(const double* arguments, const void* memory, double* results, double* partials);

/// Updates a memory at a sample, from the memory before; nothing else writes it.
using MemoryUpdate = void (*)(const double* arguments, const void* memory, void* next);

/// The arguments of a function as doubles, then its memory, four bytes in each number as an integer.
template <std::size_t count, std::size_t words>
struct SuppliedArguments {
  static constexpr std::size_t size = count - words;

  template <class Real>
  explicit SuppliedArguments(const Real (&x)[count]) {
    for (std::size_t i = 0; i < size; ++i) arguments[i] = plain(x[i]);
    for (std::size_t i = 0; i < words; ++i) {
      const std::uint32_t word = static_cast<std::uint32_t>(plain(x[size + i]));
      std::memcpy(memory + 4 * i, &word, 4);
    }
  }

  template <class Real>
  static double plain(const Real& x) {
    if constexpr (requires { x.derivative; }) return plain(x.value);
    else {
      static_assert(words == 0 || std::numeric_limits<Real>::digits >= 32, "numbers of this type do not hold four bytes of a memory");
      return static_cast<double>(x);
    }
  }

  void call(Supplied function, double* results, double* partials) const { function(arguments, results, partials); }
  void call(SuppliedWithMemory function, double* results, double* partials) const { function(arguments, memory, results, partials); }

  double arguments[size];
  alignas(16) unsigned char memory[words ? 4 * words : 1];
};

/// Numbers of each lane.
template <class Real, std::size_t size, std::size_t count, class Each>
std::array<Real, size> of_lanes(const Real (&x)[count], Each each) {
  typename Real::Vector values[size];
  for (int k = 0; k < Real::size; ++k) {
    typename Real::real_type lane[count];
    for (std::size_t i = 0; i < count; ++i) lane[i] = x[i][k];
    const auto found = each(lane);
    for (std::size_t i = 0; i < size; ++i) values[i][k] = found[i];
  }
  std::array<Real, size> all;
  for (std::size_t i = 0; i < size; ++i) all[i] = Real(values[i]);
  return all;
}

/// All results of a function, by one call for each lane.
template <class Real, std::size_t results, std::size_t words, class Function, std::size_t count>
std::array<Real, results> supplied_results(Function function, const Real (&x)[count]) {
  if constexpr (requires { Real::size; }) {
    return of_lanes<Real, results>(x, [function](const auto& lane) { return supplied_results<typename Real::real_type, results, words>(function, lane); });
  } else {
    const SuppliedArguments<count, words> given(x);
    std::array<Real, results> found;
    double values[results];
    if constexpr (requires { x[0].derivative; }) {
      double partials[results * given.size];
      given.call(function, values, partials);
      for (std::size_t i = 0; i < results; ++i) {
        found[i] = Real(values[i]);
        for (std::size_t j = 0; j < given.size; ++j) found[i].derivative += along(partials[i * given.size + j], x[j].derivative);
      }
    } else {
      given.call(function, values, nullptr);
      for (std::size_t i = 0; i < results; ++i) found[i] = Real(values[i]);
    }
    return found;
  }
}

/// The Jacobian of a function, a row for each result.
template <class Real, std::size_t results, std::size_t words, class Function, std::size_t count>
std::array<Real, results * (count - words)> supplied_partials(Function function, const Real (&x)[count]) {
  constexpr std::size_t size = results * (count - words);
  if constexpr (requires { Real::size; }) {
    return of_lanes<Real, size>(x, [function](const auto& lane) { return supplied_partials<typename Real::real_type, results, words>(function, lane); });
  } else {
    static_assert(!requires { x[0].derivative; }, "a supplied function has no second derivatives");
    const SuppliedArguments<count, words> given(x);
    double values[results], partials[size];
    given.call(function, values, partials);
    std::array<Real, size> found;
    for (std::size_t i = 0; i < size; ++i) found[i] = Real(partials[i]);
    return found;
  }
}

/// The value of a function with one result; for SIMD lanes with one call for each lane, for dual numbers with derivatives.
template <class Real, std::size_t count>
Real supplied(Supplied function, const Real (&x)[count]) { return supplied_results<Real, 1, 0>(function, x)[0]; }

/// Its derivative with respect to one argument.
template <class Real, std::size_t count>
Real supplied_partial(Supplied function, int by, const Real (&x)[count]) {
  return supplied_partials<Real, 1, 0>(function, x)[static_cast<std::size_t>(by)];
}

/// The next values of a memory.
template <class Real, std::size_t words, std::size_t count>
std::array<Real, words> updated_memory(MemoryUpdate update, const Real (&x)[count]) {
  if constexpr (requires { Real::size; }) {
    return of_lanes<Real, words>(x, [update](const auto& lane) { return updated_memory<typename Real::real_type, words>(update, lane); });
  } else {
    const SuppliedArguments<count, words> given(x);
    alignas(16) unsigned char next[4 * words];
    std::memcpy(next, given.memory, sizeof next);
    update(given.arguments, given.memory, next);
    std::array<Real, words> found;
    for (std::size_t i = 0; i < words; ++i) {
      std::uint32_t word;
      std::memcpy(&word, next + 4 * i, 4);
      found[i] = Real(static_cast<double>(word));
    }
    return found;
  }
}

}  // namespace cutjoint
