// Steps to the root of linear equations that are known by what they leave.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstring>

#include "cutjoint/core/numbers/arrays.hpp"
#include "cutjoint/core/mechanism/retraction.hpp"

namespace cutjoint {

/// An inverse H of n equations by Broyden's method: the step s = H r for what is left, r, and what each step has left teach it.  So it may go on from equations to
/// others that are like them.
template <std::size_t n>
class SecantInverse {
  static constexpr std::size_t block = 16, width = (n + block - 1) / block * block;

 public:
  /// n numbers, and noughts.
  using Numbers = Fixed<double, width>;

  /// H is 1.
  void forget() {
    inverse_.fill(0.0), row_.fill(0.0);
    for (std::size_t i = 0; i < n; ++i) inverse_[i * width + i] = 1.0;
  }

  /// The step for what is left, s = H r, from that before and what it has left; with that H becomes H - (z / (s . z - s . s)) s^T H, z = H r.
  const Numbers& find_step(const Numbers& left, bool learns) {
    Numbers found;
    for (std::size_t i = 0; i < n; ++i) found[i] = dot(inverse_.data() + i * width, left.data());
    double turned = 0.0, along = 0.0;
    if (learns) {
      along = dot(step_.data(), found.data());
      const double size = dot(step_.data(), step_.data());
      turned = std::abs(along - size) > 1e-6 * size ? along - size : 0.0;
    }
    const double share = turned == 0.0 ? 0.0 : 1.0 / turned;
    for (std::size_t i = 0; i < n; ++i) {
      shares_[i] = share * found[i];
      step_[i] = found[i] - along * shares_[i];
    }
    learn();
    return step_;
  }

 private:
  /// H less the shares times a row, and the row s^T H of that.
  void learn() {
    for (std::size_t first = 0; first < width; first += block) {
      double *const row = row_.data() + first, *entries = inverse_.data() + first;
      const Four a = four(row), b = four(row + 4), c = four(row + 8), d = four(row + 12);
      Four next_a{}, next_b{}, next_c{}, next_d{};
      const auto go = [](double* entry, double share, const Four& row, double step, Four& next) {
        const Four less = four(entry) - share * row;
        std::memcpy(entry, &less, sizeof less);
        next += step * less;
      };
      for (std::size_t i = 0; i < n; ++i, entries += width) {
        const double share = shares_[i], step = step_[i];
        go(entries, share, a, step, next_a), go(entries + 4, share, b, step, next_b);
        go(entries + 8, share, c, step, next_c), go(entries + 12, share, d, step, next_d);
      }
      const Four next[] = {next_a, next_b, next_c, next_d};
      std::memcpy(row, next, sizeof next);
    }
  }

  static double dot(const double* a, const double* b) {
    Four p{}, q{}, r{}, s{};
    for (std::size_t i = 0; i < width; i += block) {
      p += four(a + i) * four(b + i), q += four(a + i + 4) * four(b + i + 4);
      r += four(a + i + 8) * four(b + i + 8), s += four(a + i + 12) * four(b + i + 12);
    }
    const Four all = (p + q) + (r + s);
    return (all[0] + all[1]) + (all[2] + all[3]);
  }

  static Four four(const double* x) {
    Four numbers;
    std::memcpy(&numbers, x, sizeof numbers);
    return numbers;
  }

  Fixed<double, n * width> inverse_;
  Numbers step_, shares_, row_;
};

}  // namespace cutjoint
