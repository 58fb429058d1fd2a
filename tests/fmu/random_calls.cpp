// Calls of an FMI 2 FMU in random order, right and wrong ones; prints how many were made and how many went well.
#include "fmi2.cpp"
#include "random_arguments.hpp"

namespace {

void heed(void*, const char*, int, const char*, const char* form, ...) {
  char text[2000];
  va_list rest;
  va_start(rest, form);
  vsnprintf(text, sizeof text, form, rest);
  va_end(rest);
}

int call(void* c, void** state, char* bytes, size_t size) {
  unsigned references[2] = {any_reference(), any_reference()};
  double values[2] = {any_number(), any_number()};
  int orders[2] = {static_cast<int>(below(4)), 1}, kind = static_cast<int>(below(5)), flag = 0;
  const unsigned which = below(60);
  const double now = c ? press_time(of(c)->sim) : 0.0;
  if (which < 20) return fmi2DoStep(c, below(9) ? now : any_number(), any_size(), 0);
  if (which < 28) return fmi2GetReal(c, below(9) ? references : nullptr, below(3), below(9) ? values : nullptr);
  if (which < 36) return fmi2SetReal(c, below(9) ? references : nullptr, below(3), below(9) ? values : nullptr);
  switch (which) {
    case 36: return fmi2Reset(c);
    case 37: case 38: return fmi2SetupExperiment(c, 0, 0.0, below(4) ? 0.0 : any_number(), !below(3), any_number());
    case 39: case 40: case 41: return fmi2EnterInitializationMode(c);
    case 42: case 43: case 44: return fmi2ExitInitializationMode(c);
    case 45: return below(5) ? ok : fmi2Terminate(c);
    case 46: case 47: return fmi2GetFMUstate(c, below(9) ? state : nullptr);
    case 48: case 49: return fmi2SetFMUstate(c, *state);
    case 50: return fmi2FreeFMUstate(c, state);
    case 51: return *state ? fmi2SerializeFMUstate(c, *state, bytes, below(4) ? size : below(100)) : ok;
    case 52: case 53: return fmi2DeSerializeFMUstate(c, bytes, below(4) ? size : below(100), state);
    case 54: return fmi2SetRealInputDerivatives(c, references, 2, orders, values);
    case 55: return fmi2GetRealStatus(c, kind, values);
    case 56: return fmi2GetBooleanStatus(c, kind, &flag);
    case 57: return fmi2GetInteger(c, references, below(2), orders);
    case 58: return fmi2SetDebugLogging(c, 1, below(2), nullptr);
    default: return fmi2SerializedFMUstateSize(c, *state, &size);
  }
}

}  // namespace

int main(int, char** argv) {
  const fmi2CallbackFunctions callbacks = {heed, calloc, free, nullptr, nullptr};
  const long calls = atol(argv[1]);
  const size_t size = state_size();
  char* bytes = static_cast<char*>(calloc(1, size));
  void *instances[3] = {}, *state = nullptr;
  long good = 0;
  for (long i = 0; i < calls; ++i) {
    void*& c = instances[below(3)];
    if (!c && below(2)) c = fmi2Instantiate("one", 1, token, "", &callbacks, 0, 0);
    good += call(c, &state, bytes, size) == ok;
    if (!below(300)) fmi2FreeInstance(c), c = nullptr;
  }
  for (void* c : instances) fmi2FreeInstance(c);
  free(state);
  free(bytes);
  printf("%ld %ld\n", calls, good);
}
