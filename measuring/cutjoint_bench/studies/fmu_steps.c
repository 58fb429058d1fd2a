// Steps of a model by the functions of FMI 2, or by the interface of its folder: fmu_steps NUMBER STEP.
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>

#define JOINED_(a, b) a##b
#define JOINED(a, b) JOINED_(a, b)
#define OF(name) JOINED(MODEL, name)

#ifdef BY_FMU
typedef struct {
  void* functions[4];
  void* environment;
} Callbacks;

void* fmi2Instantiate(const char*, int, const char*, const char*, const Callbacks*, int, int);
int fmi2SetupExperiment(void*, int, double, double, int, double);
int fmi2EnterInitializationMode(void*);
int fmi2ExitInitializationMode(void*);
int fmi2DoStep(void*, double, double, int);
#else
typedef struct Simulation Simulation;
Simulation* OF(_create)(void*, size_t);
int OF(_start)(Simulation*);
int OF(_advance)(Simulation*, double);
#endif

int main(int count, char** words) {
  if (count != 3) return 2;
  const long number = atol(words[1]);
  const double step = atof(words[2]);
  int status = 0;
#ifdef BY_FMU
  const Callbacks callbacks = {{0}, 0};
  void* c = fmi2Instantiate("one", 1, TOKEN, "", &callbacks, 0, 0);
  status = !c || fmi2SetupExperiment(c, 0, 0.0, 0.0, 0, 0.0) || fmi2EnterInitializationMode(c) || fmi2ExitInitializationMode(c);
  for (long i = 0; i < number && !status; ++i) status = fmi2DoStep(c, i * step, step, 1);
#else
  Simulation* sim = OF(_create)(malloc(BYTES), BYTES);
  status = OF(_start)(sim);
  for (long i = 0; i < number && !status; ++i) status = OF(_advance)(sim, (i + 1) * step);
#endif
  return status;
}
