/* Steering and speed control of the Iltis at 1 kHz, in one program:

       cutjoint compile models/iltis.yaml --scene simul3 --out iltis
       cmake -S iltis -B iltis/out && cmake --build iltis/out
       cc -Iiltis examples/steer.c iltis/out/libiltis.a -lm -lmvec -o steer && ./steer */
#include <stdio.h>

#include "driver.h"
#include "iltis.h"

static double memory[ILTIS_SIZE / sizeof(double)];

int main(void) {
  iltis_sim* sim = iltis_create(memory, sizeof memory);
  const int rack = iltis_find_input("rack_displacement"), speed = iltis_find_parameter("speed");
  const int y = iltis_find_output("chassis.y"), yaw = iltis_find_output("chassis.yaw"), vx = iltis_find_output("chassis.vx");
  int status, step;
  iltis_set_step(sim, 1e-3);
  iltis_set_input(sim, rack, 0.0, 0.0, 0.0);
  status = iltis_start(sim);
  for (step = 0; status == ILTIS_OK && step <= 10000; ++step) {
    const double* out = iltis_outputs(sim);
    const double t = iltis_time(sim);
    if (step % 1000 == 0) printf("t = %2.0f s: %6.3f m to the left, yaw %7.4f rad, %5.2f m/s\n", t, out[y], out[yaw], out[vx]);
    iltis_set_input(sim, rack, driver_rack(t, out[y], out[yaw]), 0.0, 0.0);
    iltis_set_parameter(sim, speed, driver_speed(t));
    status = iltis_step(sim);
  }
  if (status != ILTIS_OK) {
    char text[400];
    iltis_failure_text(sim, text, sizeof text);
    fprintf(stderr, "%s\n", text);
  }
  return status != ILTIS_OK;
}
