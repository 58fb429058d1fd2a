// Random numbers, sizes of steps and references of variables, right and wrong ones; fmi2.cpp or fmi3.cpp comes before.
#pragma once

namespace {

uint64_t seed = 88172645463325252ULL;

unsigned below(unsigned n) {
  seed ^= seed << 13, seed ^= seed >> 7, seed ^= seed << 17;
  return static_cast<unsigned>(seed % n);
}

double any_number(void) {
  const double numbers[] = {0.0, 1e-3, 1e-2, 2000.0, -1.0, 1e300, NAN, HUGE_VAL, 5.0, 0.5};
  return numbers[below(10)];
}

// Steps of some thousandths of a second, and such as cannot be.
double any_size(void) {
  const double numbers[] = {1e-3, 1e-3, 1e-3, 1e-2, 5e-4, 0.0123, 0.0, -1.0, 1e300, NAN};
  return numbers[below(10)];
}

unsigned any_reference(void) { return below(20) ? below(n_references + 1) : below(4000000000u); }

}  // namespace
