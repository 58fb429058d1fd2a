/* The Iltis on a terrain of its host, against the clock: a timer wakes it each 5 ms; it takes the last command that has come by UDP, gives each wheel
   the ground under it, takes a step of fixed cost, and sends where it is.  It never waits for its driver.

       cutjoint compile models/iltis.yaml --scene simul3 --terrain '*' --poses --out iltis
       cmake -S iltis -B iltis/out && cmake --build iltis/out
       cc -Iiltis examples/paced_vehicle.c iltis/out/libiltis.a -lm -lmvec -o paced_vehicle
       python examples/udp_driver.py ./paced_vehicle 10

   A third argument is the port of a viewer, to which it sends the poses of all bodies:

       cutjoint view models/iltis.yaml --scene simul3 --live 5005
       python examples/udp_driver.py ./paced_vehicle 10 5005

   Where the timer has run on, up to MOST steps are made at once to catch up; of a longer stall the rest is dropped, and the simulation's clock is late by
   that from then on.  With the right to it (ulimit -r, ulimit -l) the program has real-time priority and its memory is locked; else it says so. */
#define _GNU_SOURCE
#include <arpa/inet.h>
#include <math.h>
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

#define PERIOD 5000000 /* ns */
#define MOST 10

static double memory[ILTIS_SIZE / sizeof(double)];

/* Each wheel's pose, and the first of its inputs: height, slope, bank and friction follow one another. */
static const int wheels[4][2] = {
    {ILTIS_POSE_OF_front_left_carrier, ILTIS_INPUT_front_left_tyre_terrain_height},
    {ILTIS_POSE_OF_front_right_carrier, ILTIS_INPUT_front_right_tyre_terrain_height},
    {ILTIS_POSE_OF_rear_left_carrier, ILTIS_INPUT_rear_left_tyre_terrain_height},
    {ILTIS_POSE_OF_rear_right_carrier, ILTIS_INPUT_rear_right_tyre_terrain_height},
};

static double now(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* The terrain: waves of 40 mm from x = 2 m on; height (m), and slopes along x and y. */
static void ground(double x, double y, double* height, double* slope, double* bank) {
  const double along = x > 2.0 ? 0.02 * (1.0 - cos(0.8 * (x - 2.0))) : 0.0, across = cos(0.3 * y);
  *height = along * across;
  *slope = x > 2.0 ? 0.016 * sin(0.8 * (x - 2.0)) * across : 0.0;
  *bank = -0.3 * along * sin(0.3 * y);
}

static void give_ground(iltis_sim* sim) {
  const iltis_pose* poses = iltis_poses(sim);
  int i;
  for (i = 0; i < 4; ++i) {
    const iltis_pose* hub = &poses[wheels[i][0]];
    double height, slope, bank;
    ground(hub->position[0], hub->position[1], &height, &slope, &bank);
    iltis_set_input(sim, wheels[i][1], height, slope * hub->velocity[0] + bank * hub->velocity[1], 0.0);
    iltis_set_input(sim, wheels[i][1] + 1, slope, 0.0, 0.0);
    iltis_set_input(sim, wheels[i][1] + 2, bank, 0.0, 0.0);
  }
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
  struct {
    uint64_t digest;
    double time;
    iltis_pose poses[ILTIS_POSES];
  } seen = {.digest = ILTIS_POSES_DIGEST, .time = iltis_time(sim)};
  memcpy(seen.poses, iltis_poses(sim), sizeof seen.poses);
  send(line, &seen, sizeof seen, 0);
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
  if (argc < 2) return fprintf(stderr, "usage: %s PORT-OF-THE-DRIVER [SECONDS [PORT-OF-A-VIEWER]]; udp_driver.py calls it so\n", argv[0]), 2;
  if (timer < 0 || line < 0) return perror(argv[0]), 2;
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
    if (read(timer, &due, sizeof due) != (ssize_t)sizeof due) return perror("timer"), 3;
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
      give_ground(sim);
      status = iltis_step(sim);
      if (now() - begun > longest) longest = now() - begun;
    }
    message[0] = iltis_time(sim);
    for (i = 0; i < 3; ++i) message[i + 1] = iltis_outputs(sim)[columns[i]];
    send(line, message, sizeof message, 0);
    if (viewer >= 0 && ++shown % 4 == 0) show(viewer, sim);
  }
  if (status != ILTIS_OK) {
    char text[400];
    iltis_failure_text(sim, text, sizeof text);
    fprintf(stderr, "%s\n", text);
  }
  printf("t = %.3f s: %.17g m to the left; longest step %.3f ms, %ld steps caught up, %ld dropped\n", iltis_time(sim), iltis_outputs(sim)[columns[0]],
         1e3 * longest, caught_up, dropped);
  return status != ILTIS_OK;
}
