/* SPDX-License-Identifier: BSD-2-Clause */
/* FMI 2.0 Co-Simulation. */
/* The standard gives source code names with this prefix; FMI2_OVERRIDE_FUNCTION_PREFIX, or a header
 * of the importer's own, takes it off for a shared library. */
#ifndef FMI2_FUNCTION_PREFIX
#define FMI2_FUNCTION_PREFIX stickslip_
#endif
/* The importer's header; for one who has none, the standard's lies beside. */
#if __has_include(<fmi2Functions.h>)
#include <fmi2Functions.h>
#else
#include "fmi2Functions.h"
#endif

#include "instance.h"

static fmi2Status status_of(int done)
{
    return done ? fmi2OK : fmi2Error;
}

/* The importer takes the message for a printf format, in which # marks variables. */
static void send(const Instance *inst, Severity severity, const char *category, const char *message)
{
    char format[1024];
    size_t used = 0;
    for (; *message && used + 2 < sizeof format; message++) {
        if (*message == '%' || *message == '#')
            format[used++] = *message;
        format[used++] = *message;
    }
    format[used] = '\0';
    ((fmi2CallbackLogger)inst->callback)(inst->environment, inst->name, (fmi2Status)severity,
                                         category, format);
}

static fmi2Status unsupported(fmi2Component c, const char *function)
{
    if (c)
        stickslip_refuse(c, function, "this co-simulation FMU does not provide it");
    return fmi2Error;
}

static fmi2Status none_of_type(fmi2Component c, const char *function, size_t n)
{
    if (!c || !stickslip_allowed(c, function, ANY_PHASE))
        return fmi2Error;
    return status_of(n == 0 || stickslip_refuse(c, function, "there is no variable of this type"));
}

const char *fmi2GetTypesPlatform(void)
{
    return fmi2TypesPlatform;
}

const char *fmi2GetVersion(void)
{
    return fmi2Version;
}

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n,
                               const fmi2String categories[])
{
    return status_of(stickslip_set_logging(c, __func__, on, n, categories));
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible,
                              fmi2Boolean logging_on)
{
    (void)resources, (void)visible;
    Log log = {send, NULL, NULL, logging_on};
    if (functions) {
        log.callback = (AnyFunction)functions->logger;
        log.environment = functions->componentEnvironment;
    }
    Instance *inst = stickslip_new(__func__, name, guid, &log);
    if (inst && type != fmi2CoSimulation) {
        stickslip_refuse(inst, __func__, "only co-simulation is provided");
        stickslip_free(inst);
        return NULL;
    }
    return inst;
}

void fmi2FreeInstance(fmi2Component c)
{
    stickslip_free(c);
}

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean has_tolerance, fmi2Real tolerance,
                               fmi2Real start_time, fmi2Boolean has_stop_time, fmi2Real stop_time)
{
    return status_of(stickslip_set_up(c, __func__, has_tolerance, tolerance, start_time,
                                      has_stop_time, stop_time));
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c)
{
    return status_of(stickslip_enter_initialisation(c, __func__));
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c)
{
    return status_of(stickslip_exit_initialisation(c, __func__));
}

fmi2Status fmi2Terminate(fmi2Component c)
{
    return status_of(stickslip_terminate(c, __func__));
}

fmi2Status fmi2Reset(fmi2Component c)
{
    return status_of(stickslip_reset(c, __func__));
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real values[])
{
    return status_of(stickslip_get_reals(c, __func__, vr, n, values));
}

fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                          fmi2Integer values[])
{
    return status_of(stickslip_get_integers(c, __func__, vr, n, values));
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                       const fmi2Real values[])
{
    return status_of(stickslip_set_reals(c, __func__, vr, n, values));
}

fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                          const fmi2Integer values[])
{
    return status_of(stickslip_set_integers(c, __func__, vr, n, values));
}

#define NO_VARIABLES(function, constant, type)                                                     \
    fmi2Status function(fmi2Component c, const fmi2ValueReference vr[], size_t n,                 \
                        constant type values[])                                                   \
    {                                                                                             \
        (void)vr, (void)values;                                                                   \
        return none_of_type(c, __func__, n);                                                      \
    }
NO_VARIABLES(fmi2GetBoolean, , fmi2Boolean)
NO_VARIABLES(fmi2GetString, , fmi2String)
NO_VARIABLES(fmi2SetBoolean, const, fmi2Boolean)
NO_VARIABLES(fmi2SetString, const, fmi2String)

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state)
{
    return status_of(stickslip_get_state(c, __func__, state));
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state)
{
    return status_of(stickslip_set_state(c, __func__, state));
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state)
{
    return status_of(stickslip_free_state(c, __func__, state));
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size)
{
    return status_of(stickslip_state_size(c, __func__, state, size));
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size)
{
    return status_of(stickslip_serialise(c, __func__, state, bytes, size));
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size,
                                   fmi2FMUstate *state)
{
    return status_of(stickslip_deserialise(c, __func__, bytes, size, state));
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference unknowns[],
                                        size_t n_unknowns, const fmi2ValueReference knowns[],
                                        size_t n_knowns, const fmi2Real seed[],
                                        fmi2Real sensitivity[])
{
    return status_of(stickslip_derivative(c, __func__, unknowns, n_unknowns, knowns, n_knowns, seed,
                                          sensitivity));
}

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                                       const fmi2Integer orders[], const fmi2Real values[])
{
    return status_of(stickslip_set_slopes(c, __func__, vr, n, orders, values));
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real h, fmi2Boolean no_set_state_before)
{
    (void)no_set_state_before;
    return status_of(stickslip_step(c, __func__, time, h));
}

fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value)
{
    if (!c || kind != fmi2LastSuccessfulTime || !value)
        return unsupported(c, __func__);
    *value = ((Instance *)c)->state.time;
    return fmi2OK;
}

fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value)
{
    if (!c || kind != fmi2Terminated || !value)
        return unsupported(c, __func__);
    *value = ((Instance *)c)->state.phase == TERMINATED;
    return fmi2OK;
}

/* The rest of the interface, which importers expect to find in the library. */

#define UNSUPPORTED(function, ...)                                                                 \
    fmi2Status function(fmi2Component c, __VA_ARGS__)                                              \
    {                                                                                              \
        return unsupported(c, __func__);                                                           \
    }
#if defined __GNUC__
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif
fmi2Status fmi2CancelStep(fmi2Component c)
{
    return unsupported(c, __func__);
}
fmi2Status fmi2EnterEventMode(fmi2Component c)
{
    return unsupported(c, __func__);
}
fmi2Status fmi2EnterContinuousTimeMode(fmi2Component c)
{
    return unsupported(c, __func__);
}
UNSUPPORTED(fmi2GetRealOutputDerivatives, const fmi2ValueReference vr[], size_t n,
            const fmi2Integer orders[], fmi2Real values[])
UNSUPPORTED(fmi2GetStatus, const fmi2StatusKind kind, fmi2Status *value)
UNSUPPORTED(fmi2GetIntegerStatus, const fmi2StatusKind kind, fmi2Integer *value)
UNSUPPORTED(fmi2GetStringStatus, const fmi2StatusKind kind, fmi2String *value)
UNSUPPORTED(fmi2NewDiscreteStates, fmi2EventInfo *info)
UNSUPPORTED(fmi2CompletedIntegratorStep, fmi2Boolean no_set_state_before, fmi2Boolean *enter,
            fmi2Boolean *terminate)
UNSUPPORTED(fmi2SetTime, fmi2Real time)
UNSUPPORTED(fmi2SetContinuousStates, const fmi2Real x[], size_t n)
UNSUPPORTED(fmi2GetDerivatives, fmi2Real dx[], size_t n)
UNSUPPORTED(fmi2GetEventIndicators, fmi2Real indicators[], size_t n)
UNSUPPORTED(fmi2GetContinuousStates, fmi2Real x[], size_t n)
UNSUPPORTED(fmi2GetNominalsOfContinuousStates, fmi2Real nominals[], size_t n)
