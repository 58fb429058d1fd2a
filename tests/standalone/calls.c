/* Calls of the C interface of the press as a host makes them, right and wrong ones; prints what went wrong, and returns how often. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "press.h"

static double memory[2][PRESS_SIZE / sizeof(double)];
static int faults = 0;

#define EXPECT(condition)                                        \
  do {                                                           \
    if (!(condition)) printf("line %d: %s\n", __LINE__, #condition), ++faults; \
  } while (0)

static void wrong_calls(void) {
  double q[PRESS_COORDINATES + 1] = {0}, v[PRESS_SPEEDS + 1] = {0};
  char text[200], small[8];
  press_step_statistics statistics;
  press_sim* sim = press_create(memory[0], sizeof memory[0]);
  EXPECT(press_create(NULL, PRESS_SIZE) == NULL);
  EXPECT(press_create(memory[1], 100) == NULL);
  EXPECT(press_step(NULL) == PRESS_NO_SIMULATION);
  memset(memory[1], 0, sizeof memory[1]);
  EXPECT(press_step((press_sim*)memory[1]) == PRESS_NO_SIMULATION);
  EXPECT(press_step(sim) == PRESS_NOT_STARTED);
  EXPECT(press_advance(sim, 1.0) == PRESS_NOT_STARTED);
  EXPECT(press_outputs(sim) == NULL && press_coordinates(sim) == NULL);
  EXPECT(press_save(sim, text) == PRESS_NOT_STARTED);
  EXPECT(press_set_parameter(sim, PRESS_PARAMETERS, 1.0) == PRESS_NO_SUCH_INDEX);
  EXPECT(press_set_parameter(sim, -1, 1.0) == PRESS_NO_SUCH_INDEX);
  EXPECT(press_set_parameter(sim, 0, NAN) == PRESS_NOT_FINITE);
  EXPECT(press_set_start_coordinate(sim, PRESS_START_COORDINATES, 0.0) == PRESS_NO_SUCH_INDEX);
  EXPECT(press_set_start_speed(sim, 0, INFINITY) == PRESS_NOT_FINITE);
  EXPECT(press_set_step(sim, 0.0) == PRESS_NOT_FINITE);
  EXPECT(press_set_iterations(sim, -1) == PRESS_NOT_FINITE);
  EXPECT(press_last_step(sim, &statistics) == PRESS_NOT_STARTED && press_last_step(NULL, &statistics) == PRESS_NO_SIMULATION);
  EXPECT(press_set_limit(sim, -1, 1.0) == PRESS_NO_SUCH_INDEX && press_set_limit(sim, PRESS_LIMIT_EVALUATIONS + 1, 1.0) == PRESS_NO_SUCH_INDEX);
  EXPECT(press_set_limit(sim, PRESS_LIMIT_VIOLATION, NAN) == PRESS_NOT_FINITE && press_set_limit(sim, PRESS_LIMIT_VIOLATION, -1.0) == PRESS_NOT_FINITE);
  EXPECT(press_start(sim) == PRESS_OK);
  EXPECT(press_last_step(sim, NULL) == PRESS_NO_ARRAY && press_last_step(sim, &statistics) == PRESS_OK && statistics.iterations == 0);
  EXPECT(press_advance(sim, NAN) == PRESS_NOT_FINITE);
  EXPECT(press_advance(sim, -1.0) == PRESS_TIME_PASSED);
  EXPECT(press_set_state(sim, 0.0, NULL, v) == PRESS_NO_ARRAY);
  q[0] = NAN;
  EXPECT(press_set_state(sim, 0.0, q, v) == PRESS_NOT_FINITE);
  EXPECT(press_restore(sim, q, sizeof q) == PRESS_NO_ARRAY && press_restore(sim, NULL, press_snapshot_size()) == PRESS_NO_ARRAY);
  EXPECT(press_output_name(PRESS_OUTPUTS) == NULL && press_output_name(-1) == NULL && press_parameter_unit(1000) == NULL);
  EXPECT(press_find_output("nothing") == -1 && press_find_output(NULL) == -1);
  EXPECT(press_find_output(press_output_name(1)) == 1);
  EXPECT(press_find_start_coordinate(press_start_coordinate_name(1)) == 1 && press_start_coordinate_name(PRESS_START_COORDINATES) == NULL);
  EXPECT(press_find_start_speed(press_start_speed_name(1)) == 1 && press_start_speed_name(PRESS_START_SPEEDS) == NULL);
  EXPECT(press_failure_text(sim, NULL, 10) == PRESS_NO_ARRAY && press_failure_text(NULL, NULL, 10) == PRESS_NO_SIMULATION);
  EXPECT(press_failure_text(NULL, text, sizeof text) == PRESS_NO_SIMULATION && strcmp(text, press_status_text(PRESS_NO_SIMULATION)) == 0);
  EXPECT(press_failure_text(sim, small, sizeof small) == PRESS_OK && strlen(small) == sizeof small - 1);
  EXPECT(press_failure_text(sim, text, sizeof text) == PRESS_OK && strncmp(text, "no start or step has failed; ", 29) == 0 && strcmp(press_status_text(PRESS_OK), "success") == 0);
  EXPECT(strlen(press_status_text(PRESS_NOT_STARTED)) > 0 && strlen(press_status_text(12345)) > 0);
}

/* A step beyond a limit is made, and reported. */
static void limits(void) {
  press_step_statistics statistics;
  char text[200];
  press_sim* sim = press_create(memory[0], sizeof memory[0]);
  EXPECT(press_set_limit(sim, PRESS_LIMIT_ITERATIONS, 1.0) == PRESS_OK && press_set_step(sim, 1e-3) == PRESS_OK && press_start(sim) == PRESS_OK);
  EXPECT(press_step(sim) == PRESS_LIMIT_EXCEEDED && fabs(press_time(sim) - 1e-3) < 1e-12);
  EXPECT(press_failure_text(sim, text, sizeof text) == PRESS_OK && strstr(text, "a step exceeds a limit: 'iterations' is ") == text);
  EXPECT(press_last_step(sim, &statistics) == PRESS_OK && statistics.iterations > 1 && statistics.evaluations >= statistics.iterations);
  EXPECT(statistics.pivot > 0.0 && statistics.equation >= 0 && statistics.violation <= 1e-9 && statistics.violation == press_constraint_violation(sim, NULL));
  EXPECT(press_set_limit(sim, PRESS_LIMIT_ITERATIONS, INFINITY) == PRESS_OK && press_step(sim) == PRESS_OK);
}

/* Two simulations whose steps alternate are as two that have the program for themselves. */
static void independence(void) {
  double alone[2];
  int which, i;
  press_sim* sims[2];
  for (which = 0; which < 2; ++which) {
    press_sim* sim = press_create(memory[0], sizeof memory[0]);
    EXPECT(press_set_step(sim, which ? 1e-3 : 2e-3) == PRESS_OK && press_start(sim) == PRESS_OK && press_run(sim, 100, NULL) == PRESS_OK);
    alone[which] = press_outputs(sim)[0];
  }
  for (which = 0; which < 2; ++which) {
    sims[which] = press_create(memory[which], sizeof memory[which]);
    EXPECT(press_set_step(sims[which], which ? 1e-3 : 2e-3) == PRESS_OK && press_start(sims[which]) == PRESS_OK);
  }
  for (i = 0; i < 100; ++i)
    for (which = 0; which < 2; ++which) EXPECT(press_step(sims[which]) == PRESS_OK);
  for (which = 0; which < 2; ++which) EXPECT(press_outputs(sims[which])[0] == alone[which]);
}

/* What is restored goes on bit by bit, in another simulation too. */
static void snapshots(void) {
  static char snapshot[100000];
  double first[PRESS_OUTPUTS];
  press_sim *sim = press_create(memory[0], sizeof memory[0]), *other = press_create((char*)memory[1] + 8, sizeof memory[1] - 8);
  EXPECT(press_snapshot_size() <= sizeof snapshot);
  EXPECT(press_start(sim) == PRESS_OK && press_run(sim, 10, NULL) == PRESS_OK && press_save(sim, snapshot) == PRESS_OK);
  EXPECT(press_run(sim, 50, NULL) == PRESS_OK);
  memcpy(first, press_outputs(sim), sizeof first);
  EXPECT(other && press_restore(other, snapshot, press_snapshot_size() - 1) == PRESS_NO_ARRAY &&
         press_restore(other, snapshot, press_snapshot_size()) == PRESS_OK && press_run(other, 50, NULL) == PRESS_OK);
  EXPECT(memcmp(first, press_outputs(other), sizeof first) == 0 && press_time(sim) == press_time(other));
}

int main(void) {
  wrong_calls();
  limits();
  independence();
  snapshots();
  return faults;
}
