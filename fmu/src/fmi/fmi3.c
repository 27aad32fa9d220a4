/* SPDX-License-Identifier: BSD-2-Clause */
/* FMI 3.0 Co-Simulation. */
/* The standard gives source code names with this prefix; FMI3_OVERRIDE_FUNCTION_PREFIX, or a header
 * of the importer's own, takes it off for a shared library. */
#ifndef FMI3_FUNCTION_PREFIX
#define FMI3_FUNCTION_PREFIX stickslip_
#endif
/* The importer's header; for one who has none, the standard's lies beside. */
#if __has_include(<fmi3Functions.h>)
#include <fmi3Functions.h>
#else
#include "fmi3Functions.h"
#endif

#include "instance.h"

static fmi3Status status_of(int done)
{
    return done ? fmi3OK : fmi3Error;
}

static void send(const Instance *inst, Severity severity, const char *category, const char *message)
{
    ((fmi3LogMessageCallback)inst->callback)(inst->environment, (fmi3Status)severity, category,
                                             message);
}

static fmi3Status unsupported(fmi3Instance c, const char *function)
{
    if (c)
        stickslip_refuse(c, function, "this co-simulation FMU does not provide it");
    return fmi3Error;
}

static int one_each(const Instance *inst, const char *function, size_t n, size_t n_values)
{
    return inst &&
           (n == n_values ||
            stickslip_refuse(inst, function, "%zu values for %zu scalar variables", n_values, n));
}

static fmi3Status none_of_type(fmi3Instance c, const char *function, size_t n)
{
    if (!c || !stickslip_allowed(c, function, ANY_PHASE))
        return fmi3Error;
    return status_of(n == 0 || stickslip_refuse(c, function, "there is no variable of this type"));
}

const char *fmi3GetVersion(void)
{
    return fmi3Version;
}

fmi3Status fmi3SetDebugLogging(fmi3Instance c, fmi3Boolean on, size_t n,
                               const fmi3String categories[])
{
    return status_of(stickslip_set_logging(c, __func__, on, n, categories));
}

fmi3Instance fmi3InstantiateCoSimulation(
    fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
    fmi3Boolean logging_on, fmi3Boolean event_mode_used, fmi3Boolean early_return_allowed,
    const fmi3ValueReference intermediate[], size_t n_intermediate,
    fmi3InstanceEnvironment environment, fmi3LogMessageCallback log_message,
    fmi3IntermediateUpdateCallback intermediate_update)
{
    (void)resources, (void)visible, (void)early_return_allowed, (void)intermediate;
    (void)intermediate_update;
    const Log log = {send, (AnyFunction)log_message, environment, logging_on};
    Instance *inst = stickslip_new(__func__, name, token, &log);
    if (inst && (event_mode_used || n_intermediate > 0)) {
        stickslip_refuse(inst, __func__, "there is neither event mode nor intermediate update");
        stickslip_free(inst);
        return NULL;
    }
    return inst;
}

static fmi3Instance only_co_simulation(const char *function, fmi3InstanceEnvironment environment,
                                       fmi3LogMessageCallback log_message)
{
    const Instance none = {
        .send = send, .callback = (AnyFunction)log_message, .environment = environment};
    stickslip_refuse(&none, function, "only co-simulation is provided");
    return NULL;
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources,
                                          fmi3Boolean visible, fmi3Boolean logging_on,
                                          fmi3InstanceEnvironment environment,
                                          fmi3LogMessageCallback log_message)
{
    (void)name, (void)token, (void)resources, (void)visible, (void)logging_on;
    return only_co_simulation(__func__, environment, log_message);
}

fmi3Instance fmi3InstantiateScheduledExecution(
    fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
    fmi3Boolean logging_on, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log_message,
    fmi3ClockUpdateCallback clock_update, fmi3LockPreemptionCallback lock,
    fmi3UnlockPreemptionCallback unlock)
{
    (void)name, (void)token, (void)resources, (void)visible, (void)logging_on;
    (void)clock_update, (void)lock, (void)unlock;
    return only_co_simulation(__func__, environment, log_message);
}

void fmi3FreeInstance(fmi3Instance c)
{
    stickslip_free(c);
}

fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean has_tolerance,
                                       fmi3Float64 tolerance, fmi3Float64 start_time,
                                       fmi3Boolean has_stop_time, fmi3Float64 stop_time)
{
    return status_of(stickslip_set_up(c, __func__, has_tolerance, tolerance, start_time,
                                      has_stop_time, stop_time) &&
                     stickslip_enter_initialisation(c, __func__));
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance c)
{
    return status_of(stickslip_exit_initialisation(c, __func__));
}

fmi3Status fmi3Terminate(fmi3Instance c)
{
    return status_of(stickslip_terminate(c, __func__));
}

fmi3Status fmi3Reset(fmi3Instance c)
{
    return status_of(stickslip_reset(c, __func__));
}

fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t n,
                          fmi3Float64 values[], size_t n_values)
{
    return status_of(one_each(c, __func__, n, n_values) &&
                     stickslip_get_reals(c, __func__, vr, n, values));
}

fmi3Status fmi3SetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t n,
                          const fmi3Float64 values[], size_t n_values)
{
    return status_of(one_each(c, __func__, n, n_values) &&
                     stickslip_set_reals(c, __func__, vr, n, values));
}

fmi3Status fmi3GetInt32(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3Int32 values[],
                        size_t n_values)
{
    return status_of(one_each(c, __func__, n, n_values) &&
                     stickslip_get_integers(c, __func__, vr, n, values));
}

fmi3Status fmi3SetInt32(fmi3Instance c, const fmi3ValueReference vr[], size_t n,
                        const fmi3Int32 values[], size_t n_values)
{
    return status_of(one_each(c, __func__, n, n_values) &&
                     stickslip_set_integers(c, __func__, vr, n, values));
}

#define NO_VARIABLES(name)                                                                         \
    fmi3Status fmi3Get##name(fmi3Instance c, const fmi3ValueReference vr[], size_t n,              \
                             fmi3##name values[], size_t n_values)                                 \
    {                                                                                              \
        (void)vr, (void)values, (void)n_values;                                                    \
        return none_of_type(c, __func__, n);                                                       \
    }                                                                                              \
    fmi3Status fmi3Set##name(fmi3Instance c, const fmi3ValueReference vr[], size_t n,              \
                             const fmi3##name values[], size_t n_values)                           \
    {                                                                                              \
        (void)vr, (void)values, (void)n_values;                                                    \
        return none_of_type(c, __func__, n);                                                       \
    }
NO_VARIABLES(Float32)
NO_VARIABLES(Int8)
NO_VARIABLES(UInt8)
NO_VARIABLES(Int16)
NO_VARIABLES(UInt16)
NO_VARIABLES(UInt32)
NO_VARIABLES(Int64)
NO_VARIABLES(UInt64)
NO_VARIABLES(Boolean)
NO_VARIABLES(String)

fmi3Status fmi3GetBinary(fmi3Instance c, const fmi3ValueReference vr[], size_t n, size_t sizes[],
                         fmi3Binary values[], size_t n_values)
{
    (void)vr, (void)sizes, (void)values, (void)n_values;
    return none_of_type(c, __func__, n);
}

fmi3Status fmi3SetBinary(fmi3Instance c, const fmi3ValueReference vr[], size_t n,
                         const size_t sizes[], const fmi3Binary values[], size_t n_values)
{
    (void)vr, (void)sizes, (void)values, (void)n_values;
    return none_of_type(c, __func__, n);
}

fmi3Status fmi3GetClock(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3Clock values[])
{
    (void)vr, (void)values;
    return none_of_type(c, __func__, n);
}

fmi3Status fmi3SetClock(fmi3Instance c, const fmi3ValueReference vr[], size_t n,
                        const fmi3Clock values[])
{
    (void)vr, (void)values;
    return none_of_type(c, __func__, n);
}

fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState *state)
{
    return status_of(stickslip_get_state(c, __func__, state));
}

fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState state)
{
    return status_of(stickslip_set_state(c, __func__, state));
}

fmi3Status fmi3FreeFMUState(fmi3Instance c, fmi3FMUState *state)
{
    return status_of(stickslip_free_state(c, __func__, state));
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance c, fmi3FMUState state, size_t *size)
{
    return status_of(stickslip_state_size(c, __func__, state, size));
}

fmi3Status fmi3SerializeFMUState(fmi3Instance c, fmi3FMUState state, fmi3Byte bytes[], size_t size)
{
    return status_of(stickslip_serialise(c, __func__, state, bytes, size));
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance c, const fmi3Byte bytes[], size_t size,
                                   fmi3FMUState *state)
{
    return status_of(stickslip_deserialise(c, __func__, bytes, size, state));
}

fmi3Status fmi3GetDirectionalDerivative(fmi3Instance c, const fmi3ValueReference unknowns[],
                                        size_t n_unknowns, const fmi3ValueReference knowns[],
                                        size_t n_knowns, const fmi3Float64 seed[], size_t n_seed,
                                        fmi3Float64 sensitivity[], size_t n_sensitivity)
{
    return status_of(one_each(c, __func__, n_knowns, n_seed) &&
                     one_each(c, __func__, n_unknowns, n_sensitivity) &&
                     stickslip_derivative(c, __func__, unknowns, n_unknowns, knowns, n_knowns, seed,
                                          sensitivity));
}

fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 time, fmi3Float64 h,
                      fmi3Boolean no_set_state_before, fmi3Boolean *event_handling_needed,
                      fmi3Boolean *terminate, fmi3Boolean *early_return, fmi3Float64 *last_time)
{
    (void)no_set_state_before;
    const int done = stickslip_step(c, __func__, time, h);
    if (event_handling_needed)
        *event_handling_needed = fmi3False;
    if (terminate)
        *terminate = fmi3False;
    if (early_return)
        *early_return = fmi3False;
    if (last_time && c)
        *last_time = ((Instance *)c)->state.time;
    return status_of(done);
}

#include "fmi3Unsupported.h"
