// Several instances of a mechanism in SIMD lanes: selections, norms, roads and inputs.
#pragma once

#include "cutjoint/core/numbers/lanes.hpp"
#include "cutjoint/core/numbers/selection.hpp"
#include "cutjoint/core/roads/road.hpp"
#include "cutjoint/core/numbers/arrays.hpp"
#include "cutjoint/core/inputs/inputs.hpp"

namespace cutjoint {

/// Instances by lanes.
template <class Number, int N>
struct Selection<Lanes<Number, N>> {
  using Real = Lanes<Number, N>;
  using Scalar = Number;
  using Mask = typename Real::Mask;
  using Count = Mask;
  static constexpr int number = N;

  static bool any(Mask mask) {
    long long bits = 0;
    for (int k = 0; k < N; ++k) bits |= mask[k];
    return bits != 0;
  }

  static Mask all_if(bool condition) { return Real::mask(condition); }
  static Mask both(Mask a, Mask b) { return a & b; }
  static Mask either(Mask a, Mask b) { return a | b; }
  static Mask without(Mask mask, Mask others) { return mask & ~others; }
  static Mask finite(Real x) { return (x - x).v == Real(0).v; }
  static Mask is_number(Real x) { return x.v == x.v; }
  static bool has(Mask mask, int k) { return mask[k]; }
  static double of(Real x, int k) { return static_cast<double>(x[k]); }
  static void count(Mask mask, Mask& counted) { counted -= mask; }
  static void take(Mask mask, Real value, Real& number) { number = where(mask, value, number); }

  template <class Numbers>
  static void take_all(Mask mask, const Numbers& values, Numbers& numbers) {
    for (std::size_t i = 0; i < numbers.size(); ++i) take(mask, values[i], numbers[i]);
  }
};

/// The larger of two numbers; NaN if one is NaN.
template <class Number, int N>
Lanes<Number, N> larger(Lanes<Number, N> a, Lanes<Number, N> b) { return where((b.v > a.v) | (b.v != b.v), b, a); }

template <class Number, int N>
Lanes<Number, N> smaller(Lanes<Number, N> a, Lanes<Number, N> b) { return where((b.v < a.v) | (b.v != b.v), b, a); }

/// The largest absolute value in each lane.
template <class Number, int N>
Lanes<Number, N> largest(std::span<const Lanes<Number, N>> values) {
  Lanes<Number, N> result(0);
  for (const Lanes<Number, N> value : values) result = larger(result, abs(value));
  return result;
}

/// One road for each instance, since their wheels are on different pieces.
template <int N>
class Road<Lanes<double, N>> {
 public:
  using Real = Lanes<double, N>;

  /// The road of instance k.
  void put(int k, const Road<double>& road) { roads_[static_cast<std::size_t>(k)] = road; }

  Real height(Real x, Real y) const {
    return of_each(x, y, [](const Road<double>& road, double x, double y) { return road.height(x, y); });
  }
  Real slope(Real x, Real y) const {
    return of_each(x, y, [](const Road<double>& road, double x, double y) { return road.slope(x, y); });
  }
  Real surface(Real x, Real y, int by_x, int by_y) const {
    return of_each(x, y, [=](const Road<double>& road, double x, double y) { return road.surface(x, y, by_x, by_y); });
  }
  Real friction(Real x, Real y, int by_x, int by_y) const {
    return of_each(x, y, [=](const Road<double>& road, double x, double y) { return road.friction(x, y, by_x, by_y); });
  }

 private:
  Real of_each(Real x, Real y, auto function) const {
    Real result;
    for (int k = 0; k < N; ++k) result.v[k] = function(roads_[static_cast<std::size_t>(k)], x[k], y[k]);
    return result;
  }

  std::array<Road<double>, N> roads_;
};

/// A source of inputs that takes those of each instance from a source of its own.
template <class M>
class LaneInputs {
 public:
  using Real = typename M::real_type;
  static constexpr int width = Real::size;

  explicit LaneInputs(const M& instances) : numbers_(numbers_per_input * sizes_of(instances).inputs) {}

  /// Drive instances by sources, one for each.
  void drive(M& instances, auto source_of) {
    bool any = false;
    for (int k = 0; k < width; ++k) any |= (sources_[static_cast<std::size_t>(k)] = source_of(k)).fill != nullptr;
    instances.drive_by(any ? InputSource<Real>{&fill, this} : InputSource<Real>{});
  }

 private:
  static void fill(void* host, Real t, Real* input) {
    LaneInputs& lanes = *static_cast<LaneInputs*>(host);
    auto& numbers = lanes.numbers_;
    for (int k = 0; k < width; ++k) {
      const InputSource<double>& source = lanes.sources_[static_cast<std::size_t>(k)];
      if (!source.fill) continue;
      for (std::size_t i = 0; i < numbers.size(); ++i) numbers[i] = input[i][k];
      source.fill(source.host, t[k], numbers.data());
      for (std::size_t i = 0; i < numbers.size(); ++i) input[i].v[k] = numbers[i];
    }
  }

  std::array<InputSource<double>, width> sources_;
  Array<M, numbers_per_input * static_sizes<M>().inputs, double> numbers_;
};

}  // namespace cutjoint
