/* SPDX-License-Identifier: BSD-2-Clause */
/* Life of an instance: creation, call order, time, messages. */
#include "instance.h"

#include <float.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "references.h"

enum { MESSAGE_SIZE = MODEL_MESSAGE_SIZE + 256 };

int stickslip_refuse(const Instance *inst, const char *function, const char *format, ...)
{
    char message[MESSAGE_SIZE];
    int used = snprintf(message, sizeof message, "%s: ", function);
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(message + used, sizeof message - (size_t)used, format, arguments);
    va_end(arguments);
    if (inst->callback)
        inst->send(inst, SEVERITY_ERROR, "logStatusError", message);
    return 0;
}

int stickslip_untimely(const Instance *inst, const char *function)
{
    const int phase = inst->state.phase;
    return stickslip_refuse(inst, function, "not allowed %s",
                            phase == INSTANTIATED   ? "before the initialization mode"
                            : phase == INITIALISING ? "in the initialization mode"
                            : phase == STEPPING     ? "once the initialization mode was left"
                                                    : "after termination");
}

static void start_over(Instance *inst)
{
    memset(&inst->state, 0, sizeof inst->state);
    stickslip_model_defaults(&inst->state.model);
    inst->state.phase = INSTANTIATED;
}

Instance *stickslip_new(const char *function, const char *name, const char *token, const Log *log)
{
    Instance *inst = calloc(1, sizeof *inst);
    if (!inst)
        return NULL;
    inst->send = log->send;
    inst->callback = log->callback;
    inst->environment = log->environment;
    inst->log_events = log->log_events;
    const char *known = name ? name : "";
    inst->name = malloc(strlen(known) + 1);
    if (inst->name) {
        strcpy(inst->name, known);
        if (!*known)
            stickslip_refuse(inst, function, "the instance has no name");
        else if (!token || strcmp(token, TOKEN_TEXT) != 0)
            stickslip_refuse(inst, function,
                             "the model description belongs to another build (%.100s, here %s)",
                             token ? token : "none", TOKEN_TEXT);
        else {
            start_over(inst);
            return inst;
        }
    }
    stickslip_free(inst);
    return NULL;
}

void stickslip_free(Instance *inst)
{
    if (!inst)
        return;
    free(inst->name);
    free(inst);
}

int stickslip_set_logging(Instance *inst, const char *function, int on, size_t n,
                          const char *const categories[])
{
    if (!stickslip_allowed(inst, function, ANY_PHASE))
        return 0;
    int events = n == 0; /* no names mean all of them */
    for (size_t i = 0; i < n; i++) {
        const char *category = categories ? categories[i] : NULL;
        if (category && strcmp(category, "logEvents") == 0)
            events = 1;
        else if (!category || strcmp(category, "logStatusError") != 0)
            return stickslip_refuse(inst, function, "no log category is called %.100s",
                                    category ? category : "(null)");
    }
    if (events)
        inst->log_events = on;
    return 1;
}

int stickslip_set_up(Instance *inst, const char *function, int has_tolerance, double tolerance,
                     double start_time, int has_stop_time, double stop_time)
{
    char message[MODEL_MESSAGE_SIZE];
    if (!stickslip_allowed(inst, function, INSTANTIATED))
        return 0;
    State *s = &inst->state;
    if (!isfinite(start_time))
        return stickslip_refuse(inst, function, "the start time must be finite");
    if (has_stop_time && !(stop_time >= start_time))
        return stickslip_refuse(inst, function,
                                "the stop time %g s is not after the start time %g s", stop_time,
                                start_time);
    if (has_tolerance && !s->tolerance_set &&
        stickslip_model_set_real(&s->model, offsetof(Reals, tolerance) / sizeof(double), tolerance,
                                 message))
        return stickslip_refuse(inst, function, "%s", message);
    s->time = start_time;
    s->has_stop_time = has_stop_time != 0;
    s->stop_time = has_stop_time ? stop_time : 0.0;
    return 1;
}

int stickslip_enter_initialisation(Instance *inst, const char *function)
{
    if (!stickslip_allowed(inst, function, INSTANTIATED))
        return 0;
    inst->state.phase = INITIALISING;
    return 1;
}

int stickslip_exit_initialisation(Instance *inst, const char *function)
{
    char message[MODEL_MESSAGE_SIZE];
    if (!stickslip_allowed(inst, function, INITIALISING))
        return 0;
    Model start = inst->state.model;
    start.initialised = 0;
    if (stickslip_model_initialise(&start, message))
        return stickslip_refuse(inst, function, "%s", message);
    inst->state.model = start;
    inst->state.outputs_stale = 0;
    inst->state.phase = STEPPING;
    return 1;
}

static void tell_events(const Instance *inst, const char *function, const Model *before)
{
    const Model *now = &inst->state.model;
    /* The counters may have gone round. */
    const unsigned impacts = (unsigned)now->n.impacts - (unsigned)before->n.impacts;
    const unsigned changes =
        (unsigned)now->n.stick_slip_events - (unsigned)before->n.stick_slip_events;
    if (!inst->callback || impacts + changes == 0)
        return;
    char message[MESSAGE_SIZE];
    snprintf(message, sizeof message, "%s: %u impacts and %u stick-slip changes until %.9g s",
             function, impacts, changes, inst->state.time);
    inst->send(inst, SEVERITY_OK, "logEvents", message);
}

/* Where steps of the integration end, which may fail. */
static int step_on(Instance *inst, const char *function, double time, double h)
{
    char message[MODEL_MESSAGE_SIZE];
    State *s = &inst->state;
    Model before = s->model;
    if (stickslip_model_step(&s->model, h, message)) {
        s->model = before;
        return stickslip_refuse(inst, function, "%s", message);
    }
    s->time = time + h;
    s->outputs_stale = !s->model.ahead.active;
    if (inst->log_events)
        tell_events(inst, function, &before);
    return 1;
}

/* Does a step go on from the current time, and end before the stop time? */
static int is_timely(const Instance *inst, const char *function, double time, double h)
{
    const State *s = &inst->state;
    const double said = fabs(time), known = fabs(s->time);
    const double slack = 1e-9 * h + 4.0 * DBL_EPSILON * (said > known ? said : known);
    if (!(fabs(time - s->time) <= slack))
        return stickslip_refuse(inst, function,
                                "the communication point %.17g s is not the current time %.17g s",
                                time, s->time);
    /* Importers that add up their steps miss the stop time by far more than an ulp. */
    if (s->has_stop_time && time + h > s->stop_time + slack + 1e-3 * h)
        return stickslip_refuse(inst, function, "a step to %.17g s goes past the stop time %.17g s",
                                time + h, s->stop_time);
    return 1;
}

int stickslip_step(Instance *inst, const char *function, double time, double h)
{
    if (!stickslip_allowed(inst, function, STEPPING))
        return 0;
    State *s = &inst->state;
    if (!(h > 0.0) || !isfinite(time + h))
        return stickslip_refuse(
            inst, function, "a step of %g s from %g s: it must be positive and finite", h, time);
    if ((time != s->time || s->has_stop_time) && !is_timely(inst, function, time, h))
        return 0;
    if (!stickslip_model_step_within(&s->model, h))
        return step_on(inst, function, time, h);
    s->time = time + h;
    s->outputs_stale = 0;
    return 1;
}

int stickslip_terminate(Instance *inst, const char *function)
{
    if (!stickslip_allowed(inst, function, STEPPING))
        return 0;
    inst->state.phase = TERMINATED;
    return 1;
}

int stickslip_reset(Instance *inst, const char *function)
{
    if (!stickslip_allowed(inst, function, ANY_PHASE))
        return 0;
    start_over(inst);
    return 1;
}
