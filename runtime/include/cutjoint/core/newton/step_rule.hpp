// The rule of a step by Newton's iteration.
#pragma once

namespace cutjoint {

/// The rule of a step, with auxiliary accelerations a,
///
///     (1 - alpha_m) a + alpha_m a_n = (1 - alpha_f) vdot + alpha_f vdot_n
///     v = v_n + dt ((1 - gamma) a_n + gamma a)         q = q_n + dt v_n + dt^2 ((1/2 - beta) a_n + beta a)
///
/// The trapezoidal rule has a = vdot.
struct StepRule {
  double alpha_m = 0.0, alpha_f = 0.0, beta = 0.25, gamma = 0.5;

  bool averages() const { return alpha_m != 0.0 || alpha_f != 0.0; }
};

/// The generalised-alpha method, of order 2.  `radius` (0 to 1) is the spectral radius at infinite frequency; low-frequency damping
/// is minimal for it.  Source: Chung, Hulbert, J. Appl. Mech. 60 (1993) 371-375.
inline StepRule generalised_alpha(double radius) {
  const double alpha_m = (2 * radius - 1) / (radius + 1), alpha_f = radius / (radius + 1), gamma = 0.5 - alpha_m + alpha_f;
  return {.alpha_m = alpha_m, .alpha_f = alpha_f, .beta = (gamma + 0.5) * (gamma + 0.5) / 4, .gamma = gamma};
}

}  // namespace cutjoint
