/* The vehicle of udp_vehicle.c against the clock: a timer wakes it each millisecond; it takes the last command that has come by UDP, a step of fixed
   cost, and sends where it is.  It never waits for its driver.

       cc -Iiltis examples/paced_vehicle.c iltis/out/libiltis.a -lm -lmvec -o paced_vehicle
       python examples/udp_driver.py ./paced_vehicle 10

   A folder that is compiled with --poses is seen while it drives:

       cutjoint view models/iltis.yaml --scene simul3 --live 5005
       python examples/udp_driver.py ./paced_vehicle 10 5005

   Where the timer has run on, up to MOST steps are made at once to catch up; of a longer stall the rest is dropped, and the simulation's clock is late by
   that from then on.  With the right to it (ulimit -r, ulimit -l) the program has real-time priority and its memory is locked; else it says so. */
#define _GNU_SOURCE
#include <arpa/inet.h>
#include <sched.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/timerfd.h>
#include <time.h>
#include <unistd.h>

#include "iltis.h"

#define PERIOD 1000000 /* ns */
#define MOST 10

static double memory[ILTIS_SIZE / sizeof(double)];

static double now(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* A line to a port of this machine that never waits, -1 where there is none. */
static int line_to(int port) {
  struct sockaddr_in other = {0};
  const int line = socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK, 0);
  other.sin_family = AF_INET;
  other.sin_port = htons((unsigned short)port);
  other.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  return line >= 0 && connect(line, (struct sockaddr*)&other, sizeof other) == 0 ? line : -1;
}

/* Poses for `cutjoint view --live`; what nobody takes is lost. */
static void show(int line, iltis_sim* sim) {
#ifdef ILTIS_POSES
  struct {
    uint64_t digest;
    double time;
    iltis_pose poses[ILTIS_POSES];
  } seen = {.digest = ILTIS_POSES_DIGEST, .time = iltis_time(sim)};
  memcpy(seen.poses, iltis_poses(sim), sizeof seen.poses);
  send(line, &seen, sizeof seen, 0);
#else
  (void)line, (void)sim;
#endif
}

int main(int argc, char** argv) {
  const double end = argc > 2 ? atof(argv[2]) : 10.0;
  const int columns[3] = {ILTIS_OUTPUT_chassis_y, ILTIS_OUTPUT_chassis_yaw, ILTIS_OUTPUT_chassis_vx};
  const struct itimerspec pace = {{0, PERIOD}, {0, PERIOD}};
  const struct sched_param priority = {.sched_priority = 50};
  const int line = argc > 1 ? line_to(atoi(argv[1])) : -1, viewer = argc > 3 ? line_to(atoi(argv[3])) : -1, timer = timerfd_create(CLOCK_MONOTONIC, 0);
  iltis_sim* sim = iltis_create(memory, sizeof memory);
  long caught_up = 0, dropped = 0, shown = 0;
  double longest = 0.0;
  int status, i;
  if (timer < 0 || line < 0) return 2;
  iltis_set_step(sim, 1e-9 * PERIOD);
  iltis_set_iterations(sim, 6);
  iltis_set_input(sim, ILTIS_INPUT_rack_displacement, 0.0, 0.0, 0.0);
  status = iltis_start(sim);
  if (mlockall(MCL_CURRENT) != 0) fputs("the memory is not locked\n", stderr);
  if (sched_setscheduler(0, SCHED_FIFO, &priority) != 0) fputs("no real-time priority\n", stderr);
  timerfd_settime(timer, 0, &pace, NULL);
  while (status == ILTIS_OK && iltis_time(sim) < end - 0.5e-9 * PERIOD) {
    double message[4], command[2];
    uint64_t due;
    if (read(timer, &due, sizeof due) != (ssize_t)sizeof due) return 3;
    if (due > MOST) {
      dropped += (long)due - MOST;
      due = MOST;
    }
    caught_up += (long)due - 1;
    while (recv(line, command, sizeof command, 0) == sizeof command) {
      iltis_set_input(sim, ILTIS_INPUT_rack_displacement, command[0], 0.0, 0.0);
      iltis_set_parameter(sim, ILTIS_PARAMETER_speed, command[1]);
    }
    for (; due > 0 && status == ILTIS_OK; --due) {
      const double begun = now();
      status = iltis_step(sim);
      if (now() - begun > longest) longest = now() - begun;
    }
    message[0] = iltis_time(sim);
    for (i = 0; i < 3; ++i) message[i + 1] = iltis_outputs(sim)[columns[i]];
    send(line, message, sizeof message, 0);
    if (viewer >= 0 && ++shown % 16 == 0) show(viewer, sim);
  }
  printf("t = %.3f s: %.17g m to the left; longest step %.3f ms, %ld steps caught up, %ld dropped\n", iltis_time(sim), iltis_outputs(sim)[columns[0]],
         1e3 * longest, caught_up, dropped);
  return status != ILTIS_OK;
}
