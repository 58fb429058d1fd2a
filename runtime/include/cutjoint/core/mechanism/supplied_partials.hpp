// Partial derivatives of functions that the user of a model supplies as templates over the number type.
#pragma once

#include <algorithm>

#include "cutjoint/core/numbers/dual.hpp"

namespace cutjoint {

/// Results of `call(arguments, results)` at plain numbers and, where `partials` is not null, the derivative of each by each argument, by rows.
template <std::size_t count, std::size_t size, class Call>
void find_partials(Call call, const double* arguments, double* results, double* partials) {
  call(arguments, results);
  if (!partials) return;
  for (std::size_t from = 0; from < count; from += seeds_at_once) {
    Dual x[count], y[size];
    std::copy_n(arguments, count, x);
    const std::size_t number = std::min(seeds_at_once, count - from);
    for (std::size_t k = 0; k < number; ++k) x[from + k].derivative[k] = 1.0;
    call(x, y);
    for (std::size_t i = 0; i < size; ++i)
      for (std::size_t k = 0; k < number; ++k) partials[i * count + from + k] = y[i].derivative[k];
  }
}

}  // namespace cutjoint
