/* SPDX-License-Identifier: BSD-2-Clause */
/* Could a model that comes from elsewhere, byte by byte, be one that was left by a step? Its checksum
 * tells only that nobody has damaged it by chance. What is sound can be integrated: no index leaves
 * its array, no loop goes on for ever, and what is still absurd fails as a step. */
#include "model.h"

#include <math.h>
#include <stdio.h>

#include "event.h"
#include "events.h"

static int say(char *message, const char *what)
{
    snprintf(message, MODEL_MESSAGE_SIZE, "%s", what);
    return -1;
}

static int are_finite(const double *values, size_t n)
{
    for (size_t i = 0; i < n; i++)
        if (!isfinite(values[i]))
            return 0;
    return 1;
}

static int is_flag(int value)
{
    return value == 0 || value == 1;
}

static int is_sign(int value)
{
    return value >= -1 && value <= 1;
}

/* Inputs go on with their slopes, beyond the range in which they can be set. */
static int is_in_range(const VariableInfo *info, double value)
{
    if (!isfinite(value) || info->kind == KIND_OUTPUT)
        return isfinite(value);
    if (info->kind == KIND_INPUT)
        return info->min < 0.0 || value >= info->min;
    return value >= info->min && value <= info->max;
}

static int check_variables(const Model *m, char *message)
{
    const double *reals = (const double *)&m->r;
    const int *integers = (const int *)&m->n;
    const char *name = NULL;
    for (size_t i = 0; i < N_REALS && !name; i++)
        if (!is_in_range(&stickslip_real_info[i], reals[i]))
            name = stickslip_real_info[i].name;
    for (size_t i = 0; i < N_INTEGERS && !name; i++)
        if (!is_in_range(&stickslip_integer_info[i], integers[i]))
            name = stickslip_integer_info[i].name;
    if (!name)
        return 0;
    snprintf(message, MODEL_MESSAGE_SIZE, "its %s is out of range", name);
    return -1;
}

static int is_mode(const Model *m, const Mode *mode)
{
    const int rigid = m->n.contact == 2;
    const int wall = (int)mode->wall;
    if (!(wall == WALL_FREE || (rigid && wall == WALL_REST) ||
          (!rigid && (wall == WALL_TOUCH || wall == WALL_PARTING))))
        return 0;
    return is_sign(mode->side) && (wall == WALL_FREE || mode->side) && is_sign(mode->slip) &&
           is_sign(mode->plate) && is_sign(mode->output) && is_sign(mode->limited) &&
           (m->n.source || !(mode->output || mode->limited));
}

/* The event that ends the step under way must be one that the present mode has. */
static int is_due(const Model *m, int kind, int surface)
{
    EventFunction functions[MAX_EVENT_FUNCTIONS];
    const int n = stickslip_event_functions(m, m->y, 0.0, functions);
    for (int i = 0; i < n; i++)
        if ((int)functions[i].kind == kind && functions[i].surface == surface)
            return 1;
    return 0;
}

static int is_ahead(const Model *m)
{
    const Ahead *a = &m->ahead;
    const Dense *d = &a->dense;
    if (a->n_extremes < 0 || a->n_extremes > MAX_EXTREMES || !is_flag(a->active))
        return 0;
    if (!a->active)
        return 1;
    for (int i = 0; i < a->n_extremes; i++)
        if ((int)a->extremes[i].of < EXTREME_A || (int)a->extremes[i].of > EXTREME_CURRENT ||
            !isfinite(a->extremes[i].at) || !isfinite(a->extremes[i].value))
            return 0;
    return a->at >= 0.0 && a->end >= a->at && isfinite(a->end) && isfinite(a->acceleration) &&
           are_finite(a->last, (size_t)moving(m) * N_STATES) && d->length > 0.0 &&
           isfinite(d->length) && d->per_length == 1.0 / d->length && d->wall >= -1 && d->wall < moving(m) &&
           are_finite(&d->c[0][0], sizeof d->c / sizeof(double)) &&
           are_finite(d->clock, sizeof d->clock / sizeof(double)) &&
           (a->ends_with == -1 || is_due(m, a->ends_with, a->surface));
}

int stickslip_model_check(const Model *m, char *message)
{
    if (check_variables(m, message))
        return -1;
    if (!is_flag(m->initialised) || !is_flag(m->coupling_old) ||
        !is_flag(m->energies_old) || !is_flag(m->extremes_over))
        return say(message, "its flags are none");
    if (!m->initialised)
        return 0;
    if (stickslip_model_contradiction(m, message))
        return -1;
    if (!is_mode(m, &m->mode[0]) || !is_mode(m, &m->mode[1]))
        return say(message, "its modes do not go with its parameters");
    if (!are_finite(m->y, N_ALL) || !isfinite(m->energy_at_start) || !isfinite(m->a_q))
        return say(message, "its states are not finite numbers");
    const double lengths[] = {m->step[0], m->step[1], m->touch_step, m->steady_for};
    if (!are_finite(lengths, 4) || !(m->step[0] > 0.0 && m->step[1] > 0.0) ||
        m->touch_step < 0.0 || m->steady_for < 0.0)
        return say(message, "its steps are no lengths");
    return is_ahead(m) ? 0 : say(message, "its step under way is none");
}
