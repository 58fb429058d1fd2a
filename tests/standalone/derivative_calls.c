/* Calls of the derivatives of the press, right and wrong ones; prints what went wrong, and returns how often. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "press.h"

enum { n = PRESS_STATES, outputs = PRESS_OUTPUTS };

static double memory[2][PRESS_SIZE / sizeof(double)];
static int faults = 0;

#define EXPECT(condition)                                        \
  do {                                                           \
    if (!(condition)) printf("line %d: %s\n", __LINE__, #condition), ++faults; \
  } while (0)

static const double not_a_number = NAN;
static double X[n * n], P[n * PRESS_PARAMETERS + 1], A[n * n], C[outputs * n], dx[n], rates[n], y[outputs + 1];

static void wrong_calls(void) {
  press_sim* sim = press_create(memory[0], sizeof memory[0]);
  int speeds[PRESS_DEGREES_OF_FREEDOM] = {PRESS_SPEEDS};
  EXPECT(press_linearise(NULL, A, NULL, C, NULL) == PRESS_NO_SIMULATION);
  EXPECT(press_linearise(sim, A, NULL, C, NULL) == PRESS_NOT_STARTED);
  EXPECT(press_directional_derivative(sim, dx, NULL, rates, y) == PRESS_NOT_STARTED);
  EXPECT(press_choose_independent_speeds(sim, speeds) == PRESS_NOT_STARTED && press_choose_independent(sim) == PRESS_NOT_STARTED);
  EXPECT(press_get_minimal_state(sim, dx) == PRESS_NOT_STARTED);
  EXPECT(press_step_derivatives(NULL, X, NULL, P) == PRESS_NO_SIMULATION && press_step_derivatives(sim, X, NULL, P) == PRESS_NOT_STARTED);
  EXPECT(press_start(sim) == PRESS_OK);
  EXPECT(press_state_name(sim, 0) == NULL && press_state_name(NULL, 0) == NULL);
  EXPECT(press_choose_independent_speeds(sim, speeds) == PRESS_NO_SUCH_INDEX && press_choose_independent_speeds(sim, NULL) == PRESS_NO_ARRAY);
  speeds[0] = -1;
  EXPECT(press_choose_independent_speeds(sim, speeds) == PRESS_NO_SUCH_INDEX);
  EXPECT(press_directional_derivative(sim, NULL, NULL, rates, y) == PRESS_NO_ARRAY && press_directional_derivative(sim, dx, NULL, NULL, y) == PRESS_NO_ARRAY);
  EXPECT(press_directional_derivative(sim, dx, NULL, rates, NULL) == PRESS_NO_ARRAY);
  dx[0] = NAN;
  EXPECT(press_directional_derivative(sim, dx, NULL, rates, y) == PRESS_NOT_FINITE);
  dx[0] = 0.0;
  EXPECT(press_linearise(sim, A, NULL, C, NULL) == PRESS_OK);
  EXPECT(press_state_name(sim, -1) == NULL && press_state_name(sim, n) == NULL);
}

/* States have the names of coordinates and of their rates, and their numbers. */
static void names(void) {
  press_sim* sim = press_create(memory[0], sizeof memory[0]);
  int i, k;
  EXPECT(press_start(sim) == PRESS_OK && press_run(sim, 20, NULL) == PRESS_OK);
  for (k = 0; k < PRESS_SPEEDS; ++k) {
    EXPECT(press_choose_independent_speeds(sim, &k) == PRESS_OK && press_get_minimal_state(sim, dx) == PRESS_OK);
    i = press_find_coordinate(press_state_name(sim, 0));
    EXPECT(i >= 0 && dx[0] == press_coordinates(sim)[i]);
    EXPECT(press_find_speed(press_state_name(sim, 1)) == k && fabs(dx[1] - press_speeds(sim)[k]) < 1e-12);
  }
}

/* A matrix that is not wanted is skipped, and the others are the same. */
static void some_matrices(void) {
  static double other_A[n * n], other_C[outputs * n];
  press_sim* sim = press_create(memory[0], sizeof memory[0]);
  EXPECT(press_start(sim) == PRESS_OK && press_run(sim, 20, NULL) == PRESS_OK && press_linearise(sim, A, NULL, C, NULL) == PRESS_OK);
  EXPECT(press_linearise(sim, other_A, NULL, NULL, NULL) == PRESS_OK && memcmp(A, other_A, sizeof A) == 0);
  EXPECT(press_linearise(sim, NULL, NULL, other_C, NULL) == PRESS_OK && memcmp(C, other_C, sizeof C) == 0);
  EXPECT(press_linearise(sim, NULL, NULL, NULL, NULL) == PRESS_OK);
}

/* A direction of parameters has E p and F p. */
static void parameters(void) {
  static double E[n], F[outputs], by_states[n];
  const double change = 250.0;
  press_sim* sim = press_create(memory[0], sizeof memory[0]);
  int i;
  EXPECT(press_start(sim) == PRESS_OK && press_run(sim, 20, NULL) == PRESS_OK && press_linearise_parameters(sim, E, F) == PRESS_OK);
  EXPECT(press_directional_derivative_parameters(sim, NULL, rates, y) == PRESS_NO_ARRAY && press_directional_derivative_parameters(sim, &not_a_number, rates, y) == PRESS_NOT_FINITE);
  dx[0] = 0.3, dx[1] = -2.0;
  EXPECT(press_directional_derivative(sim, dx, NULL, by_states, y) == PRESS_OK);
  EXPECT(press_directional_derivative_parameters(sim, &change, rates, y) == PRESS_OK && fabs(E[1]) > 1e-6);
  for (i = 0; i < n; ++i) EXPECT(fabs(E[i] * change - rates[i]) <= 1e-12 * (1.0 + fabs(rates[i])));
  for (i = 0; i < outputs; ++i) EXPECT(fabs(F[i] * change - y[i]) <= 1e-12 * (1.0 + fabs(y[i])));
  EXPECT(press_directional_derivative(sim, dx, NULL, rates, y) == PRESS_OK && memcmp(rates, by_states, sizeof by_states) == 0);
}

/* Who linearises changes nothing: steps go on bit by bit. */
static void motion(void) {
  press_sim *sim = press_create(memory[0], sizeof memory[0]), *other = press_create(memory[1], sizeof memory[1]);
  int i, j;
  EXPECT(press_start(sim) == PRESS_OK && press_start(other) == PRESS_OK);
  for (j = 0; j < 200; ++j) {
    EXPECT(press_step(sim) == PRESS_OK && press_step(other) == PRESS_OK);
    EXPECT(press_linearise(sim, A, NULL, C, NULL) == PRESS_OK);
    dx[0] = 0.3, dx[1] = -2.0;
    EXPECT(press_directional_derivative(sim, dx, NULL, rates, y) == PRESS_OK);
    for (i = 0; i < n; ++i) EXPECT(fabs(A[n * i] * dx[0] + A[n * i + 1] * dx[1] - rates[i]) <= 1e-12 * (1.0 + fabs(rates[i])));
    for (i = 0; i < outputs; ++i) EXPECT(fabs(C[n * i] * dx[0] + C[n * i + 1] * dx[1] - y[i]) <= 1e-12 * (1.0 + fabs(y[i])));
    EXPECT(memcmp(press_outputs(sim), press_outputs(other), outputs * sizeof(double)) == 0);
    EXPECT(memcmp(press_coordinates(sim), press_coordinates(other), PRESS_COORDINATES * sizeof(double)) == 0);
  }
}

/* Equal but for rounding: how long iterations go on depends on the directions beside. */
static int are_close(const double* x, const double* y, int length) {
  int i, close = 1;
  for (i = 0; i < length; ++i) close = close && fabs(x[i] - y[i]) <= 1e-12 * (1.0 + fabs(y[i]));
  return close;
}

/* Who asks for derivatives of steps has the same steps, and a matrix that is not wanted is skipped. */
static void steps(void) {
  static double other_X[n * n], other_P[n * PRESS_PARAMETERS + 1];
  press_sim *sim = press_create(memory[0], sizeof memory[0]), *other = press_create(memory[1], sizeof memory[1]);
  int j;
  EXPECT(press_start(sim) == PRESS_OK && press_start(other) == PRESS_OK);
  for (j = 0; j < 60; ++j) {
    EXPECT(press_step_derivatives(sim, X, NULL, P) == PRESS_OK);
    if (j % 3 == 0) EXPECT(press_step(other) == PRESS_OK);
    if (j % 3 == 1) EXPECT(press_step_derivatives(other, other_X, NULL, NULL) == PRESS_OK && are_close(X, other_X, n * n));
    if (j % 3 == 2) EXPECT(press_step_derivatives(other, NULL, NULL, other_P) == PRESS_OK && are_close(P, other_P, n * PRESS_PARAMETERS));
    EXPECT(memcmp(press_coordinates(sim), press_coordinates(other), PRESS_COORDINATES * sizeof(double)) == 0);
  }
}

/* A run goes on where another has ended, with all that its steps have begun with; where steps belong to their states it is their product. */
static void runs(void) {
  static double S[PRESS_SEED_ROWS * (n + 1)], T[PRESS_SEED_ROWS * (n + 1)], values[3], derivatives[3 * (n + 1)];
  int by[n + 1], x = PRESS_OUTPUT_slider_x, i, k;
  press_sim *sim = press_create(memory[0], sizeof memory[0]), *other = press_create(memory[1], sizeof memory[1]);
  EXPECT(press_forward_sensitivities(NULL, 1, 0, NULL, NULL, 0, NULL, 1, NULL, NULL) == PRESS_NO_SIMULATION);
  EXPECT(press_forward_sensitivities(sim, 1, 0, NULL, NULL, 0, NULL, 1, NULL, NULL) == PRESS_NOT_STARTED);
  EXPECT(press_start(sim) == PRESS_OK && press_start(other) == PRESS_OK);
  for (k = 0; k < n; ++k) by[k] = -1, S[k * (n + 1) + k] = T[k * (n + 1) + k] = 1.0;
  by[n] = PRESS_INPUTS + PRESS_PARAMETERS;
  EXPECT(press_forward_sensitivities(sim, 1, n + 1, by, S, 0, NULL, 1, NULL, NULL) == PRESS_NO_SUCH_INDEX);
  by[n] = PRESS_INPUTS;
  EXPECT(press_forward_sensitivities(sim, 1, n + 1, by, NULL, 0, NULL, 1, NULL, NULL) == PRESS_NO_ARRAY);
  EXPECT(press_forward_sensitivities(sim, 1, n + 1, by, S, 1, &x, 1, values, NULL) == PRESS_NO_ARRAY);
  EXPECT(press_forward_sensitivities(sim, 1, n + 1, by, S, 1, &x, 0, values, derivatives) == PRESS_NO_SUCH_INDEX);
  EXPECT(press_forward_sensitivities(sim, 10, n + 1, by, S, 1, &x, 5, values, derivatives) == PRESS_OK);
  EXPECT(press_forward_sensitivities(other, 1, n + 1, by, T, 0, NULL, 1, NULL, NULL) == PRESS_OK);
  EXPECT(press_forward_sensitivities(other, 4, n + 1, by, T, 0, NULL, 1, NULL, NULL) == PRESS_OK);
  EXPECT(press_forward_sensitivities(other, 5, n + 1, by, T, 0, NULL, 1, NULL, NULL) == PRESS_OK);
  for (i = 0; i < n * (n + 1); ++i) EXPECT(fabs(S[i] - T[i]) <= 1e-10 * (1e-3 + fabs(S[i])));
  EXPECT(press_start(sim) == PRESS_OK && press_start(other) == PRESS_OK);
  memset(T, 0, sizeof T);
  for (k = 0; k < n; ++k) T[k * (n + 1) + k] = 1.0;
  EXPECT(press_forward_sensitivities(sim, 1, n + 1, by, T, 0, NULL, 1, NULL, NULL) == PRESS_OK && press_step_derivatives(other, X, NULL, P) == PRESS_OK);
  for (i = 0; i < n; ++i)
    EXPECT(are_close(X + i * n, T + i * (n + 1), n) && fabs(P[i * PRESS_PARAMETERS] - T[i * (n + 1) + n]) <= 1e-12 * (1e-3 + fabs(P[i * PRESS_PARAMETERS])));
  EXPECT(press_start(sim) == PRESS_OK && press_run(sim, 10, NULL) == PRESS_OK);
  EXPECT(values[2] == press_outputs(sim)[x] && press_linearise(sim, NULL, NULL, C, NULL) == PRESS_OK);
  EXPECT(fabs(derivatives[2 * (n + 1)] - C[x * n] * S[0] - C[x * n + 1] * S[n + 1]) <= 1e-12);
}

/* From its end on a run has the slopes that it has along directions, and goes to the same states. */
static void backwards(void) {
  static double T[PRESS_SEED_ROWS * (n + 1)], tape[16 * PRESS_TAPE_RECORD], values[3], derivatives[3 * (n + 1)], back[3];
  static double by_state[n], by_input[PRESS_INPUTS + 1], by_parameter[PRESS_PARAMETERS];
  const double weights[3] = {0.5, 0.0, 2.0};
  int by[n + 1], x = PRESS_OUTPUT_slider_x, k;
  press_sim *sim = press_create(memory[0], sizeof memory[0]), *other = press_create(memory[1], sizeof memory[1]);
  EXPECT(press_adjoint_sensitivities(sim, 4, 1, &x, 2, 1, weights, back, tape, 16, by_state, by_input, by_parameter) == PRESS_NOT_STARTED);
  EXPECT(press_start(sim) == PRESS_OK && press_start(other) == PRESS_OK);
  EXPECT(press_adjoint_sensitivities(sim, 4, 1, &x, 2, 1, weights, back, NULL, 16, by_state, by_input, by_parameter) == PRESS_NO_ARRAY);
  EXPECT(press_adjoint_sensitivities(sim, 4, 1, &x, 2, 1, weights, back, tape, 16, by_state, by_input, NULL) == PRESS_NO_ARRAY);
  EXPECT(press_adjoint_sensitivities(sim, 4, 1, &x, 0, 1, weights, back, tape, 16, by_state, by_input, by_parameter) == PRESS_NO_SUCH_INDEX);
  EXPECT(press_adjoint_sensitivities(sim, 4, 1, &x, 2, 1, weights, back, tape, 6, by_state, by_input, by_parameter) == PRESS_TOO_MANY_STEPS);
  EXPECT(press_time(sim) == 0.0);
  EXPECT(press_adjoint_sensitivities(sim, 4, 1, &x, 2, 1, weights, back, tape, 7, by_state, by_input, by_parameter) == PRESS_OK);
  for (k = 0; k < n; ++k) by[k] = -1, T[k * (n + 1) + k] = 1.0;
  by[n] = PRESS_INPUTS;
  EXPECT(press_forward_sensitivities(other, 4, n + 1, by, T, 1, &x, 2, values, derivatives) == PRESS_OK);
  EXPECT(memcmp(back, values, sizeof back) == 0 && press_time(sim) == press_time(other));
  EXPECT(memcmp(press_coordinates(sim), press_coordinates(other), PRESS_COORDINATES * sizeof(double)) == 0);
  for (k = 0; k <= n; ++k) {
    const double along = 0.5 * derivatives[k] + 2.0 * derivatives[2 * (n + 1) + k], found = k < n ? by_state[k] : by_parameter[0];
    EXPECT(fabs(found - along) <= 1e-9 * (1e-3 + fabs(along)));
  }
}

int main(void) {
  wrong_calls();
  names();
  some_matrices();
  parameters();
  motion();
  steps();
  runs();
  backwards();
  return faults;
}
