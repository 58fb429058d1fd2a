/* A host of FMI 3 on any platform: host LIBRARY TOKEN STEPS SIZE FROM TO REFERENCE...; prints the variables after each communication step, and
   what the FMU says on the other stream.  Goes on from a state in file FROM, and leaves one in file TO; "-" for none. */
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#ifdef _WIN32
#include <windows.h>
#else
#include <dlfcn.h>
#endif

typedef void* (*Instantiate)(const char*, const char*, const char*, bool, bool, bool, bool, const uint32_t*, size_t, void*, void (*)(void*, int, const char*, const char*), void*);
typedef int (*Enter)(void*, bool, double, double, bool, double);
typedef int (*Call)(void*);
typedef int (*Get)(void*, const uint32_t*, size_t, double*, size_t);
typedef int (*Step)(void*, double, double, bool, bool*, bool*, bool*, double*);
typedef void (*Free)(void*);
typedef int (*State)(void*, void**);
typedef int (*Size)(void*, void*, size_t*);
typedef int (*Write)(void*, void*, unsigned char*, size_t);
typedef int (*Read)(void*, const unsigned char*, size_t, void**);
typedef int (*Put)(void*, void*);

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

static void log_message(void* environment, int status, const char* category, const char* text) {
  (void)environment;
  fprintf(stderr, "%d %s: %s\n", status, category, text);
}

static int leave_state(void* c, const char* place) {
  static unsigned char bytes[1000000];
  void* state = NULL;
  size_t size;
  FILE* file = fopen(place, "wb");
  if (!file || ((State)function("fmi3GetFMUState"))(c, &state) || ((Size)function("fmi3SerializedFMUStateSize"))(c, state, &size) || size > sizeof bytes) return 7;
  if (((Write)function("fmi3SerializeFMUState"))(c, state, bytes, size) || fwrite(bytes, 1, size, file) != size || fclose(file)) return 7;
  return ((State)function("fmi3FreeFMUState"))(c, &state);
}

static int take_state(void* c, const char* place) {
  static unsigned char bytes[1000000];
  void* state = NULL;
  FILE* file = fopen(place, "rb");
  const size_t size = file ? fread(bytes, 1, sizeof bytes, file) : 0;
  if (!file || fclose(file) || ((Read)function("fmi3DeserializeFMUState"))(c, bytes, size, &state) || ((Put)function("fmi3SetFMUState"))(c, state)) return 8;
  return ((State)function("fmi3FreeFMUState"))(c, &state);
}

int main(int count, char** words) {
  bool flags[3];
  double last, values[100];
  uint32_t references[100];
  size_t n = 0;
  if (count < 8) return 1;
  for (int i = 7; i < count && n < 100; ++i) references[n++] = (uint32_t)atoi(words[i]);
#ifdef _WIN32
  library = (void*)LoadLibraryA(words[1]);
#else
  library = dlopen(words[1], RTLD_NOW | RTLD_LOCAL);
#endif
  if (!library) return 2;
  void* c = ((Instantiate)function("fmi3InstantiateCoSimulation"))("host", words[2], "", false, false, false, false, NULL, 0, NULL, log_message, NULL);
  if (!c || ((Enter)function("fmi3EnterInitializationMode"))(c, false, 0.0, 0.0, false, 0.0) || ((Call)function("fmi3ExitInitializationMode"))(c)) return 4;
  const double size = atof(words[4]);
  const uint32_t time = 0;
  if (words[5][0] != '-' && take_state(c, words[5])) return 8;
  if (((Get)function("fmi3GetFloat64"))(c, &time, 1, &last, 1)) return 6;
  const int first = (int)(last / size + 0.5);
  for (int i = first; i < first + atoi(words[3]); ++i) {
    if (((Step)function("fmi3DoStep"))(c, i * size, size, true, &flags[0], &flags[1], &flags[2], &last)) return 5;
    if (((Get)function("fmi3GetFloat64"))(c, references, n, values, n)) return 6;
    for (size_t j = 0; j < n; ++j) printf("%.17g%c", values[j], j + 1 < n ? ' ' : '\n');
  }
  if (words[6][0] != '-' && leave_state(c, words[6])) return 7;
  ((Free)function("fmi3FreeInstance"))(c);
  return 0;
}
