// The functions of a generated mechanism: of states from the standard input, results as numbers; parameters and penalty come first.
// Compiled with -DNAME=<class> and `functions.hpp`, which includes the functions' files.
#include <cstdio>
#include <vector>

#include "functions.hpp"

using Numbers = std::vector<double>;

static Numbers read(std::size_t count) {
  Numbers numbers(count);
  for (double& x : numbers)
    if (std::scanf("%lf", &x) != 1) return {};
  return numbers;
}

static void print(const Numbers& numbers) {
  for (const double x : numbers) std::printf("%.17g ", x);
  std::printf("\n");
}

int main() {
  cutjoint::generated::NAME<double> mechanism;
  const Numbers sizes = read(6);
  const auto size = [&](int i) { return static_cast<std::size_t>(sizes[static_cast<std::size_t>(i)]); };
  const Numbers numbers = read(3), parameters = read(size(4));
  const Numbers penalties(size(2) + 1, numbers[0]);
  mechanism.load(parameters.data(), {numbers[0], numbers[1], numbers[2], penalties.data()}, nullptr);
  for (std::size_t state = 0; state < size(5); ++state) {
    const Numbers t = read(1), q = read(size(0)), v = read(size(1)), lambda = read(size(2));
    Numbers vdot(size(1)), dz(vdot), correction(lambda), residual(lambda), rate(lambda), columns(size(3));
    mechanism.begin_step(t[0], 1.0);
    mechanism.evaluate(q.data(), v.data(), lambda.data(), vdot.data(), correction.data());
    mechanism.constraint_residual(q.data(), v.data(), residual.data(), rate.data());
    mechanism.project(q.data(), residual.data(), dz.data());
    mechanism.report(q.data(), v.data(), vdot.data(), lambda.data(), columns.data());
    Numbers energy(2), kinetic(2, -1.0);
    mechanism.energy(q.data(), v.data(), vdot.data(), lambda.data(), energy.data());
    mechanism.energy(q.data(), v.data(), v.data(), lambda.data(), kinetic.data());
    for (const Numbers* result : {&vdot, &correction, &residual, &rate, &dz, &columns, &energy, &kinetic}) print(*result);
  }
}
