/* SPDX-License-Identifier: BSD-2-Clause */
/* Variables by value reference, and derivatives of outputs. */
#include <math.h>
#include <string.h>

#include "instance.h"
#include "references.h"

#define PLACE(name) (offsetof(Reals, name) / sizeof(double))

static int arrays_given(const Instance *inst, const char *function, size_t n, const void *a,
                        const void *b)
{
    if (n == 0 || (a && b))
        return 1;
    return stickslip_refuse(inst, function, "a null pointer for %zu variables", n);
}

/* What may still be set in the initialization mode acts on the state it starts from. */
static void about_to_set(State *s)
{
    if (s->phase == INITIALISING)
        s->model.initialised = 0;
    s->model.extremes_over = 1;
    s->outputs_stale = 1;
}

static int are_fresh(const Instance *inst)
{
    const State *s = &inst->state;
    return !s->outputs_stale && s->model.initialised && s->phase != INSTANTIATED;
}

/* From the first one on, so many reals are simply there. */
static size_t reals_there(const Instance *inst)
{
    const Model *m = &inst->state.model;
    if (!are_fresh(inst))
        return 0;
    return m->coupling_old ? FIRST_COUPLING : m->energies_old ? FIRST_ENERGY : N_REALS;
}

static int outputs_fresh(Instance *inst, const char *function)
{
    State *s = &inst->state;
    if (s->phase == INSTANTIATED)
        return stickslip_refuse(inst, function, "outputs have no value before initialisation");
    if (!s->model.initialised) {
        char message[MODEL_MESSAGE_SIZE];
        Model start = s->model;
        if (stickslip_model_initialise(&start, message))
            return stickslip_refuse(inst, function, "%s", message);
        s->model = start;
    } else if (s->outputs_stale) {
        stickslip_model_outputs(&s->model);
    }
    s->outputs_stale = 0;
    return 1;
}

/* One that is not simply there. */
static int get_special(Instance *inst, const char *function, uint32_t vr, double *value)
{
    Model *model = &inst->state.model;
    const size_t place = (size_t)vr - REFERENCE_REALS;
    if (vr == REFERENCE_TIME) {
        *value = inst->state.time;
        return 1;
    }
    if (place >= N_REALS) {
        /* Some importers ask for all outputs as reals. */
        int whole;
        if ((size_t)vr - REFERENCE_INTEGERS >= N_INTEGERS)
            return stickslip_refuse(inst, function, "no real variable has the value reference %u",
                                    (unsigned)vr);
        if (!stickslip_get_integers(inst, function, &vr, 1, &whole))
            return 0;
        *value = whole;
        return 1;
    }
    if (stickslip_real_info[place].kind == KIND_OUTPUT && !outputs_fresh(inst, function))
        return 0;
    if (place >= FIRST_ENERGY && model->energies_old)
        stickslip_model_energies(model);
    else if (place >= FIRST_COUPLING && place < FIRST_ENERGY && model->coupling_old)
        stickslip_model_coupling(model);
    memcpy(value, (const char *)&model->r + place * sizeof(double), sizeof *value);
    return 1;
}

int stickslip_get_reals(Instance *inst, const char *function, const uint32_t vr[], size_t n,
                        double values[])
{
    if (!stickslip_allowed(inst, function, INITIALISING | STEPPING | INSTANTIATED | TERMINATED) ||
        !arrays_given(inst, function, n, vr, values))
        return 0;
    const double *reals = (const double *)&inst->state.model.r;
    size_t there = reals_there(inst);
    for (size_t i = 0; i < n; i++) {
        const size_t place = (size_t)vr[i] - REFERENCE_REALS;
        if (place < there) {
            values[i] = reals[place];
            continue;
        }
        if (!get_special(inst, function, vr[i], &values[i]))
            return 0;
        there = reals_there(inst);
    }
    return 1;
}

int stickslip_get_integers(Instance *inst, const char *function, const uint32_t vr[], size_t n,
                           int values[])
{
    if (!stickslip_allowed(inst, function, ANY_PHASE) ||
        !arrays_given(inst, function, n, vr, values))
        return 0;
    const int *integers = (const int *)&inst->state.model.n;
    int fresh = are_fresh(inst);
    for (size_t i = 0; i < n; i++) {
        const size_t place = (size_t)vr[i] - REFERENCE_INTEGERS;
        if (place >= N_INTEGERS)
            return stickslip_refuse(
                inst, function, "no integer variable has the value reference %u", (unsigned)vr[i]);
        if (!fresh && stickslip_integer_info[place].kind == KIND_OUTPUT) {
            if (!outputs_fresh(inst, function))
                return 0;
            fresh = 1;
        }
        values[i] = integers[place];
    }
    return 1;
}

/* Several values are set all or none. */
static int undo(Instance *inst, const char *function, const State *before, const char *message)
{
    inst->state = *before;
    return stickslip_refuse(inst, function, "%s", message);
}

int stickslip_set_reals(Instance *inst, const char *function, const uint32_t vr[], size_t n,
                        const double values[])
{
    char message[MODEL_MESSAGE_SIZE];
    if (!stickslip_allowed(inst, function, INSTANTIATED | INITIALISING | STEPPING) ||
        !arrays_given(inst, function, n, vr, values))
        return 0;
    if (n == 0)
        return 1;
    State *s = &inst->state;
    const int initialised = s->model.initialised, stale = s->outputs_stale;
    const int over = s->model.extremes_over;
    about_to_set(s);
    for (size_t i = 0; i < n; i++) {
        const char *why = NULL;
        if (vr[i] == REFERENCE_TIME)
            why = "time cannot be set";
        else if (stickslip_model_check_real(&s->model, (size_t)vr[i] - REFERENCE_REALS, values[i],
                                            message))
            why = message;
        if (!why)
            continue;
        s->model.initialised = initialised;
        s->outputs_stale = stale;
        s->model.extremes_over = over;
        return stickslip_refuse(inst, function, "%s", why);
    }
    for (size_t i = 0; i < n; i++) {
        const size_t place = (size_t)vr[i] - REFERENCE_REALS;
        stickslip_model_put_real(&s->model, place, values[i]);
        if (place == PLACE(tolerance))
            s->tolerance_set = 1;
    }
    return 1;
}

int stickslip_set_integers(Instance *inst, const char *function, const uint32_t vr[], size_t n,
                           const int values[])
{
    char message[MODEL_MESSAGE_SIZE];
    if (!stickslip_allowed(inst, function, INSTANTIATED | INITIALISING | STEPPING) ||
        !arrays_given(inst, function, n, vr, values))
        return 0;
    const State before = inst->state;
    about_to_set(&inst->state);
    for (size_t i = 0; i < n; i++)
        if (stickslip_model_set_integer(&inst->state.model, (size_t)vr[i] - REFERENCE_INTEGERS,
                                        values[i], message))
            return undo(inst, function, &before, message);
    return 1;
}

int stickslip_set_slopes(Instance *inst, const char *function, const uint32_t vr[], size_t n,
                         const int orders[], const double values[])
{
    char message[MODEL_MESSAGE_SIZE];
    if (!stickslip_allowed(inst, function, INSTANTIATED | INITIALISING | STEPPING) ||
        !arrays_given(inst, function, n, vr, values) ||
        !arrays_given(inst, function, n, vr, orders))
        return 0;
    const State before = inst->state;
    about_to_set(&inst->state);
    for (size_t i = 0; i < n; i++) {
        const size_t place = (size_t)vr[i] - REFERENCE_REALS;
        size_t slope;
        if (orders[i] != 1)
            return undo(inst, function, &before, "only first derivatives of inputs are taken");
        if (place == PLACE(current))
            slope = PLACE(current_slope);
        else if (place == PLACE(normal_force))
            slope = PLACE(normal_force_slope);
        else if (place == PLACE(command))
            slope = PLACE(command_slope);
        else if (place == PLACE(current_2))
            slope = PLACE(current_2_slope);
        else if (place == PLACE(command_2))
            slope = PLACE(command_2_slope);
        else
            return undo(inst, function, &before,
                        "only currents, commands and normal_force can be given with a derivative");
        if (stickslip_model_set_real(&inst->state.model, slope, values[i], message))
            return undo(inst, function, &before, message);
    }
    return 1;
}

static int known_kind(const Instance *inst, const char *function, uint32_t vr, Kind kind)
{
    const size_t place = (size_t)vr - REFERENCE_REALS;
    if (place < N_REALS && stickslip_real_info[place].kind == kind)
        return 1;
    return stickslip_refuse(inst, function, "the value reference %u is not a real %s", (unsigned)vr,
                            kind == KIND_OUTPUT ? "output" : "input");
}

int stickslip_derivative(Instance *inst, const char *function, const uint32_t unknowns[],
                         size_t n_unknowns, const uint32_t knowns[], size_t n_knowns,
                         const double seed[], double sensitivity[])
{
    if (!stickslip_allowed(inst, function, INITIALISING | STEPPING) ||
        !arrays_given(inst, function, n_unknowns, unknowns, sensitivity) ||
        !arrays_given(inst, function, n_knowns, knowns, seed))
        return 0;
    for (size_t i = 0; i < n_unknowns; i++)
        if (!known_kind(inst, function, unknowns[i], KIND_OUTPUT))
            return 0;
    for (size_t j = 0; j < n_knowns; j++) {
        if (!known_kind(inst, function, knowns[j], KIND_INPUT))
            return 0;
        if (!isfinite(seed[j]))
            return stickslip_refuse(inst, function, "the seed must be finite");
    }
    if (!outputs_fresh(inst, function))
        return 0;
    for (size_t i = 0; i < n_unknowns; i++) {
        sensitivity[i] = 0.0;
        for (size_t j = 0; j < n_knowns; j++)
            sensitivity[i] += seed[j] * stickslip_model_derivative(&inst->state.model,
                                                                   unknowns[i] - REFERENCE_REALS,
                                                                   knowns[j] - REFERENCE_REALS);
    }
    return 1;
}
