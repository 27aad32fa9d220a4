/* SPDX-License-Identifier: BSD-2-Clause */
/* FMI 3.0 co-simulation of a model. */
#include <stdlib.h>

#include "fmi3Functions.h"

#include "instance.h"

static fmi3Status status_of(int done)
{
    return done ? fmi3OK : fmi3Error;
}

static void send(const Instance *inst, const char *message)
{
    ((fmi3LogMessageCallback)inst->log)(inst->environment, fmi3Error, "logStatusError", message);
}

const char *fmi3GetVersion(void) { return fmi3Version; }

fmi3Instance fmi3InstantiateCoSimulation(
    fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
    fmi3Boolean logging, fmi3Boolean event_mode, fmi3Boolean early_return,
    const fmi3ValueReference intermediate[], size_t n_intermediate,
    fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
    fmi3IntermediateUpdateCallback update)
{
    (void)visible, (void)logging, (void)early_return, (void)intermediate, (void)update;
    if (event_mode || n_intermediate > 0)
        return NULL; /* the description says that there is neither */
    return thin_new(name, token, resources, send, (AnyFunction *)log, environment);
}

void fmi3FreeInstance(fmi3Instance c) { thin_free(c); }
fmi3Status fmi3Reset(fmi3Instance c) { return status_of(thin_reset(c)); }
fmi3Status fmi3ExitInitializationMode(fmi3Instance c) { return status_of(thin_start(c)); }
fmi3Status fmi3Terminate(fmi3Instance c) { return status_of(c != NULL); }

fmi3Status fmi3SetDebugLogging(fmi3Instance c, fmi3Boolean on, size_t n, const fmi3String names[])
{
    (void)on, (void)n, (void)names;
    return status_of(c != NULL);
}

fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean has_tolerance,
                                       fmi3Float64 tolerance, fmi3Float64 start,
                                       fmi3Boolean has_stop, fmi3Float64 stop)
{
    Instance *inst = c;
    (void)has_tolerance, (void)tolerance;
    if (start != 0.0)
        return status_of(thin_refuse(inst, "the start time must be 0, not %g s", start));
    if (has_stop)
        inst->run.stop = stop;
    return fmi3OK;
}

fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference places[], size_t n,
                          fmi3Float64 values[], size_t n_values)
{
    return status_of(n == n_values && thin_get(c, places, n, values));
}

fmi3Status fmi3SetFloat64(fmi3Instance c, const fmi3ValueReference places[], size_t n,
                          const fmi3Float64 values[], size_t n_values)
{
    return status_of(n == n_values && thin_set(c, places, n, values));
}

fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 time, fmi3Float64 h, fmi3Boolean no_set_state,
                      fmi3Boolean *event, fmi3Boolean *terminate, fmi3Boolean *early,
                      fmi3Float64 *reached)
{
    (void)no_set_state;
    const int done = thin_step(c, time, h);
    *event = *terminate = *early = fmi3False;
    *reached = ((Instance *)c)->run.time;
    return status_of(done);
}

fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState *state)
{
    return status_of(thin_save(c, state));
}

fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState state)
{
    return status_of(thin_restore(c, state));
}

fmi3Status fmi3FreeFMUState(fmi3Instance c, fmi3FMUState *state)
{
    (void)c;
    free(*state);
    *state = NULL;
    return fmi3OK;
}

/* What a model of numbers has not, and importers expect to find in the library. */

#pragma GCC diagnostic ignored "-Wunused-parameter"

fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources,
                                          fmi3Boolean visible, fmi3Boolean logging,
                                          fmi3InstanceEnvironment environment,
                                          fmi3LogMessageCallback log)
{
    return NULL;
}

fmi3Instance fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token,
                                               fmi3String resources, fmi3Boolean visible,
                                               fmi3Boolean logging,
                                               fmi3InstanceEnvironment environment,
                                               fmi3LogMessageCallback log,
                                               fmi3ClockUpdateCallback clock_update,
                                               fmi3LockPreemptionCallback lock,
                                               fmi3UnlockPreemptionCallback unlock)
{
    return NULL;
}

#define IDLE(NAME)                                                                                 \
    fmi3Status fmi3Get##NAME(fmi3Instance c, const fmi3ValueReference p[], size_t n,               \
                             fmi3##NAME v[], size_t m)                                             \
    {                                                                                              \
        return status_of(n == 0 || (c && thin_refuse(c, "it has no variable of this type")));      \
    }                                                                                              \
    fmi3Status fmi3Set##NAME(fmi3Instance c, const fmi3ValueReference p[], size_t n,               \
                             const fmi3##NAME v[], size_t m)                                       \
    {                                                                                              \
        return status_of(n == 0 || (c && thin_refuse(c, "it has no variable of this type")));      \
    }
IDLE(Float32)
IDLE(Int8)
IDLE(UInt8)
IDLE(Int16)
IDLE(UInt16)
IDLE(Int32)
IDLE(UInt32)
IDLE(Int64)
IDLE(UInt64)
IDLE(Boolean)
IDLE(String)

static fmi3Status unsupported(fmi3Instance c, const char *function)
{
    return status_of(c && thin_refuse(c, "it does not provide %s", function));
}

#include "fmi3Unsupported.h"

UNSUPPORTED(fmi3GetBinary, const fmi3ValueReference p[], size_t n, size_t sizes[], fmi3Binary v[],
            size_t m)
UNSUPPORTED(fmi3SetBinary, const fmi3ValueReference p[], size_t n, const size_t sizes[],
            const fmi3Binary v[], size_t m)
UNSUPPORTED(fmi3GetClock, const fmi3ValueReference p[], size_t n, fmi3Clock v[])
UNSUPPORTED(fmi3SetClock, const fmi3ValueReference p[], size_t n, const fmi3Clock v[])
UNSUPPORTED(fmi3SerializedFMUStateSize, fmi3FMUState s, size_t *n)
UNSUPPORTED(fmi3SerializeFMUState, fmi3FMUState s, fmi3Byte b[], size_t n)
UNSUPPORTED(fmi3DeserializeFMUState, const fmi3Byte b[], size_t n, fmi3FMUState *s)
UNSUPPORTED(fmi3GetDirectionalDerivative, const fmi3ValueReference u[], size_t n,
            const fmi3ValueReference k[], size_t m, const fmi3Float64 s[], size_t ns,
            fmi3Float64 d[], size_t nd)
