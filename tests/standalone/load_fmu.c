/* Loads the library of an FMU (FMI 2) and takes a step of 0.1 s: `load_fmu LIBRARY TOKEN`. */
#include <dlfcn.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

typedef struct {
  void (*logger)(void*, const char*, int, const char*, const char*, ...);
  void* (*allocate)(size_t, size_t);
  void (*release)(void*);
  void (*finished)(void*, int);
  void* environment;
} callbacks_of;

static void log_it(void* environment, const char* name, int status, const char* category, const char* text, ...) {
  (void)environment, (void)status, fprintf(stderr, "%s %s %s\n", name, category, text);
}

#define FIND(type, name) type name = (type)dlsym(library, "fmi2" #name)

typedef void* (*instantiate_fn)(const char*, int, const char*, const char*, const callbacks_of*, int, int);
typedef int (*setup_fn)(void*, int, double, double, int, double);
typedef int (*plain_fn)(void*);
typedef int (*step_fn)(void*, double, double, int);

int main(int count, char** words) {
  static const callbacks_of callbacks = {log_it, calloc, free, NULL, NULL};
  void* library = count == 3 ? dlopen(words[1], RTLD_NOW) : NULL;
  if (!library) return fprintf(stderr, "%s\n", dlerror()), 2;
  FIND(instantiate_fn, Instantiate);
  FIND(setup_fn, SetupExperiment);
  FIND(plain_fn, EnterInitializationMode);
  FIND(plain_fn, ExitInitializationMode);
  FIND(step_fn, DoStep);
  FIND(plain_fn, Terminate);
  void* one = Instantiate("one", 1, words[2], "", &callbacks, 0, 0);
  if (!one) return 3;
  if (SetupExperiment(one, 0, 0.0, 0.0, 0, 0.0) || EnterInitializationMode(one) || ExitInitializationMode(one)) return 4;
  if (DoStep(one, 0.0, 0.1, 1) || Terminate(one)) return 5;
  puts("stepped");
  return 0;
}
