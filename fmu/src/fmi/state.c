/* SPDX-License-Identifier: BSD-2-Clause */
/* FMU states: plain copies with a header that tells them from anything else. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "instance.h"
#include "references.h"

static const uint64_t MAGIC = 0x70696c736b636974; /* read backwards where the byte order differs */

static const char TOKEN[64] = TOKEN_TEXT;

typedef struct {
    uint64_t magic, size, checksum; /* the checksum is that of serialised bytes only */
    char token[sizeof TOKEN];
    State state;
} Snapshot;

/* FNV-1a */
static uint64_t checksum(const State *state)
{
    const unsigned char *bytes = (const unsigned char *)state;
    uint64_t sum = 0xcbf29ce484222325;
    for (size_t i = 0; i < sizeof *state; i++)
        sum = (sum ^ bytes[i]) * 0x100000001b3;
    return sum;
}

static int is_own(const Instance *inst, const char *function, const Snapshot *snapshot)
{
    if (snapshot && snapshot->magic == MAGIC && snapshot->size == sizeof *snapshot &&
        memcmp(snapshot->token, TOKEN, sizeof TOKEN) == 0)
        return 1;
    return stickslip_refuse(inst, function, "this is not a state of this build of the FMU");
}

/* Serialised bytes can come from anywhere, and a right checksum costs nothing. */
static int is_sound(const Instance *inst, const char *function, const State *s)
{
    char message[MODEL_MESSAGE_SIZE];
    const char *wrong = NULL;
    if (s->phase != INSTANTIATED && s->phase != INITIALISING && s->phase != STEPPING &&
        s->phase != TERMINATED)
        wrong = "its phase is none";
    else if (!isfinite(s->time) || isnan(s->stop_time))
        wrong = "its time is no number";
    else if ((s->has_stop_time | s->tolerance_set | s->outputs_stale) & ~1)
        wrong = "its flags are none";
    else if (stickslip_model_check(&s->model, message))
        wrong = message;
    else if (s->phase != INITIALISING &&
             s->model.initialised != (s->phase == STEPPING || s->phase == TERMINATED))
        wrong = "its phase is none";
    return !wrong || stickslip_refuse(inst, function, "this is not a state of the FMU: %s", wrong);
}

static Snapshot *room_for(const Instance *inst, const char *function, void **state)
{
    if (!state) {
        stickslip_refuse(inst, function, "a null pointer for the state");
        return NULL;
    }
    if (*state)
        return is_own(inst, function, *state) ? *state : NULL;
    Snapshot *snapshot = calloc(1, sizeof *snapshot);
    if (!snapshot)
        stickslip_refuse(inst, function, "out of memory");
    return snapshot;
}

int stickslip_get_state(Instance *inst, const char *function, void **state)
{
    if (!stickslip_allowed(inst, function, ANY_PHASE))
        return 0;
    Snapshot *snapshot = room_for(inst, function, state);
    if (!snapshot)
        return 0;
    snapshot->magic = MAGIC;
    snapshot->size = sizeof *snapshot;
    memcpy(snapshot->token, TOKEN, sizeof TOKEN);
    memcpy(&snapshot->state, &inst->state, sizeof inst->state);
    *state = snapshot;
    return 1;
}

int stickslip_set_state(Instance *inst, const char *function, void *state)
{
    if (!stickslip_allowed(inst, function, ANY_PHASE) || !is_own(inst, function, state))
        return 0;
    memcpy(&inst->state, &((Snapshot *)state)->state, sizeof inst->state);
    return 1;
}

int stickslip_free_state(Instance *inst, const char *function, void **state)
{
    if (!stickslip_allowed(inst, function, ANY_PHASE))
        return 0;
    if (!state || !*state)
        return 1;
    if (!is_own(inst, function, *state))
        return 0;
    free(*state);
    *state = NULL;
    return 1;
}

int stickslip_state_size(Instance *inst, const char *function, void *state, size_t *size)
{
    if (!stickslip_allowed(inst, function, ANY_PHASE) || !is_own(inst, function, state))
        return 0;
    if (!size)
        return stickslip_refuse(inst, function, "a null pointer for the size");
    *size = sizeof(Snapshot);
    return 1;
}

int stickslip_serialise(Instance *inst, const char *function, void *state, void *bytes, size_t size)
{
    if (!stickslip_allowed(inst, function, ANY_PHASE) || !is_own(inst, function, state))
        return 0;
    if (!bytes || size < sizeof(Snapshot))
        return stickslip_refuse(inst, function, "%zu bytes are needed", sizeof(Snapshot));
    Snapshot *snapshot = state;
    snapshot->checksum = checksum(&snapshot->state);
    memcpy(bytes, snapshot, sizeof *snapshot);
    return 1;
}

int stickslip_deserialise(Instance *inst, const char *function, const void *bytes, size_t size,
                          void **state)
{
    Snapshot read;
    if (!stickslip_allowed(inst, function, ANY_PHASE))
        return 0;
    if (!bytes || size != sizeof read)
        return stickslip_refuse(inst, function, "%zu bytes are not a state of this FMU", size);
    memcpy(&read, bytes, sizeof read);
    if (!is_own(inst, function, &read))
        return 0;
    if (read.checksum != checksum(&read.state))
        return stickslip_refuse(inst, function, "the serialised state is damaged");
    if (!is_sound(inst, function, &read.state))
        return 0;
    Snapshot *snapshot = room_for(inst, function, state);
    if (!snapshot)
        return 0;
    memcpy(snapshot, &read, sizeof read);
    *state = snapshot;
    return 1;
}
