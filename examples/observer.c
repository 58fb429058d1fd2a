/* A Kalman filter whose prediction is a simulation of the crane, and state feedback: what runs on a target. */
#include "observer.h"

#include "gains.h" /* from observer_gains.py */

/* State feedback, with the limits of the motor. */
static double feed_back(const double* q, const double* v, double goal) {
  const double most = 1500.0; /* N */
  double force = feedback[0] * goal;
  int i;
  for (i = 0; i < SWAY_COORDINATES; ++i) { force -= (feedback[i] * q[i]) + (feedback[SWAY_COORDINATES + i] * v[i]); }
  if (force > most) { force = most; }
  return (force < -most) ? -most : force;
}

/* Move the estimate by the gain of the filter times the error, unless only a broken encoder can explain it. */
static int correct(sway_sim* model, double error) {
  const double most = 0.5; /* m, far more than the filter is ever wrong */
  double q[SWAY_COORDINATES];
  double v[SWAY_SPEEDS];
  int i;
  for (i = 0; i < SWAY_COORDINATES; ++i) {
    q[i] = sway_coordinates(model)[i] + (gain[i] * error);
    v[i] = sway_speeds(model)[i] + (gain[SWAY_COORDINATES + i] * error);
  }
  return ((error > -most) && (error < most)) ? sway_set_state(model, sway_time(model), q, v) : SWAY_NOT_FINITE;
}

int observer_start(observer* self) { return sway_start(sway_create(&self->model, sizeof(self->model))); }

int observer_sample(observer* self, double measured, double goal, bool corrects, double* push) {
  const double* const q = sway_coordinates(&self->model); /* of rail and rope: the estimate; NULL before the start */
  int status = SWAY_NOT_STARTED;
  double force = 0.0;
  if (q != NULL) {
    const sway_sim before = self->model;
    force = feed_back(q, sway_speeds(&self->model), goal);
    status = sway_set_input(&self->model, SWAY_INPUT_push, force, 0.0, 0.0);
    if ((status == SWAY_OK) && corrects) { status = correct(&self->model, measured - q[0]); }
    if (status == SWAY_OK) { status = sway_step(&self->model); }
    if (status != SWAY_OK) { self->model = before; }
  }
  *push = (status == SWAY_OK) ? force : 0.0;
  return status;
}
