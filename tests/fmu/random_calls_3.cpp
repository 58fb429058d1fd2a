// Calls of an FMI 3 FMU for both kinds in random order, right and wrong ones; prints how many were made and how many went well.
#include "fmi3.cpp"
#include "random_arguments.hpp"

namespace {

void heed(void*, int, const char*, const char* text) { seed += strlen(text); }

// The instance whose step goes on.
void* present = nullptr;

// Within a step: outputs, wrong calls, and now and then the wish that it ends.
void look(void*, double time, bool, bool, bool, bool, bool* ends, double* end) {
  const unsigned reference = any_reference();
  double value;
  bool flag;
  if (below(2)) fmi3GetFloat64(present, &reference, 1, &value, 1);
  if (!below(9)) fmi3DoStep(present, time, 0.1, true, &flag, &flag, &flag, &value);
  if (!below(9)) fmi3SetFloat64(present, &reference, 1, &time, 1);
  if (!below(9)) fmi3Reset(present);
  *ends = !below(5);
  *end = below(2) ? time + 1e-3 * below(9) : any_number();
}

template <class T>
T* place(T* wanted) {
  return below(12) ? wanted : nullptr;
}

// Mostly the states of the instance, a little apart.
int set_some_states(void* c) {
  double states[n_states + 1];
  if (!c) return fmi3SetContinuousStates(c, states, n_states);
  for (unsigned i = 0; i < n_states; ++i) states[i] = of(c)->values.states[i] + (below(30) ? 1e-3 * below(10) : any_number());
  return fmi3SetContinuousStates(c, place(states), below(12) ? n_states : below(n_states + 2));
}

int exchange(void* c, unsigned which) {
  const unsigned most = n_states + n_indicators + 2;
  double many[most];
  bool flags[5];
  size_t number;
  switch (which) {
    case 0: return fmi3EnterEventMode(c);
    case 1: return fmi3EnterStepMode(c);
    case 2: case 3: return fmi3EnterContinuousTimeMode(c);
    case 4: case 5: return fmi3UpdateDiscreteStates(c, place(flags), flags + 1, flags + 2, flags + 3, flags + 4, many);
    case 6: case 7: return fmi3CompletedIntegratorStep(c, true, place(flags), flags + 1);
    case 8: return fmi3SetTime(c, below(5) && c ? of(c)->values.time + 1e-3 * below(4) : any_number());
    case 9: case 10: case 11: return set_some_states(c);
    case 12: case 13: case 14: return fmi3GetContinuousStateDerivatives(c, place(many), below(12) ? n_states : below(most));
    case 15: return fmi3GetEventIndicators(c, place(many), below(12) ? n_indicators : below(most));
    case 16: return fmi3GetContinuousStates(c, place(many), below(12) ? n_states : below(most));
    case 17: return fmi3GetNominalsOfContinuousStates(c, place(many), below(12) ? n_states : below(most));
    case 18: return fmi3GetNumberOfEventIndicators(c, place(&number));
    default: return fmi3GetNumberOfContinuousStates(c, place(&number));
  }
}

int differentiate(void* c) {
  const unsigned unknowns[2] = {below(6) ? first_derivative + below(n_states) : any_reference(), first_output};
  const unsigned knowns[2] = {below(6) ? first_state + below(n_states) : any_reference(), first_state};
  const double given[2] = {below(6) ? 1.0 : any_number(), 0.5};
  double found[2];
  const size_t n = below(3), m = below(3);
  return fmi3GetDirectionalDerivative(c, place(unknowns), n, place(knowns), m, given, below(12) ? m : 3, found, n);
}

int call(void* c, void** state, unsigned char* bytes, size_t size) {
  unsigned references[2] = {any_reference(), any_reference()};
  double values[2] = {any_number(), any_number()}, last = 0.0;
  bool flags[3];
  const unsigned which = below(80);
  const unsigned time = 0;
  double now = 0.0;
  present = c;
  if (c) fmi3GetFloat64(c, &time, 1, &now, 1);
  if (which < 15) return fmi3DoStep(c, below(9) ? now : any_number(), any_size(), true, flags, place(flags + 1), flags + 2, place(&last));
  if (which < 21) return fmi3GetFloat64(c, place(references), below(3), place(values), 2);
  if (which < 27) return fmi3SetFloat64(c, place(references), 2, place(values), below(9) ? 2 : 1);
  if (which < 57) return exchange(c, below(20));
  if (which < 62) return differentiate(c);
  switch (which) {
    case 62: return below(4) ? ok : fmi3Reset(c);
    case 63: case 64: case 65: return fmi3EnterInitializationMode(c, false, 0.0, below(6) ? 0.0 : any_number(), !below(5), any_number());
    case 66: case 67: case 68: return fmi3ExitInitializationMode(c);
    case 69: return below(8) ? ok : fmi3Terminate(c);
    case 70: case 71: return fmi3GetFMUState(c, place(state));
    case 72: return fmi3SetFMUState(c, *state);
    case 73: return fmi3FreeFMUState(c, state);
    case 74: return *state ? fmi3SerializeFMUState(c, *state, bytes, below(4) ? size : below(100)) : ok;
    case 75: return fmi3DeserializeFMUState(c, bytes, below(4) ? size : below(100), state);
    case 76: return fmi3GetInt32(c, references, below(2), nullptr, 0);
    case 77: return fmi3SetDebugLogging(c, true, below(2), nullptr);
    case 78: return fmi3EnterStepMode(c);
    default: return fmi3SerializedFMUStateSize(c, *state, &size);
  }
}

}  // namespace

int main(int, char** argv) {
  const long calls = atol(argv[1]);
  const size_t size = state_size();
  unsigned char* bytes = static_cast<unsigned char*>(calloc(1, size));
  void *instances[4] = {}, *state = nullptr;
  long good = 0;
  for (long i = 0; i < calls; ++i) {
    void*& c = instances[below(4)];
    if (!c && below(2))
      c = below(3) ? fmi3InstantiateModelExchange("one", token, "", false, false, nullptr, heed)
                   : fmi3InstantiateCoSimulation("one", token, "", false, false, STOPS && below(2), STOPS && below(2), nullptr, 0, nullptr, heed, below(2) ? look : nullptr);
    good += call(c, &state, bytes, size) == ok;
    if (!below(400)) fmi3FreeInstance(c), c = nullptr;
  }
  for (void* c : instances) fmi3FreeInstance(c);
  free(state);
  free(bytes);
  printf("%ld %ld\n", calls, good);
}
