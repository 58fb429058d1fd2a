/* A Kalman filter whose prediction is a simulation of the crane, and state feedback: what runs on a target. */
#include "observer.h"

#include "gains.h" /* from observer_gains.py; its states have the order of the outputs of sway.yaml */

/* State feedback, with the limits of the motor. */
static double feed_back(const double* estimate, double goal) {
  const double most = 1500.0; /* N */
  double force = feedback[0] * goal;
  int i;
  for (i = 0; i < SWAY_OUTPUTS; ++i) { force -= feedback[i] * estimate[i]; }
  if (force > most) { force = most; }
  return (force < -most) ? -most : force;
}

/* Forces that move the estimate, within the next step, by the gain of the filter times the error. */
static int correct(sway_sim* model, double error) {
  const double* const w = correction;
  int status = sway_set_input(model, SWAY_INPUT_trolley_correction, w[0] * error, w[2] * error, 0.0);
  if (status == SWAY_OK) { status = sway_set_input(model, SWAY_INPUT_rope_correction, w[1] * error, w[3] * error, 0.0); }
  return status;
}

int observer_start(observer* self) { return sway_start(sway_create(&self->model, sizeof(self->model))); }

int observer_sample(observer* self, double measured, double goal, bool corrects, double* push) {
  const double* const estimate = sway_outputs(&self->model); /* NULL before the start */
  int status = SWAY_NOT_STARTED;
  double force = 0.0;
  if (estimate != NULL) {
    force = feed_back(estimate, goal);
    status = correct(&self->model, corrects ? (measured - estimate[SWAY_OUTPUT_trolley_x]) : 0.0);
  }
  if (status == SWAY_OK) { status = sway_set_input(&self->model, SWAY_INPUT_push, force, 0.0, 0.0); }
  if (status == SWAY_OK) { status = sway_step(&self->model); }
  *push = (status == SWAY_OK) ? force : 0.0;
  return status;
}
