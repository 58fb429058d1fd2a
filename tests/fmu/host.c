/* A host of FMI 3 on any platform: host LIBRARY TOKEN STEPS SIZE REFERENCE...; prints the variables after each communication step. */
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#ifdef _WIN32
#include <windows.h>
#else
#include <dlfcn.h>
#endif

typedef void* (*Instantiate)(const char*, const char*, const char*, bool, bool, bool, bool, const uint32_t*, size_t, void*, void*, void*);
typedef int (*Enter)(void*, bool, double, double, bool, double);
typedef int (*Call)(void*);
typedef int (*Get)(void*, const uint32_t*, size_t, double*, size_t);
typedef int (*Step)(void*, double, double, bool, bool*, bool*, bool*, double*);
typedef void (*Free)(void*);

static void* library;

static void (*function(const char* name))(void) {
  void (*found)(void) = NULL;
#ifdef _WIN32
  found = (void (*)(void))GetProcAddress((HMODULE)library, name);
#else
  *(void**)&found = dlsym(library, name);
#endif
  if (!found) exit(3);
  return found;
}

int main(int count, char** words) {
  bool flags[3];
  double last, values[100];
  uint32_t references[100];
  size_t n = 0;
  if (count < 6) return 1;
  for (int i = 5; i < count && n < 100; ++i) references[n++] = (uint32_t)atoi(words[i]);
#ifdef _WIN32
  library = (void*)LoadLibraryA(words[1]);
#else
  library = dlopen(words[1], RTLD_NOW | RTLD_LOCAL);
#endif
  if (!library) return 2;
  void* c = ((Instantiate)function("fmi3InstantiateCoSimulation"))("host", words[2], "", false, false, false, false, NULL, 0, NULL, NULL, NULL);
  if (!c || ((Enter)function("fmi3EnterInitializationMode"))(c, false, 0.0, 0.0, false, 0.0) || ((Call)function("fmi3ExitInitializationMode"))(c)) return 4;
  const double size = atof(words[4]);
  for (int i = 0; i < atoi(words[3]); ++i) {
    if (((Step)function("fmi3DoStep"))(c, i * size, size, true, &flags[0], &flags[1], &flags[2], &last)) return 5;
    if (((Get)function("fmi3GetFloat64"))(c, references, n, values, n)) return 6;
    for (size_t j = 0; j < n; ++j) printf("%.17g%c", values[j], j + 1 < n ? ' ' : '\n');
  }
  ((Free)function("fmi3FreeInstance"))(c);
  return 0;
}
