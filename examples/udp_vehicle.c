/* The Iltis of steer.c, whose driver is another process: sends time, offset to the left, yaw and speed as four doubles to a UDP port of this
   machine, waits for the rack's displacement and the speed to hold, and takes a step of 1 ms.

       cc -Iiltis examples/udp_vehicle.c iltis/out/libiltis.a -lm -lmvec -o udp_vehicle
       python examples/udp_driver.py ./udp_vehicle */
#define _POSIX_C_SOURCE 200112L
#include <arpa/inet.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <sys/time.h>

#include "iltis.h"

static double memory[ILTIS_SIZE / sizeof(double)];

int main(int argc, char** argv) {
  iltis_sim* sim = iltis_create(memory, sizeof memory);
  const int rack = iltis_find_input("rack_displacement"), speed = iltis_find_parameter("speed");
  const int columns[3] = {iltis_find_output("chassis.y"), iltis_find_output("chassis.yaw"), iltis_find_output("chassis.vx")};
  const struct timeval patience = {5, 0};
  struct sockaddr_in driver = {0};
  const int line = socket(AF_INET, SOCK_DGRAM, 0);
  int status, step, i;
  driver.sin_family = AF_INET;
  driver.sin_port = htons((unsigned short)(argc > 1 ? atoi(argv[1]) : 0));
  driver.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  if (argc != 2 || line < 0 || connect(line, (struct sockaddr*)&driver, sizeof driver) != 0) return 2;
  setsockopt(line, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
  iltis_set_step(sim, 1e-3);
  iltis_set_input(sim, rack, 0.0, 0.0, 0.0);
  status = iltis_start(sim);
  for (step = 0; status == ILTIS_OK && step < 10000; ++step) {
    double message[4], command[2];
    message[0] = iltis_time(sim);
    for (i = 0; i < 3; ++i) message[i + 1] = iltis_outputs(sim)[columns[i]];
    if (send(line, message, sizeof message, 0) != sizeof message || recv(line, command, sizeof command, 0) != sizeof command) return 3;
    iltis_set_input(sim, rack, command[0], 0.0, 0.0);
    iltis_set_parameter(sim, speed, command[1]);
    status = iltis_step(sim);
  }
  printf("t = %.3f s: %.17g m to the left\n", iltis_time(sim), iltis_outputs(sim)[columns[0]]);
  return status != ILTIS_OK;
}
