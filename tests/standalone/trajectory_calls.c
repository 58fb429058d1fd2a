/* Calls of inputs over time of a mass that a force pushes, right and wrong ones; prints what went wrong, and returns how often. */
#include <math.h>
#include <stdio.h>

#include "mass.h"

enum { pieces = 2, steps = 100 };

static double memory[MASS_SIZE / sizeof(double)], tape[(steps + 2) * MASS_TAPE_RECORD];
static int faults = 0;

#define EXPECT(condition)                                        \
  do {                                                           \
    if (!(condition)) printf("line %d: %s\n", __LINE__, #condition), ++faults; \
  } while (0)

/* The end at 1 s of x'' = u/2 by a force s^k/k! of the time s in a piece between two times: the integral of (1 - t) u/2, by Gauss. */
static double known(double from, double until, int k) {
  double factorial = 1.0, sum = 0.0, w;
  int i, j;
  const double nodes[4] = {0.06943184420297371, 0.33000947820757187, 0.6699905217924281, 0.9305681557970263};
  const double weights[4] = {0.17392742256872693, 0.32607257743127307, 0.32607257743127307, 0.17392742256872693};
  for (i = 1; i <= k; ++i) factorial *= i;
  for (j = 0; j < 4; ++j) {
    w = weights[j] * (until - from) * (1.0 - from - nodes[j] * (until - from));
    sum += w * pow(nodes[j] * (until - from), k);
  }
  return sum / factorial / 2.0;
}

int main(void) {
  static double values[2], back[2], derivatives[pieces * 4], along[2], matrix[MASS_SEED_ROWS], by_state[MASS_STATES], by_input[MASS_INPUTS], by_parameter[MASS_PARAMETERS];
  const double times[pieces] = {0.0, 0.4}, same[pieces] = {0.4, 0.4}, numbers[pieces * 4] = {1.0, -2.0, 3.0, 5.0, -1.0, 0.5, 2.0, -4.0};
  const double changes[pieces * 4] = {0.3, -1.0, 2.0, 0.7, 0.2, -0.6, 1.5, 3.0}, weights[2] = {0.0, 1.0};
  const int x = MASS_OUTPUT_rail_displacement, none = -1;
  double found = 0.0;
  int i;
  mass_sim* sim = mass_create(memory, sizeof memory);
  mass_input_trajectory trajectory = {MASS_INPUT_push, 1, pieces, times, numbers, changes, derivatives}, wrong = trajectory, both[2];
  EXPECT(mass_set_input_trajectories(NULL, 1, &trajectory) == MASS_NO_SIMULATION && mass_set_input_trajectories(sim, 1, NULL) == MASS_NO_ARRAY);
  wrong.input = MASS_INPUTS;
  EXPECT(mass_set_input_trajectories(sim, 1, &wrong) == MASS_NO_SUCH_INDEX);
  wrong = trajectory, wrong.pieces = 0;
  EXPECT(mass_set_input_trajectories(sim, 1, &wrong) == MASS_NO_SUCH_INDEX);
  wrong = trajectory, wrong.coefficients = NULL;
  EXPECT(mass_set_input_trajectories(sim, 1, &wrong) == MASS_NO_ARRAY);
  wrong = trajectory, wrong.times = same;
  EXPECT(mass_set_input_trajectories(sim, 1, &wrong) == MASS_NOT_FINITE);
  both[0] = both[1] = trajectory;
  EXPECT(mass_set_input_trajectories(sim, 2, both) == MASS_NO_SUCH_INDEX);
  EXPECT(mass_set_step(sim, 0.01) == MASS_OK && mass_start(sim) == MASS_OK);
  EXPECT(mass_set_input_trajectories(sim, 1, &trajectory) == MASS_OK);
  EXPECT(mass_adjoint_sensitivities(sim, steps, 1, &x, steps, 1, weights, values, tape, steps + 2, by_state, by_input, by_parameter) == MASS_OK);
  for (i = 0; i < 8; ++i) {
    const double wanted = known(i < 4 ? 0.0 : 0.4, i < 4 ? 0.4 : 1.0, i % 4);
    EXPECT(fabs(derivatives[i] - wanted) < (i % 4 < 3 ? 1e-14 : 1e-10)); /* steps of rk4 have parabolas exactly */
    found += derivatives[i] * numbers[i];
  }
  EXPECT(fabs(found - values[1]) < 1e-13 && fabs(by_input[0] - derivatives[0] - derivatives[4]) < 1e-14);
  EXPECT(mass_start(sim) == MASS_OK && mass_set_input_trajectories(sim, 1, &trajectory) == MASS_OK);
  EXPECT(mass_forward_sensitivities(sim, steps, 1, &none, matrix, 1, &x, steps, back, along) == MASS_OK && back[1] == values[1]);
  for (found = 0.0, i = 0; i < 8; ++i) found += derivatives[i] * changes[i];
  EXPECT(fabs(found - along[1]) < 1e-14);
  EXPECT(mass_start(sim) == MASS_OK && mass_run(sim, steps, NULL) == MASS_OK && mass_outputs(sim)[x] == 0.0); /* of their run alone */
  return faults;
}
