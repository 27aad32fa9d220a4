/* SPDX-License-Identifier: BSD-2-Clause */
/* What fmi2.c and fmi3.c share. Functions that return int give 1, or 0 after a message. */
#ifndef THIN_INSTANCE_H
#define THIN_INSTANCE_H

#include <stdint.h>

#include "model.h"

typedef struct Instance Instance;
typedef void AnyFunction(void);
typedef void Sender(const Instance *, const char *message);

struct Instance {
    const Model *model;
    Run run;
    char *resources;
    int started, stale; /* whether `start` was called, and inputs have changed since the outputs */
    Sender *send;
    AnyFunction *log; /* the importer's logger, which the sender knows */
    void *environment;
    char *name;
};

/* `resources` may be an address (file:) or a path. NULL after a message. */
Instance *thin_new(const char *name, const char *token, const char *resources, Sender *send,
                   AnyFunction *log, void *environment);
void thin_free(Instance *);
int thin_reset(Instance *);
int thin_start(Instance *);
int thin_step(Instance *, double time, double h);
int thin_set(Instance *, const uint32_t *places, size_t n, const double *values);
int thin_get(Instance *, const uint32_t *places, size_t n, double *values);
int thin_refuse(Instance *, const char *format, ...);
int thin_save(Instance *, void **state);
int thin_restore(Instance *, const void *state);

#endif
