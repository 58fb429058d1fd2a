// Numbers with derivatives, alone and side by side, beside differences of the same formulas over long doubles; prints the largest errors of values and of slopes.
#include "cutjoint/core/numbers/dual_lanes.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>

namespace {

using cutjoint::Dual;

double random_number() { return 0.2 + 0.6 * std::rand() / RAND_MAX; }

double worst_value = 0.0, worst_derivative = 0.0;

/// What a formula has at a number, with derivatives, and at that number moved along them.
template <class Formula>
void compare(const Dual& found, Formula at) {
  const long double step = 1e-5L;
  const auto record = [](double& worst, long double error, long double size) {
    const double share = static_cast<double>(std::abs(error) / (1 + std::abs(size)));
    if (!(share <= worst)) worst = share;
  };
  const long double value = at(0.0L, std::size_t{0});
  record(worst_value, found.value - value, value);
  for (std::size_t d = 0; d < cutjoint::seeds_at_once; ++d) {
    const long double derivative = (8 * (at(step, d) - at(-step, d)) - (at(2 * step, d) - at(-2 * step, d))) / (12 * step);
    record(worst_derivative, found.derivative[d] - derivative, derivative);
  }
}

/// Formulas of two numbers a and b, of which each comes as it is and, side by side, as one number for all.
template <int N, class Formula>
void try_formula(Formula formula) {
  using std::abs;
  Dual a[N], b[N];
  for (int k = 0; k < N; ++k) {
    a[k].value = random_number(), b[k].value = random_number();
    for (std::size_t d = 0; d < cutjoint::seeds_at_once; ++d) a[k].derivative[d] = random_number() - 0.5, b[k].derivative[d] = random_number() - 0.5;
  }
  const auto at = [&](int k, int l) {
    return [&, k, l](long double step, std::size_t d) { return formula(a[k].value + step * a[k].derivative[d], b[l].value + step * b[l].derivative[d]); };
  };
  const auto left = cutjoint::strided<cutjoint::Lanes<Dual, N>, 1>(a), right = cutjoint::strided<cutjoint::Lanes<Dual, N>, 1>(b);
  const cutjoint::Lanes<Dual, N> found = formula(left, right), with_one = formula(left, b[0]), of_one = formula(a[0], right);
  Dual stored[N];
  cutjoint::row<cutjoint::Lanes<Dual, N>>(stored) = found;
  for (int k = 0; k < N; ++k) {
    compare(formula(a[k], b[k]), at(k, k));
    compare(stored[k], at(k, k));
    compare(with_one[k], at(k, 0));
    compare(of_one[k], at(0, k));
  }
  compare(sum(found), [&](long double step, std::size_t d) {
    long double total = 0;
    for (int k = 0; k < N; ++k) total += at(k, k)(step, d);
    return total;
  });
}

/// A formula that needs its arguments to be of one type.
template <class Formula>
auto of_alike(Formula formula) {
  return [formula](const auto& a, const auto& b) { return formula(a - 0.0 * b, 0.0 * a + b); };
}

template <int N>
void try_all() {
  try_formula<N>([](const auto& a, const auto& b) { return a + b; });
  try_formula<N>([](const auto& a, const auto& b) { return a - b; });
  try_formula<N>([](const auto& a, const auto& b) { return a * b; });
  try_formula<N>([](const auto& a, const auto& b) { return a / b; });
  try_formula<N>([](const auto& a, const auto& b) { return -(a + b); });
  using std::abs, std::acos, std::asin, std::atan, std::atan2, std::cos, std::cosh, std::exp, std::log, std::pow, std::sin, std::sinh, std::sqrt, std::tan, std::tanh;
#define CUTJOINT_TRY(name) try_formula<N>(of_alike([](const auto& a, const auto& b) { return name(a * b); }));
  CUTJOINT_TRY(sqrt)
  CUTJOINT_TRY(sin)
  CUTJOINT_TRY(cos)
  CUTJOINT_TRY(tan)
  CUTJOINT_TRY(asin)
  CUTJOINT_TRY(acos)
  CUTJOINT_TRY(atan)
  CUTJOINT_TRY(sinh)
  CUTJOINT_TRY(cosh)
  CUTJOINT_TRY(tanh)
  CUTJOINT_TRY(exp)
  CUTJOINT_TRY(log)
#undef CUTJOINT_TRY
  try_formula<N>(of_alike([](const auto& a, const auto& b) { return abs(a - b); }));
  try_formula<N>(of_alike([](const auto& a, const auto& b) { return atan2(a, b); }));
  try_formula<N>(of_alike([](const auto& a, const auto& b) { return pow(a, b); }));
  try_formula<N>(of_alike([](const auto& a, const auto& b) {
    if constexpr (requires { a.size; }) return where(a < b, a * a, b);
    else return a < b ? a * a : b;
  }));
}

}  // namespace

int main() {
  try_all<2>();
  try_all<4>();
  try_all<8>();
  std::printf("%.3e %.3e\n", worst_value, worst_derivative);
}
