// Steps of a model by the interface of its folder: fmu_steps NUMBER STEP; with -DFMI=2 or 3 by an FMU's binary: fmu_steps NUMBER STEP BINARY.
// Prints the seconds of the processor that they take.
#define _GNU_SOURCE
#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#define JOINED_(a, b) a##b
#define JOINED(a, b) JOINED_(a, b)
#define OF(name) JOINED(MODEL, name)

#ifdef FMI
#include <dlfcn.h>

typedef struct {
  void* functions[4];
  void* environment;
} Callbacks;

static void (*function(void* library, const char* name))(void) {
  void (*found)(void) = NULL;
  *(void**)&found = dlsym(library, name);
  if (!found) exit(3);
  return found;
}
#define FUNCTION(result, name, ...) result (*name)(__VA_ARGS__) = (result(*)(__VA_ARGS__))function(library, #name)
#else
typedef struct Simulation Simulation;
Simulation* OF(_create)(void*, size_t);
int OF(_start)(Simulation*);
int OF(_advance)(Simulation*, double);
#endif

static double now(void) {
  struct timespec time;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return (double)time.tv_sec + 1e-9 * (double)time.tv_nsec;
}

int main(int count, char** words) {
  if (count < 3) return 2;
  const long number = atol(words[1]);
  const double step = atof(words[2]);
  int status = 0;
#ifdef FMI
  void* library = count > 3 ? dlopen(words[3], RTLD_NOW | RTLD_LOCAL) : NULL;
  if (!library) return 2;
#endif
#if defined(FMI) && FMI == 2
  const Callbacks callbacks = {{0}, 0};
  FUNCTION(void*, fmi2Instantiate, const char*, int, const char*, const char*, const Callbacks*, int, int);
  FUNCTION(int, fmi2SetupExperiment, void*, int, double, double, int, double);
  FUNCTION(int, fmi2EnterInitializationMode, void*);
  FUNCTION(int, fmi2ExitInitializationMode, void*);
  FUNCTION(int, fmi2DoStep, void*, double, double, int);
  void* c = fmi2Instantiate("one", 1, TOKEN, "", &callbacks, 0, 0);
  status = !c || fmi2SetupExperiment(c, 0, 0.0, 0.0, 0, 0.0) || fmi2EnterInitializationMode(c) || fmi2ExitInitializationMode(c);
  const double begin = now();
  for (long i = 0; i < number && !status; ++i) status = fmi2DoStep(c, i * step, step, 1);
#elif defined(FMI)
  bool flags[3];
  double last;
  FUNCTION(void*, fmi3InstantiateCoSimulation, const char*, const char*, const char*, bool, bool, bool, bool, const void*, size_t, void*, void*, void*);
  FUNCTION(int, fmi3EnterInitializationMode, void*, bool, double, double, bool, double);
  FUNCTION(int, fmi3ExitInitializationMode, void*);
  FUNCTION(int, fmi3DoStep, void*, double, double, bool, bool*, bool*, bool*, double*);
  void* c = fmi3InstantiateCoSimulation("one", TOKEN, "", false, false, false, false, NULL, 0, NULL, NULL, NULL);
  status = !c || fmi3EnterInitializationMode(c, false, 0.0, 0.0, false, 0.0) || fmi3ExitInitializationMode(c);
  const double begin = now();
  for (long i = 0; i < number && !status; ++i) status = fmi3DoStep(c, i * step, step, true, &flags[0], &flags[1], &flags[2], &last);
#else
  Simulation* sim = OF(_create)(malloc(BYTES), BYTES);
  status = OF(_start)(sim);
  const double begin = now();
  for (long i = 0; i < number && !status; ++i) status = OF(_advance)(sim, (i + 1) * step);
#endif
  printf("%.9g\n", now() - begin);
  return status;
}
