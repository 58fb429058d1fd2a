/* Calls of the C interface in random order with random arguments, right and wrong ones: as many as the first argument says. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "press.h"
#ifndef ADAPTIVE
#define press_set_max_steps(sim, steps)
#endif

static double memory[PRESS_SIZE / sizeof(double)];
static double jacobian[PRESS_EQUATIONS * PRESS_SPEEDS + 1];
static char snapshot[100000];
static double rows[20 * (PRESS_OUTPUTS + 1)];

static double number(void) {
  static const double some[] = {0.0, 1.0, -1.0, 1e-3, 1e300, -1e-300};
  switch (rand() % 8) {
    case 0: return NAN;
    case 1: return INFINITY;
    case 2: return some[rand() % 6];
    default: return 2.0 * rand() / RAND_MAX - 1.0;
  }
}

static int call(press_sim* sim) {
  double q[PRESS_COORDINATES + 1], v[PRESS_SPEEDS + 1];
  char text[300];
  press_step_statistics statistics;
  int i;
  switch (rand() % 28) {
    case 0:
      if (!press_create(memory, sizeof memory)) return 1;
      press_set_max_steps(sim, 100);
      return 0;
    case 1: return press_start(sim);
    case 2: return press_set_step(sim, rand() % 2 ? 1e-3 : number());
#ifdef PRESS_EVENTS
    case 3:
      press_next_time(sim);
      return press_advance_to_event(sim, rand() % 4 ? press_time(sim) + 0.01 * rand() / RAND_MAX : number(), rand() % 8 ? &i : NULL);
#else
    case 3: return press_set_iterations(sim, rand() % 30 - 2);
#endif
    case 4: return press_set_equilibrium(sim, rand() % 8 == 0);
    case 5: return press_set_parameter(sim, rand() % (PRESS_PARAMETERS + 2) - 1, rand() % 2 ? 1.0 + rand() % 5 : number());
    case 6: return press_set_start_coordinate(sim, rand() % (PRESS_START_COORDINATES + 2) - 1, number());
    case 7: return rand() % 4 ? press_set_start_speed(sim, rand() % (PRESS_START_SPEEDS + 2) - 1, number()) : press_reset_start(sim);
    case 8: return press_advance(sim, rand() % 4 ? press_time(sim) + 0.01 * rand() / RAND_MAX : number());
    case 9: return press_run(sim, rand() % 20, rand() % 2 ? rows : NULL);
    case 10:
      for (i = 0; i < PRESS_COORDINATES; ++i) q[i] = number();
      for (i = 0; i < PRESS_SPEEDS; ++i) v[i] = number();
      return press_set_state(sim, number(), rand() % 8 ? q : NULL, v);
    case 11: return press_save(sim, snapshot);
    case 26: return press_last_step(sim, rand() % 8 ? &statistics : NULL);
    case 27: return press_set_limit(sim, rand() % 8 - 1, rand() % 2 ? INFINITY : number());
    case 12: return press_restore(sim, snapshot, press_snapshot_size());
    case 13: return press_failure_text(sim, text, (size_t)(rand() % 300));
    case 14: return press_status_text(rand() % 40 - 10) != NULL;
    case 15: return press_outputs(sim) != NULL && press_speeds(sim) != NULL && press_multipliers(sim) != NULL;
    case 16: return press_output_name(rand() % 20 - 5) != NULL && press_equation_name(rand() % 20 - 5) != NULL;
    case 24:
      for (i = 0; i < PRESS_SPEEDS; ++i) v[i] = 0.01 * number();
      return press_displace(sim, v);
    case 25: return press_constraint_jacobian(sim, rand() % 8 ? jacobian : NULL);
    default: return press_step(rand() % 50 ? sim : NULL);
  }
}

int main(int argc, char** argv) {
  const long calls = argc > 1 ? atol(argv[1]) : 1000;
  press_sim* sim = press_create(memory, sizeof memory);
  long i, good = 0;
  srand(1);
  for (i = 0; i < calls; ++i) {
    if (i % 500 == 0) {  /* what is given may be out of this world by now */
      sim = press_create(memory, sizeof memory);
      press_set_max_steps(sim, 100);
      press_start(sim);
    }
    good += call(sim) == PRESS_OK;
  }
  printf("%ld of %ld calls\n", good, calls);
  return 0;
}
