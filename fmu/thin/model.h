/* SPDX-License-Identifier: BSD-2-Clause */
/* What a model says and does: all that one writes for an FMU of one's own. `fmi2.c` and `fmi3.c`
 * make a co-simulation FMU of it, `describe.c` its modelDescription.xml; ../models has examples.
 *
 * A model has numbers, its variables. Their value references are their places in the table, from 1
 * on; 0 is the time. In FMI 2.0 they are Real, in FMI 3.0 Float64. */
#ifndef THIN_MODEL_H
#define THIN_MODEL_H

#include <stddef.h>

typedef enum { PARAMETER, INPUT, OUTPUT } Kind;

typedef struct {
    Kind kind;
    const char *name, *unit;
    double start; /* of parameters and inputs */
    const char *about;
    int slope; /* the value reference of its time derivative: of an input, another input with which
                  it goes on; of an output, another output; 0: there is none */
} Variable;

/* One instance while it runs. */
typedef struct {
    double *v;             /* values, by value reference; inputs are those at the step's start */
    void *state;           /* `state` bytes of the model, zero at first */
    double time;           /* at which the step begins */
    double stop;           /* the experiment's end, or infinity */
    const char *resources; /* the FMU's folder of that name */
    char why[512];         /* what to tell the importer where a function fails */
} Run;

typedef struct {
    const char *name;  /* and that of the library */
    const char *about; /* a sentence */
    const char *token; /* changes when the model does */
    const Variable *variables;
    int count;
    size_t state; /* bytes, without pointers: a copy of them and of the values is the whole state */
    int alone;    /* one instance a process, whose state cannot be copied */
    double step;  /* s; one that suits it */
    /* They return 1, or 0 with a sentence in `why`; those that a model does not need are NULL. */
    int (*start)(Run *);          /* at time 0, all parameters set: state and outputs */
    int (*step_by)(Run *, double); /* moves on by so many seconds: state and outputs */
    void (*outputs)(Run *);       /* after inputs have changed: those that depend on them at once */
    void (*end)(Run *);           /* after a start, also one that has failed */
    void (*close)(void);          /* when the instance is freed */
} Model;

/* The model, for an instance of it; or NULL with a sentence in `why`, as of a model that is read
 * from the FMU's `resources`. */
const Model *model(const char *resources, char why[512]);

#endif
