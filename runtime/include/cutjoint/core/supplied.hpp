// Calls of functions whose code the user of a model supplies.
#pragma once

#include <cstddef>

namespace cutjoint {

/// A function of a model: it writes its value at the arguments to `result`, and where `partials` is not null its derivative by each argument there.
/// The same arguments give the same numbers at each call: steps are tried, rejected and tried again.
using Supplied = void (*)(const double* arguments, double* result, double* partials);

/// Its value; of several numbers side by side one call for each, of numbers with derivatives these too.
template <class Real, std::size_t count>
Real supplied(Supplied function, const Real (&x)[count]) {
  if constexpr (requires { Real::size; }) {
    typename Real::Vector values;
    for (int k = 0; k < Real::size; ++k) {
      typename Real::real_type lane[count];
      for (std::size_t i = 0; i < count; ++i) lane[i] = x[i][k];
      values[k] = supplied(function, lane);
    }
    return values;
  } else if constexpr (requires { x[0].slope; }) {
    double arguments[count], value, partials[count];
    for (std::size_t i = 0; i < count; ++i) arguments[i] = x[i].value;
    function(arguments, &value, partials);
    Real result(value);
    for (std::size_t i = 0; i < count; ++i) result.slope += x[i].slope == 0.0 ? decltype(result.slope){} : partials[i] * x[i].slope;
    return result;
  } else {
    double arguments[count], value;
    for (std::size_t i = 0; i < count; ++i) arguments[i] = static_cast<double>(x[i]);
    function(arguments, &value, nullptr);
    return Real(value);
  }
}

/// Its derivative by the argument of a number.
template <class Real, std::size_t count>
Real supplied_partial(Supplied function, int by, const Real (&x)[count]) {
  if constexpr (requires { Real::size; }) {
    typename Real::Vector values;
    for (int k = 0; k < Real::size; ++k) {
      typename Real::real_type lane[count];
      for (std::size_t i = 0; i < count; ++i) lane[i] = x[i][k];
      values[k] = supplied_partial(function, by, lane);
    }
    return values;
  } else {
    static_assert(!requires { x[0].slope; }, "a supplied function has no second derivatives");
    double arguments[count], value, partials[count];
    for (std::size_t i = 0; i < count; ++i) arguments[i] = static_cast<double>(x[i]);
    function(arguments, &value, partials);
    return Real(partials[by]);
  }
}

}  // namespace cutjoint
