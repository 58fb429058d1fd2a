/* FMI 3.0 for co-simulation over exported C99. names.h, by fmu_c99.py, has the model's header, names and values of the start. */
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "names.h"

#if defined(_WIN32)
#define EXPORTED __declspec(dllexport)
#else
#define EXPORTED
#endif

enum { ok = 0, discard = 2, error = 3 }; /* statuses of FMI */
enum { instantiated = 1, initialising = 2, stepping = 4, terminated = 8 };

/* Value references: 0 is the time; parameters, inputs and outputs follow. */
enum { first_input = 1 + PARAMETERS, first_output = first_input + INPUTS, all = first_output + OUTPUTS };

typedef const uint32_t* references;
typedef const char* string;
typedef void (*logger)(void* environment, int status, string category, string message);

typedef struct instance {
  MODEL(sim) sim;
  int phase;
  bool started;
  double inputs[INPUTS + 1];
  void* environment;
  logger log;
} instance;

static int fail(const instance* x, int status, string text) {
  if ((x != NULL) && (x->log != NULL)) { x->log(x->environment, status, "logStatusError", text); }
  return status;
}

static bool allows(const instance* x, int phases) {
  const bool allowed = (x != NULL) && ((x->phase & phases) != 0);
  if (!allowed) { (void)fail(x, error, "a function is called in a mode that does not allow it"); }
  return allowed;
}

/* Of inputs the value alone is given: it is constant until it is set again. */
static int put_input(instance* x, int i, double value) {
#if INPUTS > 0
  const int status = MODEL(set_input)(&x->sim, i, value, 0.0, 0.0);
#else
  const int status = CONSTANT(NO_SUCH_INDEX);
#endif
  if (status == CONSTANT(OK)) { x->inputs[i] = value; }
  return status;
}

static void begin(instance* x) {
  static const double start[INPUTS + 1] = START_INPUTS;
  int i;
  (void)MODEL(create)(&x->sim, sizeof(x->sim));
  for (i = 0; i < INPUTS; ++i) { (void)put_input(x, i, start[i]); }
  x->phase = instantiated;
  x->started = false;
}

static bool is_started(instance* x) {
  if ((x->phase == initialising) && !x->started) { x->started = MODEL(start)(&x->sim) == CONSTANT(OK); }
  return x->started;
}

EXPORTED string fmi3GetVersion(void) { return "3.0"; }

EXPORTED int fmi3SetDebugLogging(void* c, bool on, size_t n, const string* categories) {
  size_t i;
  (void)on;
  for (i = 0; i < n; ++i) {
    if ((categories == NULL) || (categories[i] == NULL) || (strcmp(categories[i], "logStatusError") != 0)) { return fail(c, error, "there is no such category"); }
  }
  return (c != NULL) ? ok : error;
}

EXPORTED void* fmi3InstantiateCoSimulation(string name, string token, string resources, bool visible, bool logs, bool events, bool early, references required,
                                           size_t n, void* environment, logger log, void (*update)(void)) {
  instance* const x = calloc(1, sizeof(*x));
  (void)name, (void)resources, (void)visible, (void)logs, (void)early, (void)required, (void)update;
  if (x == NULL) { return NULL; }
  x->environment = environment;
  x->log = log;
  if ((token == NULL) || (strcmp(token, TOKEN) != 0) || events || (n > 0)) {
    (void)fail(x, error, "the token is that of another FMU, or events or intermediate variables are wanted, which there are not");
    free(x);
    return NULL;
  }
  begin(x);
  return x;
}

EXPORTED void* fmi3InstantiateModelExchange(string name, string token, string resources, bool visible, bool logs, void* environment, logger log) {
  (void)name, (void)token, (void)resources, (void)visible, (void)logs;
  if (log != NULL) { log(environment, error, "logStatusError", "the FMU is for co-simulation"); }
  return NULL;
}

EXPORTED void* fmi3InstantiateScheduledExecution(string name, string token, string resources, bool visible, bool logs, void* environment, logger log,
                                                 void (*clock)(void), void (*lock)(void), void (*unlock)(void)) {
  (void)clock, (void)lock, (void)unlock;
  return fmi3InstantiateModelExchange(name, token, resources, visible, logs, environment, log);
}

EXPORTED void fmi3FreeInstance(void* c) { free(c); }

EXPORTED int fmi3EnterInitializationMode(void* c, bool has_tolerance, double tolerance, double start, bool has_stop, double stop) {
  instance* const x = c;
  (void)has_tolerance, (void)tolerance, (void)has_stop, (void)stop;
  if (!allows(x, instantiated)) { return error; }
  if ((start < 0.0) || (start > 0.0)) { return fail(x, error, "the model starts at time 0"); }
  x->phase = initialising;
  return ok;
}

EXPORTED int fmi3ExitInitializationMode(void* c) {
  instance* const x = c;
  if (!allows(x, initialising) || !is_started(x)) { return error; }
  x->phase = stepping;
  return ok;
}

EXPORTED int fmi3Terminate(void* c) {
  instance* const x = c;
  if (!allows(x, stepping)) { return error; }
  x->phase = terminated;
  return ok;
}

EXPORTED int fmi3Reset(void* c) {
  if (c == NULL) { return error; }
  begin(c);
  return ok;
}

EXPORTED int fmi3GetFloat64(void* c, references r, size_t n, double* values, size_t m) {
  instance* const x = c;
  const double* outputs = NULL;
  size_t i;
  if (x == NULL) { return error; }
  if ((n != m) || ((n > 0) && ((r == NULL) || (values == NULL)))) { return fail(x, error, "fmi3GetFloat64: each value reference has one value"); }
  for (i = 0; i < n; ++i) {
    if (r[i] >= all) { return fail(x, error, "fmi3GetFloat64: there is no such variable"); }
    if ((r[i] >= first_output) && (outputs == NULL)) {
      outputs = is_started(x) ? MODEL(outputs)(&x->sim) : NULL;
      if (outputs == NULL) { return fail(x, error, "fmi3GetFloat64: outputs have no values before initialization mode"); }
    }
    if (r[i] == 0) {
      values[i] = MODEL(time)(&x->sim);
    } else if (r[i] < first_input) {
      values[i] = MODEL(parameters)(&x->sim)[r[i] - 1];
    } else {
      values[i] = (r[i] < first_output) ? x->inputs[r[i] - first_input] : outputs[r[i] - first_output];
    }
  }
  return ok;
}

EXPORTED int fmi3SetFloat64(void* c, references r, size_t n, const double* values, size_t m) {
  instance* const x = c;
  size_t i;
  if (!allows(x, instantiated | initialising | stepping)) { return error; }
  if ((n != m) || ((n > 0) && ((r == NULL) || (values == NULL)))) { return fail(x, error, "fmi3SetFloat64: each value reference has one value"); }
  for (i = 0; i < n; ++i) {
    int status;
    if ((r[i] == 0) || (r[i] >= first_output)) { return fail(x, error, "fmi3SetFloat64: that is no parameter and no input"); }
    status = (r[i] < first_input) ? MODEL(set_parameter)(&x->sim, (int)r[i] - 1, values[i]) : put_input(x, (int)r[i] - first_input, values[i]);
    if (status != CONSTANT(OK)) { return fail(x, error, MODEL(status_text)(status)); }
    x->started = x->started && (x->phase == stepping);
  }
  return ok;
}

EXPORTED int fmi3DoStep(void* c, double point, double size, bool keeps, bool* event, bool* ends, bool* early, double* last) {
  instance* const x = c;
  const double steps = floor(size / CONSTANT(STEP) + 0.5);
  int status = CONSTANT(OK);
  double i;
  (void)keeps;
  if (!allows(x, stepping)) { return error; }
  if (!(steps >= 1.0) || !(fabs(size - steps * CONSTANT(STEP)) <= 1e-6 * CONSTANT(STEP)) || !(fabs(point - MODEL(time)(&x->sim)) <= 1e-6 * CONSTANT(STEP))) {
    return fail(x, error, "fmi3DoStep: the step does not begin at the present time, or is no multiple of fixedInternalStepSize");
  }
  {
    const MODEL(sim) before = x->sim;
    for (i = 0.0; (i < steps) && (status == CONSTANT(OK)); i += 1.0) { status = MODEL(step)(&x->sim); }
    if (status != CONSTANT(OK)) { x->sim = before; }
  }
  if (event != NULL) { *event = false; }
  if (ends != NULL) { *ends = status != CONSTANT(OK); }
  if (early != NULL) { *early = false; }
  if (last != NULL) { *last = MODEL(time)(&x->sim); }
  return (status == CONSTANT(OK)) ? ok : fail(x, discard, MODEL(status_text)(status));
}

/* Variables of other types, of which there are none, and what an FMU without these abilities refuses. */
static int none(const instance* x, size_t n) { return ((x != NULL) && (n == 0)) ? ok : fail(x, error, "all variables are of type Float64"); }
#define OTHER(name, type)                                                                                             \
  EXPORTED int fmi3Get##name(void* c, references r, size_t n, type* v, size_t m) { (void)r, (void)v, (void)m; return none(c, n); } \
  EXPORTED int fmi3Set##name(void* c, references r, size_t n, const type* v, size_t m) { (void)r, (void)v, (void)m; return none(c, n); }
OTHER(Float32, float)
OTHER(Int8, int8_t)
OTHER(UInt8, uint8_t)
OTHER(Int16, int16_t)
OTHER(UInt16, uint16_t)
OTHER(Int32, int32_t)
OTHER(UInt32, uint32_t)
OTHER(Int64, int64_t)
OTHER(UInt64, uint64_t)
OTHER(Boolean, bool)
OTHER(String, string)

EXPORTED int fmi3GetBinary(void* c, references r, size_t n, size_t* s, const uint8_t** v, size_t m) { (void)r, (void)s, (void)v, (void)m; return none(c, n); }
EXPORTED int fmi3SetBinary(void* c, references r, size_t n, const size_t* s, const uint8_t* const* v, size_t m) { (void)r, (void)s, (void)v, (void)m; return none(c, n); }
EXPORTED int fmi3GetClock(void* c, references r, size_t n, bool* v) { (void)r, (void)v; return none(c, n); }
EXPORTED int fmi3SetClock(void* c, references r, size_t n, const bool* v) { (void)r, (void)v; return none(c, n); }

#define REFUSED(name) EXPORTED int fmi3##name(void* c) { return fail(c, error, "fmi3" #name ": the FMU does not have this ability"); }
#define REFUSED_1(name, A) EXPORTED int fmi3##name(void* c, A a) { (void)a; return fail(c, error, "fmi3" #name ": the FMU does not have this ability"); }
#define REFUSED_2(name, A, B) \
  EXPORTED int fmi3##name(void* c, A a, B b) { (void)a, (void)b; return fail(c, error, "fmi3" #name ": the FMU does not have this ability"); }
#define REFUSED_3(name, A, B, C) \
  EXPORTED int fmi3##name(void* c, A a, B b, C d) { (void)a, (void)b, (void)d; return fail(c, error, "fmi3" #name ": the FMU does not have this ability"); }
#define REFUSED_4(name, A, B, C, D) \
  EXPORTED int fmi3##name(void* c, A a, B b, C d, D e) { (void)a, (void)b, (void)d, (void)e; return fail(c, error, "fmi3" #name ": the FMU does not have this ability"); }
REFUSED(EnterEventMode)
REFUSED(EnterConfigurationMode)
REFUSED(ExitConfigurationMode)
REFUSED(EvaluateDiscreteStates)
REFUSED(EnterContinuousTimeMode)
REFUSED(EnterStepMode)
REFUSED_1(GetFMUState, void**)
REFUSED_1(SetFMUState, void*)
REFUSED_1(FreeFMUState, void**)
REFUSED_1(SetTime, double)
REFUSED_1(GetNumberOfEventIndicators, size_t*)
REFUSED_1(GetNumberOfContinuousStates, size_t*)
REFUSED_2(SerializedFMUStateSize, void*, size_t*)
REFUSED_2(GetNumberOfVariableDependencies, uint32_t, size_t*)
REFUSED_2(SetContinuousStates, const double*, size_t)
REFUSED_2(GetContinuousStateDerivatives, double*, size_t)
REFUSED_2(GetEventIndicators, double*, size_t)
REFUSED_2(GetContinuousStates, double*, size_t)
REFUSED_2(GetNominalsOfContinuousStates, double*, size_t)
REFUSED_2(ActivateModelPartition, uint32_t, double)
REFUSED_3(SerializeFMUState, void*, uint8_t*, size_t)
REFUSED_3(DeserializeFMUState, const uint8_t*, size_t, void**)
REFUSED_3(GetShiftDecimal, references, size_t, double*)
REFUSED_3(SetShiftDecimal, references, size_t, const double*)
REFUSED_3(SetIntervalDecimal, references, size_t, const double*)
REFUSED_3(CompletedIntegratorStep, bool, bool*, bool*)
REFUSED_4(GetIntervalDecimal, references, size_t, double*, int*)
REFUSED_4(GetShiftFraction, references, size_t, uint64_t*, uint64_t*)
REFUSED_4(SetShiftFraction, references, size_t, const uint64_t*, const uint64_t*)
REFUSED_4(SetIntervalFraction, references, size_t, const uint64_t*, const uint64_t*)

static int refused(const instance* x) { return fail(x, error, "the FMU does not have this ability"); }
EXPORTED int fmi3GetIntervalFraction(void* c, references r, size_t n, uint64_t* a, uint64_t* b, int* q) {
  (void)r, (void)n, (void)a, (void)b, (void)q;
  return refused(c);
}
EXPORTED int fmi3GetOutputDerivatives(void* c, references r, size_t n, const int32_t* orders, double* v, size_t m) {
  (void)r, (void)n, (void)orders, (void)v, (void)m;
  return refused(c);
}
EXPORTED int fmi3GetVariableDependencies(void* c, uint32_t v, size_t* a, uint32_t* b, size_t* d, int* kinds, size_t n) {
  (void)v, (void)a, (void)b, (void)d, (void)kinds, (void)n;
  return refused(c);
}
EXPORTED int fmi3UpdateDiscreteStates(void* c, bool* a, bool* b, bool* d, bool* e, bool* f, double* next) {
  (void)a, (void)b, (void)d, (void)e, (void)f, (void)next;
  return refused(c);
}
EXPORTED int fmi3GetDirectionalDerivative(void* c, references u, size_t n, references k, size_t m, const double* seed, size_t s, double* v, size_t t) {
  (void)u, (void)n, (void)k, (void)m, (void)seed, (void)s, (void)v, (void)t;
  return refused(c);
}
EXPORTED int fmi3GetAdjointDerivative(void* c, references u, size_t n, references k, size_t m, const double* seed, size_t s, double* v, size_t t) {
  return fmi3GetDirectionalDerivative(c, u, n, k, m, seed, s, v, t);
}
