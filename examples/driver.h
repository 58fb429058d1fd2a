/* A driver of the Iltis: changes by 2 m to the left after 2 s and speeds up to 7 m/s.  The rack moves to the right for positive values. */
#ifndef DRIVER_H
#define DRIVER_H

#define DRIVER_LEFT 2.0
#define DRIVER_SPEED 7.0

/* The rack's displacement (m) by time (s), the vehicle's offset to the left (m) and its yaw (rad). */
static double driver_rack(double t, double y, double yaw) {
  const double wanted = t < 2.0 ? 0.0 : t < 5.0 ? DRIVER_LEFT * (t - 2.0) / 3.0 : DRIVER_LEFT;
  const double rack = 0.01 * (y - wanted) + 0.05 * yaw;
  return rack > 0.03 ? 0.03 : rack < -0.03 ? -0.03 : rack;
}

/* The speed (m/s) that the speed controller is to hold. */
static double driver_speed(double t) { return t < 1.0 ? 5.0 : t < 4.0 ? 5.0 + (DRIVER_SPEED - 5.0) * (t - 1.0) / 3.0 : DRIVER_SPEED; }

#endif
