/* SPDX-License-Identifier: BSD-2-Clause */
/* The functions of ngspice's shared library, found when they are needed: the FMU has nothing of
 * ngspice in it. NGSPICE_LIBRARY_PATH names the library; else the usual names are tried. */
#ifndef NETLIST_SPICE_H
#define NETLIST_SPICE_H

#include <stdbool.h>

typedef struct {
    char *name;
    double real, imaginary;
    bool is_scale, is_complex;
} SentValue;

typedef struct {
    int count, index;
    SentValue **values;
} SentValues;

typedef struct {
    int number;
    char *name;
    bool is_real;
    void *vector, *scale;
} SentVector;

typedef struct {
    char *plot, *title, *date, *type;
    int count;
    SentVector **vectors;
} SentVectors;

typedef struct {
    char *name;
    int type;
    short flags;
    double *real;
    void *complex;
    int length;
} Vector;

typedef int OnText(char *text, int, void *);
typedef int OnExit(int status, bool unload, bool quit, int, void *);
typedef int OnData(SentValues *, int, int, void *);
typedef int OnVectors(SentVectors *, int, void *);
typedef int OnThread(bool ended, int, void *);
typedef int OnSource(double *value, double time, char *name, int, void *);
typedef int OnSync(double time, double *delta, double last_delta, int redo, int, int place, void *);

typedef struct {
    void *library;
    int (*init)(OnText *, OnText *, OnExit *, OnData *, OnVectors *, OnThread *, void *);
    int (*init_sync)(OnSource *, OnSource *, OnSync *, int *, void *);
    int (*circuit)(char **lines);
    int (*command)(char *);
    bool (*breakpoint)(double);
    Vector *(*vector)(char *);
} Spice;

/* 1, or 0 with a sentence in `why`. */
int spice_find(Spice *, char why[512]);
/* Unloads it, since it can be initialised once only, and who else loads it would do so again. */
void spice_leave(Spice *);

#endif
