// Arrays as long as lists of a mechanism: inside the object where the mechanism's class knows its sizes, else of vectors.
#pragma once

#include <algorithm>
#include <concepts>
#include <cstddef>
#include <type_traits>
#include <utility>
#include <vector>

namespace cutjoint {

/// How many coordinates, speeds, equations of cut joints, cut joints, parameters, inputs, tyres, columns, guards and indicators a
/// mechanism has; indicators are those at which steps end.  The last of the speeds are first-order `states`: no coordinate is their integral.
/// `controllers` hold values between samples, `discrete` states in all.
struct Sizes {
  std::size_t coordinates = 0, speeds = 0, equations = 0, cuts = 0, parameters = 0, inputs = 0, roads = 0, columns = 0, guards = 0, indicators = 0;
  std::size_t states = 0, controllers = 0, discrete = 0;

  constexpr std::size_t joint_speeds() const { return speeds - states; }
};

/// A mechanism whose class knows its `sizes`, its `charts` and its `cuts`.
template <class M>
concept Sized = requires {
  { M::sizes } -> std::convertible_to<Sizes>;
};

/// The sizes if the class knows them, else 0.
template <class M>
constexpr Sizes static_sizes() {
  if constexpr (Sized<M>) return M::sizes;
  return {};
}

/// The sizes of a mechanism or system.  What GCC inlines follows from its form, and with it how products are joined to sums.
template <class M>
Sizes sizes_of(const M& mechanism) {
  if constexpr (Sized<M>) {
    return M::sizes;
  } else if constexpr (requires { mechanism.description().unknowns(); }) {
    const auto& d = mechanism.description();
    return {.coordinates = d.coordinates.size(), .speeds = d.unknowns().size(), .equations = d.equations.size(), .parameters = d.parameters.size(),
            .inputs = d.inputs.size(), .roads = d.roads.size(), .columns = d.columns.size(), .guards = d.guards.size(), .states = d.states,
            .controllers = d.controllers.size(), .discrete = d.discrete()};
  } else {
    const auto& d = mechanism.description();
    return {.coordinates = d.coordinates.size(), .speeds = d.speeds.size(), .equations = d.equations.size(), .cuts = d.cuts.size(),
            .parameters = d.parameters.size(), .inputs = d.inputs.size(), .roads = d.roads.size(), .columns = d.columns.size(),
            .guards = d.guards.size(), .states = d.states, .controllers = d.controllers.size(), .discrete = d.discrete()};
  }
}

/// `n` numbers inside the object, with what of a vector's interface a core needs; the lengths that it is given are always n.
template <class T, std::size_t n>
class Fixed {
 public:
  using value_type = T;

  Fixed() = default;
  explicit Fixed(std::size_t, T value = T{}) { fill(value); }

  T* data() { return x_; }
  const T* data() const { return x_; }
  static constexpr std::size_t size() { return n; }
  static constexpr bool empty() { return n == 0; }
  T& operator[](std::size_t i) { return x_[i]; }
  const T& operator[](std::size_t i) const { return x_[i]; }
  T* begin() { return x_; }
  T* end() { return x_ + n; }
  const T* begin() const { return x_; }
  const T* end() const { return x_ + n; }
  T& front() { return x_[0]; }
  const T& front() const { return x_[0]; }
  void fill(T value) { std::fill(begin(), end(), value); }

  bool operator==(const Fixed& other) const { return std::equal(begin(), end(), other.begin()); }

  void swap(Fixed& other) { std::swap_ranges(begin(), end(), other.begin()); }

  template <class Iterator>
  void assign(Iterator first, Iterator last) { std::copy(first, last, begin()); }

 private:
  T x_[n > 0 ? n : 1]{};
};

/// `n` numbers for a class that knows its sizes.
template <class M, std::size_t n, class T = typename M::real_type>
using Array = std::conditional_t<Sized<M>, Fixed<T, n>, std::vector<T>>;

template <class M, class T = typename M::real_type>
using Coordinates = Array<M, static_sizes<M>().coordinates, T>;
template <class M, class T = typename M::real_type>
using Speeds = Array<M, static_sizes<M>().speeds, T>;
template <class M, class T = typename M::real_type>
using Equations = Array<M, static_sizes<M>().equations, T>;
template <class M, class T = typename M::real_type>
using Cuts = Array<M, static_sizes<M>().cuts, T>;

}  // namespace cutjoint
