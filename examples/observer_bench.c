/* A bench for the controller of observer.c: a crane with other parameters, a load that swings at the start, and an encoder with noise.
   With an argument it prints every sample: time; of the crane position, angle and their rates; the same of the observer; force. */
#include <math.h>
#include <stdint.h>
#include <stdio.h>

#include "observer.h"

enum { samples = 1000, settled = 250 };
static const double goal = 4.0, degree = 57.29577951308232;

static sway_sim crane;
static observer controller;

/* Noise of 2 mm at most, the same in each run. */
static double noise(uint32_t* seed) {
  *seed = (uint32_t)(1664525U * *seed + 1013904223U);
  return 4e-3 * ((double)*seed / 4294967296.0 - 0.5);
}

/* The crane with a load that swings, of which the controller knows nothing. */
static int start_crane(void) {
  static const double q[] = {0.0, 0.08}, v[] = {-0.1, 0.1};
  sway_sim* sim = sway_create(&crane, sizeof crane);
  int status = sway_set_parameter(sim, SWAY_PARAMETER_drag, 330.0);
  if (status == SWAY_OK) { status = sway_set_parameter(sim, SWAY_PARAMETER_load_mass, 1050.0); }
  if (status == SWAY_OK) { status = sway_start(sim); }
  return (status == SWAY_OK) ? sway_set_state(sim, 0.0, q, v) : status;
}

/* One drive: the largest error of the estimated angle after five seconds (rad), and where the trolley ends (m). */
static int drive(bool corrects, bool prints, double* worst, double* end) {
  const double* const x = sway_outputs(&crane); /* present values, also later */
  const double* const estimate = sway_outputs(&controller.model);
  uint32_t seed = 1;
  int status = SWAY_OK, k, i;
  *worst = 0.0;
  for (k = 0; (status == SWAY_OK) && (k < samples); ++k) {
    double push;
    status = observer_sample(&controller, x[SWAY_OUTPUT_trolley_x] + noise(&seed), goal, corrects, &push);
    if (status == SWAY_OK) { status = sway_set_input(&crane, SWAY_INPUT_push, push, 0.0, 0.0); }
    if (status == SWAY_OK) { status = sway_step(&crane); }
    if (status != SWAY_OK) { break; }
    (void)sway_outputs(&crane);
    (void)sway_outputs(&controller.model);
    if (k >= settled) { *worst = fmax(*worst, fabs(estimate[SWAY_OUTPUT_rope_angle] - x[SWAY_OUTPUT_rope_angle])); }
    if (prints) {
      printf("%.2f", (k + 1) * SWAY_STEP);
      for (i = 0; i < SWAY_OUTPUTS; ++i) { printf(" %.12g", x[i]); }
      for (i = 0; i < SWAY_OUTPUTS; ++i) { printf(" %.12g", estimate[i]); }
      printf(" %.12g\n", push);
    }
  }
  *end = x[SWAY_OUTPUT_trolley_x];
  return status;
}

int main(int count, char** arguments) {
  int status = SWAY_OK, corrects;
  (void)arguments;
  for (corrects = 1; (status == SWAY_OK) && (corrects >= 0); --corrects) {
    double worst = 0.0, end = 0.0;
    status = start_crane();
    if (status == SWAY_OK) { status = observer_start(&controller); }
    if (status == SWAY_OK) { status = drive(corrects == 1, count > 1, &worst, &end); }
    if (count == 1) {
      printf("%s: sway known within %.2f degrees after 5 s, trolley at %.3f m of %.0f m after 20 s\n",
             (corrects == 1) ? "with corrections" : "without them", worst * degree, end, goal);
    }
  }
  if (status != SWAY_OK) { fprintf(stderr, "%s\n", sway_status_text(status)); }
  return status != SWAY_OK;
}
