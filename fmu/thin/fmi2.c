/* SPDX-License-Identifier: BSD-2-Clause */
/* FMI 2.0 co-simulation of a model. */
#include "fmi2Functions.h"

#include "instance.h"

static fmi2Status status_of(int done)
{
    return done ? fmi2OK : fmi2Error;
}

/* The importer takes the message for a printf format, in which # marks variables. */
static void send(const Instance *inst, const char *message)
{
    char format[1300];
    size_t used = 0;
    for (; *message && used + 2 < sizeof format; message++) {
        if (*message == '%' || *message == '#')
            format[used++] = *message;
        format[used++] = *message;
    }
    format[used] = '\0';
    ((fmi2CallbackLogger)inst->log)(inst->environment, inst->name, fmi2Error, "logStatusError",
                                    format);
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible,
                              fmi2Boolean logging)
{
    (void)visible, (void)logging;
    if (type != fmi2CoSimulation)
        return NULL;
    return thin_new(name, guid, resources, send, functions ? (AnyFunction *)functions->logger : NULL,
                    functions ? functions->componentEnvironment : NULL);
}

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }
void fmi2FreeInstance(fmi2Component c) { thin_free(c); }
fmi2Status fmi2Reset(fmi2Component c) { return status_of(thin_reset(c)); }
fmi2Status fmi2EnterInitializationMode(fmi2Component c) { return status_of(c != NULL); }
fmi2Status fmi2ExitInitializationMode(fmi2Component c) { return status_of(thin_start(c)); }
fmi2Status fmi2Terminate(fmi2Component c) { return status_of(c != NULL); }

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String names[])
{
    (void)on, (void)n, (void)names;
    return status_of(c != NULL);
}

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean has_tolerance, fmi2Real tolerance,
                               fmi2Real start, fmi2Boolean has_stop, fmi2Real stop)
{
    Instance *inst = c;
    (void)has_tolerance, (void)tolerance;
    if (start != 0.0)
        return status_of(thin_refuse(inst, "the start time must be 0, not %g s", start));
    if (has_stop)
        inst->run.stop = stop;
    return fmi2OK;
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference places[], size_t n, fmi2Real values[])
{
    return status_of(thin_get(c, places, n, values));
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference places[], size_t n,
                       const fmi2Real values[])
{
    return status_of(thin_set(c, places, n, values));
}

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference places[], size_t n,
                                       const fmi2Integer orders[], const fmi2Real values[])
{
    Instance *inst = c;
    for (size_t k = 0; k < n; k++) {
        const int known = places[k] >= 1 && places[k] <= (unsigned)inst->model->count;
        const Variable *variable = known ? &inst->model->variables[places[k] - 1] : NULL;
        const fmi2ValueReference slope = variable ? (unsigned)variable->slope : 0;
        if (!slope || variable->kind != INPUT || orders[k] != 1)
            return status_of(thin_refuse(inst, "variable %u has no slope to set", places[k]));
        if (!thin_set(inst, &slope, 1, &values[k]))
            return fmi2Error;
    }
    return fmi2OK;
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real h, fmi2Boolean no_set_state)
{
    (void)no_set_state;
    return status_of(thin_step(c, time, h));
}

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state)
{
    return status_of(thin_save(c, state));
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state)
{
    return status_of(thin_restore(c, state));
}

#include <stdlib.h>
fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state)
{
    (void)c;
    free(*state);
    *state = NULL;
    return fmi2OK;
}

/* What a model of numbers has not. */

#define NONE(FUNCTION, ARGUMENTS)                                                                   \
    fmi2Status FUNCTION ARGUMENTS                                                                   \
    {                                                                                               \
        return status_of(c && thin_refuse(c, "it does not provide " #FUNCTION));                    \
    }
#define IDLE(FUNCTION, ARGUMENTS, N)                                                                \
    fmi2Status FUNCTION ARGUMENTS                                                                   \
    {                                                                                               \
        return status_of((N) == 0 || (c && thin_refuse(c, "it has no variable of this type")));     \
    }
typedef const fmi2ValueReference *Places;

#pragma GCC diagnostic ignored "-Wunused-parameter"
IDLE(fmi2GetInteger, (fmi2Component c, Places p, size_t n, fmi2Integer *v), n)
IDLE(fmi2GetBoolean, (fmi2Component c, Places p, size_t n, fmi2Boolean *v), n)
IDLE(fmi2GetString, (fmi2Component c, Places p, size_t n, fmi2String *v), n)
IDLE(fmi2SetInteger, (fmi2Component c, Places p, size_t n, const fmi2Integer *v), n)
IDLE(fmi2SetBoolean, (fmi2Component c, Places p, size_t n, const fmi2Boolean *v), n)
IDLE(fmi2SetString, (fmi2Component c, Places p, size_t n, const fmi2String *v), n)
NONE(fmi2SerializedFMUstateSize, (fmi2Component c, fmi2FMUstate s, size_t *n))
NONE(fmi2SerializeFMUstate, (fmi2Component c, fmi2FMUstate s, fmi2Byte b[], size_t n))
NONE(fmi2DeSerializeFMUstate, (fmi2Component c, const fmi2Byte b[], size_t n, fmi2FMUstate *s))
NONE(fmi2GetDirectionalDerivative,
     (fmi2Component c, Places u, size_t n, Places k, size_t m, const fmi2Real *dk, fmi2Real *du))
NONE(fmi2GetRealOutputDerivatives,
     (fmi2Component c, Places p, size_t n, const fmi2Integer *o, fmi2Real *v))
NONE(fmi2CancelStep, (fmi2Component c))
NONE(fmi2GetStatus, (fmi2Component c, const fmi2StatusKind k, fmi2Status *v))
NONE(fmi2GetRealStatus, (fmi2Component c, const fmi2StatusKind k, fmi2Real *v))
NONE(fmi2GetIntegerStatus, (fmi2Component c, const fmi2StatusKind k, fmi2Integer *v))
NONE(fmi2GetBooleanStatus, (fmi2Component c, const fmi2StatusKind k, fmi2Boolean *v))
NONE(fmi2GetStringStatus, (fmi2Component c, const fmi2StatusKind k, fmi2String *v))
