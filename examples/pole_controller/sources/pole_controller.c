/* A sampled controller as an FMU: every step it reads where the cart and the pole are, finds their rates by differences, and pushes the cart.
   Its inputs are in m and degrees, its output in N. */
#include <stdlib.h>

#include "fmi2Functions.h"

enum { POSITION, ANGLE, FORCE, VARIABLES };

typedef struct {
  double value[VARIABLES];
  double last_position, last_angle;
} Controller;

static const double rad = 0.017453292519943295;
static const double by_position = 3.0, by_speed = 5.0, by_angle = 45.0, by_angle_rate = 14.0;

const char* fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char* fmi2GetVersion(void) { return fmi2Version; }
fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String categories[]) { return fmi2OK; }

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources, const fmi2CallbackFunctions* functions,
                              fmi2Boolean visible, fmi2Boolean logging) {
  return type == fmi2CoSimulation ? calloc(1, sizeof(Controller)) : NULL;
}

void fmi2FreeInstance(fmi2Component c) { free(c); }

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean has_tolerance, fmi2Real tolerance, fmi2Real start, fmi2Boolean has_stop, fmi2Real stop) {
  return fmi2OK;
}
fmi2Status fmi2EnterInitializationMode(fmi2Component c) { return fmi2OK; }
fmi2Status fmi2Terminate(fmi2Component c) { return fmi2OK; }

fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
  Controller* it = c;
  it->last_position = it->value[POSITION];
  it->last_angle = it->value[ANGLE];
  return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component c) {
  *(Controller*)c = (Controller){{0.0}, 0.0, 0.0};
  return fmi2OK;
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference references[], size_t n, fmi2Real values[]) {
  for (size_t i = 0; i < n; ++i) {
    if (references[i] >= VARIABLES) return fmi2Error;
    values[i] = ((Controller*)c)->value[references[i]];
  }
  return fmi2OK;
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference references[], size_t n, const fmi2Real values[]) {
  for (size_t i = 0; i < n; ++i) {
    if (references[i] >= FORCE) return fmi2Error;
    ((Controller*)c)->value[references[i]] = values[i];
  }
  return fmi2OK;
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real step, fmi2Boolean is_final) {
  Controller* it = c;
  const double position = it->value[POSITION], angle = it->value[ANGLE];
  const double speed = (position - it->last_position) / step, angle_rate = (angle - it->last_angle) / step;
  it->value[FORCE] = by_position * position + by_speed * speed + rad * (by_angle * angle + by_angle_rate * angle_rate);
  it->last_position = position;
  it->last_angle = angle;
  return fmi2OK;
}

/* What the standard has besides, and this controller has not. */
#define REFUSES(function, ...) \
  fmi2Status function(fmi2Component c, __VA_ARGS__) { return fmi2Error; }
#define REFERENCES const fmi2ValueReference references[], size_t n

REFUSES(fmi2GetInteger, REFERENCES, fmi2Integer values[])
REFUSES(fmi2GetBoolean, REFERENCES, fmi2Boolean values[])
REFUSES(fmi2GetString, REFERENCES, fmi2String values[])
REFUSES(fmi2SetInteger, REFERENCES, const fmi2Integer values[])
REFUSES(fmi2SetBoolean, REFERENCES, const fmi2Boolean values[])
REFUSES(fmi2SetString, REFERENCES, const fmi2String values[])
REFUSES(fmi2GetFMUstate, fmi2FMUstate* state)
REFUSES(fmi2SetFMUstate, fmi2FMUstate state)
REFUSES(fmi2FreeFMUstate, fmi2FMUstate* state)
REFUSES(fmi2SerializedFMUstateSize, fmi2FMUstate state, size_t* size)
REFUSES(fmi2SerializeFMUstate, fmi2FMUstate state, fmi2Byte bytes[], size_t size)
REFUSES(fmi2DeSerializeFMUstate, const fmi2Byte bytes[], size_t size, fmi2FMUstate* state)
REFUSES(fmi2GetDirectionalDerivative, REFERENCES, const fmi2ValueReference known[], size_t m, const fmi2Real seed[], fmi2Real sensitivity[])
REFUSES(fmi2SetRealInputDerivatives, REFERENCES, const fmi2Integer orders[], const fmi2Real values[])
REFUSES(fmi2GetRealOutputDerivatives, REFERENCES, const fmi2Integer orders[], fmi2Real values[])
REFUSES(fmi2GetStatus, const fmi2StatusKind kind, fmi2Status* value)
REFUSES(fmi2GetRealStatus, const fmi2StatusKind kind, fmi2Real* value)
REFUSES(fmi2GetIntegerStatus, const fmi2StatusKind kind, fmi2Integer* value)
REFUSES(fmi2GetBooleanStatus, const fmi2StatusKind kind, fmi2Boolean* value)
REFUSES(fmi2GetStringStatus, const fmi2StatusKind kind, fmi2String* value)
fmi2Status fmi2CancelStep(fmi2Component c) { return fmi2Error; }
