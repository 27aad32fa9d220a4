/* SPDX-License-Identifier: BSD-2-Clause */
/* What importers of FMI 3.0 expect to find in a library, and no co-simulation FMU here provides. What
 * includes this has a function unsupported() that tells so. Under the 2-Clause BSD License. */

#define UNSUPPORTED(function, ...)                                                                 \
    fmi3Status function(fmi3Instance c, __VA_ARGS__)                                               \
    {                                                                                              \
        return unsupported(c, __func__);                                                           \
    }
#define UNSUPPORTED_PLAIN(function)                                                                \
    fmi3Status function(fmi3Instance c)                                                            \
    {                                                                                              \
        return unsupported(c, __func__);                                                           \
    }
#if defined __GNUC__
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif
UNSUPPORTED_PLAIN(fmi3EnterEventMode)
UNSUPPORTED_PLAIN(fmi3EnterStepMode)
UNSUPPORTED_PLAIN(fmi3EnterConfigurationMode)
UNSUPPORTED_PLAIN(fmi3ExitConfigurationMode)
UNSUPPORTED_PLAIN(fmi3EnterContinuousTimeMode)
UNSUPPORTED_PLAIN(fmi3EvaluateDiscreteStates)
UNSUPPORTED(fmi3GetNumberOfVariableDependencies, fmi3ValueReference vr, size_t *n)
UNSUPPORTED(fmi3GetVariableDependencies, fmi3ValueReference dependent, size_t elements[],
            fmi3ValueReference independents[], size_t elements_of[], fmi3DependencyKind kinds[],
            size_t n)
UNSUPPORTED(fmi3GetAdjointDerivative, const fmi3ValueReference unknowns[], size_t n_unknowns,
            const fmi3ValueReference knowns[], size_t n_knowns, const fmi3Float64 seed[],
            size_t n_seed, fmi3Float64 sensitivity[], size_t n_sensitivity)
UNSUPPORTED(fmi3GetIntervalDecimal, const fmi3ValueReference vr[], size_t n, fmi3Float64 intervals[],
            fmi3IntervalQualifier qualifiers[])
UNSUPPORTED(fmi3GetIntervalFraction, const fmi3ValueReference vr[], size_t n, fmi3UInt64 counters[],
            fmi3UInt64 resolutions[], fmi3IntervalQualifier qualifiers[])
UNSUPPORTED(fmi3GetShiftDecimal, const fmi3ValueReference vr[], size_t n, fmi3Float64 shifts[])
UNSUPPORTED(fmi3GetShiftFraction, const fmi3ValueReference vr[], size_t n, fmi3UInt64 counters[],
            fmi3UInt64 resolutions[])
UNSUPPORTED(fmi3SetIntervalDecimal, const fmi3ValueReference vr[], size_t n,
            const fmi3Float64 intervals[])
UNSUPPORTED(fmi3SetIntervalFraction, const fmi3ValueReference vr[], size_t n,
            const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
UNSUPPORTED(fmi3SetShiftDecimal, const fmi3ValueReference vr[], size_t n,
            const fmi3Float64 shifts[])
UNSUPPORTED(fmi3SetShiftFraction, const fmi3ValueReference vr[], size_t n,
            const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
UNSUPPORTED(fmi3UpdateDiscreteStates, fmi3Boolean *need_update, fmi3Boolean *terminate,
            fmi3Boolean *nominals_changed, fmi3Boolean *values_changed,
            fmi3Boolean *next_time_defined, fmi3Float64 *next_time)
UNSUPPORTED(fmi3CompletedIntegratorStep, fmi3Boolean no_set_state_before, fmi3Boolean *enter,
            fmi3Boolean *terminate)
UNSUPPORTED(fmi3SetTime, fmi3Float64 time)
UNSUPPORTED(fmi3SetContinuousStates, const fmi3Float64 x[], size_t n)
UNSUPPORTED(fmi3GetContinuousStateDerivatives, fmi3Float64 dx[], size_t n)
UNSUPPORTED(fmi3GetEventIndicators, fmi3Float64 indicators[], size_t n)
UNSUPPORTED(fmi3GetContinuousStates, fmi3Float64 x[], size_t n)
UNSUPPORTED(fmi3GetNominalsOfContinuousStates, fmi3Float64 nominals[], size_t n)
UNSUPPORTED(fmi3GetNumberOfEventIndicators, size_t *n)
UNSUPPORTED(fmi3GetNumberOfContinuousStates, size_t *n)
UNSUPPORTED(fmi3GetOutputDerivatives, const fmi3ValueReference vr[], size_t n,
            const fmi3Int32 orders[], fmi3Float64 values[], size_t n_values)
UNSUPPORTED(fmi3ActivateModelPartition, fmi3ValueReference clock, fmi3Float64 time)
