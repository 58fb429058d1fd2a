// Solves random systems whose unknowns fall apart but for a border, several of a pattern in turn; prints how many there were, how often other pivots were
// taken, and the largest error.
#include "cutjoint/core/numbers/bordered.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <random>

namespace {

using cutjoint::DualPart, cutjoint::Bordered, cutjoint::seeds_at_once;

/// Four parts of five unknowns, two of three, one of four and a border of three, in no order.
struct Places {
  static constexpr unsigned beside[] = {4, 2, 1, 1};
  static constexpr unsigned parts[] = {0, 4, 1, 7, 2, 6, 3, 3, 5, 0, 1, 2, 6, 7, 0, 1, 2, 3, 4, 5, 0, 6, 1, 2, 3, 7, 4, 0, 1, 5, 2, 3, 6};
};

constexpr std::size_t n = std::size(Places::parts);
using Matrix = Bordered<Places>;

}  // namespace

int main() {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> number(-1, 1), share(0, 1);
  int systems = 0, again = 0;
  double error = 0.0;
  for (int shape = 0; shape < 60; ++shape) {
    const auto matrix = std::make_unique<Matrix>();
    Matrix::Pattern pattern{};
    bool there[n][n];
    for (std::size_t i = 0; i < n; ++i)
      for (std::size_t j = 0; j < n; ++j) {
        const unsigned p = Places::parts[i], q = Places::parts[j];
        there[i][j] = (p == q || p == 7 || q == 7) && (i == j || share(random) < 0.2 + 0.2 * (shape % 4));
        if (there[i][j]) pattern[Matrix::places.of(i, j)] = true;
      }
    for (int system = 0; system < 10; ++system, ++systems) {
      double A[n][n], x[n], b[n];
      DualPart many[n];
      for (std::size_t i = 0; i < n; ++i) x[i] = number(random);
      for (std::size_t i = 0; i < n; ++i) {
        double sum = 0.0;
        for (std::size_t j = 0; j < n; ++j) sum += (A[i][j] = there[i][j] ? number(random) : 0.0) * x[j];
        const std::size_t slot = Matrix::places.slot(i);
        b[slot] = sum;
        for (std::size_t k = 0; k < seeds_at_once; ++k) many[slot].derivative[k] = sum * static_cast<double>(k + 1);
      }
      const auto decompose = [&] {
        matrix->clear();
        for (std::size_t i = 0; i < n; ++i)
          for (std::size_t j = 0; j < n; ++j)
            if (there[i][j]) matrix->entries()[Matrix::places.of(i, j)] = A[i][j];
        return matrix->decompose(pattern);
      };
      if (!decompose()) {
        ++again;
        if (!decompose()) return 1;
      }
      matrix->solve(b);
      matrix->solve(many);
      for (std::size_t i = 0; i < n; ++i) {
        const std::size_t slot = Matrix::places.slot(i);
        error = std::max(error, std::abs(b[slot] - x[i]));
        for (std::size_t k = 0; k < seeds_at_once; ++k) error = std::max(error, std::abs(many[slot].derivative[k] / static_cast<double>(k + 1) - x[i]));
      }
    }
  }
  std::printf("%d %d %.3e\n", systems, again, error);
}
