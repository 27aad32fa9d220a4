/* SPDX-License-Identifier: BSD-2-Clause */
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "instance.h"

static const double ON_TIME = 1e-9; /* of a step: how far its begin may be from the last one's end */

int thin_refuse(Instance *inst, const char *format, ...)
{
    char text[640];
    va_list values;
    va_start(values, format);
    vsnprintf(text, sizeof text, format, values);
    va_end(values);
    if (inst->log)
        inst->send(inst, text);
    return 0;
}

static size_t size_of(const Model *m)
{
    return ((size_t)m->count + 1) * sizeof(double);
}

static void rest(Instance *inst)
{
    const Model *m = inst->model;
    memset(inst->run.state, 0, m->state);
    for (int k = 0; k < m->count; k++)
        inst->run.v[k + 1] = m->variables[k].start;
    inst->run.v[0] = inst->run.time = 0.0;
    inst->run.stop = INFINITY;
    inst->started = inst->stale = 0;
}

/* FMI 2.0 gives an address, which importers write as file:///a, file:/a or file://localhost/a. */
static char *path_of(const char *resources)
{
    char *path = malloc(strlen(resources) + 1), *to = path;
    if (strncmp(resources, "file:", 5) == 0) {
        resources += 5;
        if (strncmp(resources, "//", 2) == 0)
            resources += 2 + strcspn(resources + 2, "/");
        while (*resources) {
            char digits[3] = {0};
            if (*resources == '%' && resources[1] && resources[2]) {
                memcpy(digits, resources + 1, 2);
                *to++ = (char)strtol(digits, NULL, 16);
                resources += 3;
            } else {
                *to++ = *resources++;
            }
        }
        *to = '\0';
    } else {
        strcpy(path, resources);
    }
    return path;
}

Instance *thin_new(const char *name, const char *token, const char *resources, Sender *send,
                   AnyFunction *log, void *environment)
{
    Instance *inst = calloc(1, sizeof *inst);
    if (!inst)
        return NULL;
    inst->send = send;
    inst->log = log;
    inst->environment = environment;
    inst->name = strcpy(malloc(strlen(name ? name : "") + 1), name ? name : "");
    inst->resources = path_of(resources ? resources : "");
    inst->run.resources = inst->resources;
    inst->model = model(inst->resources, inst->run.why);
    if (!inst->model)
        thin_refuse(inst, "%s", inst->run.why);
    else if (!token || strcmp(token, inst->model->token) != 0)
        thin_refuse(inst, "the FMU's token is %s, not %s", inst->model->token, token ? token : "");
    else {
        inst->run.v = calloc(1, size_of(inst->model));
        inst->run.state = calloc(1, inst->model->state + 1);
        rest(inst);
        return inst;
    }
    thin_free(inst);
    return NULL;
}

static void end(Instance *inst)
{
    if (inst->started && inst->model->end)
        inst->model->end(&inst->run);
    inst->started = 0;
}

void thin_free(Instance *inst)
{
    if (!inst)
        return;
    if (inst->model)
        end(inst);
    if (inst->model && inst->model->close)
        inst->model->close();
    free(inst->run.v);
    free(inst->run.state);
    free(inst->resources);
    free(inst->name);
    free(inst);
}

int thin_reset(Instance *inst)
{
    end(inst);
    rest(inst);
    return 1;
}

int thin_start(Instance *inst)
{
    if (inst->started)
        return thin_refuse(inst, "it has been started already");
    inst->started = 1;
    inst->stale = 1; /* outputs may depend on the inputs' values at the start */
    return !inst->model->start || inst->model->start(&inst->run) ||
           thin_refuse(inst, "%s", inst->run.why);
}

int thin_step(Instance *inst, double time, double h)
{
    Run *run = &inst->run;
    if (!inst->started)
        return thin_refuse(inst, "a step needs the initialization to be over");
    if (!(h > 0.0) || !isfinite(h))
        return thin_refuse(inst, "a step must be longer than 0, not %g s", h);
    if (fabs(time - run->time) > ON_TIME * h + 1e-15 * fabs(time))
        return thin_refuse(inst, "a step must begin at %.17g s, where the last one has ended, "
                                 "not at %.17g s", run->time, time);
    if (run->time + h > run->stop * (1.0 + 1e-12) + ON_TIME * h)
        return thin_refuse(inst, "a step to %.17g s goes past the stop time, %.17g s",
                           run->time + h, run->stop);
    if (!inst->model->step_by(run, h))
        return thin_refuse(inst, "%s", run->why);
    for (int k = 0; k < inst->model->count; k++) {
        const Variable *variable = &inst->model->variables[k];
        if (variable->kind == INPUT && variable->slope)
            run->v[k + 1] += run->v[variable->slope] * h;
    }
    run->v[0] = run->time = time + h;
    inst->stale = 1;
    return 1;
}

int thin_set(Instance *inst, const uint32_t *places, size_t n, const double *values)
{
    for (size_t k = 0; k < n; k++) {
        if (places[k] < 1 || places[k] > (uint32_t)inst->model->count)
            return thin_refuse(inst, "there is no variable %u to set", (unsigned)places[k]);
        const Variable *variable = &inst->model->variables[places[k] - 1];
        if (variable->kind == OUTPUT || (variable->kind == PARAMETER && inst->started))
            return thin_refuse(inst, "%s cannot be set now", variable->name);
        if (!isfinite(values[k]))
            return thin_refuse(inst, "%s must be a finite number", variable->name);
    }
    for (size_t k = 0; k < n; k++)
        inst->run.v[places[k]] = values[k];
    inst->stale = 1;
    return 1;
}

int thin_get(Instance *inst, const uint32_t *places, size_t n, double *values)
{
    if (inst->stale && inst->started && inst->model->outputs)
        inst->model->outputs(&inst->run);
    inst->stale = 0;
    for (size_t k = 0; k < n; k++) {
        if (places[k] > (uint32_t)inst->model->count)
            return thin_refuse(inst, "there is no variable %u", (unsigned)places[k]);
        values[k] = inst->run.v[places[k]];
    }
    return 1;
}

typedef struct {
    double time, stop;
    int started, stale;
} Head;

int thin_save(Instance *inst, void **state)
{
    const size_t values = size_of(inst->model);
    if (inst->model->alone)
        return thin_refuse(inst, "its state cannot be saved");
    if (!*state)
        *state = malloc(sizeof(Head) + values + inst->model->state);
    if (!*state)
        return thin_refuse(inst, "the memory ran out");
    char *to = *state;
    const Head head = {inst->run.time, inst->run.stop, inst->started, inst->stale};
    memcpy(to, &head, sizeof head);
    memcpy(to + sizeof head, inst->run.v, values);
    memcpy(to + sizeof head + values, inst->run.state, inst->model->state);
    return 1;
}

int thin_restore(Instance *inst, const void *state)
{
    const size_t values = size_of(inst->model);
    const char *from = state;
    Head head;
    if (inst->model->alone || !state)
        return thin_refuse(inst, "there is no state to go back to");
    memcpy(&head, from, sizeof head);
    inst->run.time = head.time;
    inst->run.stop = head.stop;
    inst->started = head.started;
    inst->stale = head.stale;
    memcpy(inst->run.v, from + sizeof head, values);
    memcpy(inst->run.state, from + sizeof head + values, inst->model->state);
    return 1;
}
