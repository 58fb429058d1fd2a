/* A drive that was saved, by a library for any processor: events from standard input, outputs of rows as hexadecimal numbers. */
#include <stdio.h>
#include <stdlib.h>

#include HEADER

#define JOIN(a, b) a##_##b
#define NAMED(a, b) JOIN(a, b)
#define CALL(name) NAMED(MODEL, name)

static union { double alignment; char bytes[BYTES]; } memory;

static int require(int status) {
  if (status != 0) { fprintf(stderr, "status %d\n", status); exit(1); }
  return 0;
}

int main(void) {
  double dt, value;
  long steps, every, events, at = 0;
  int index, outputs;
  NAMED(MODEL, sim)* sim = CALL(create)(&memory, sizeof memory);
  if (sim == NULL || scanf("%lf %ld %ld %d %ld", &dt, &steps, &every, &outputs, &events) != 5) return 2;
  require(CALL(set_step)(sim, dt));
  require(CALL(start)(sim));
  long next = events > 0 && scanf("%ld %d %lf", &at, &index, &value) == 3 ? at : steps;
  for (long step = 0; step < steps; ++step) {
    while (next <= step) {
      require(CALL(set_input)(sim, index, value, 0.0, 0.0));
      next = --events > 0 && scanf("%ld %d %lf", &at, &index, &value) == 3 ? at : steps;
    }
    require(CALL(step)(sim));
    if ((step + 1) % every != 0) continue;
    for (int i = 0; i < outputs; ++i) printf("%a ", CALL(outputs)(sim)[i]);
    printf("\n");
  }
  return 0;
}
