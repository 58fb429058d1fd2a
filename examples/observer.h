/* The controller of a crane: from the measured position of its trolley to the force of its motor. */
#ifndef OBSERVER_H
#define OBSERVER_H

#include "sway.h"

/* All of its memory. The outputs of `model` are the estimates. */
typedef struct observer {
  sway_sim model;
} observer;

/* Start with an estimate at rest at 0. Returns a status of sway.h, as does observer_sample. */
int observer_start(observer* self);

/* Call it every SWAY_STEP seconds. `push` (N) is the force until the next call, which moves the trolley to `goal` (m); 0 if the call fails,
   which changes no estimate. `measured` (m) corrects the estimates if `corrects`. The estimates are afterwards those of the next call. */
int observer_sample(observer* self, double measured, double goal, bool corrects, double* push);

#endif
