/* SPDX-License-Identifier: BSD-2-Clause */
/* What the model consists of: its variables, its modes and its states, all in one plain structure
 * without pointers, so that a copy of it is the whole state. SI units; up is positive. */
#ifndef STICKSLIP_STATE_H
#define STICKSLIP_STATE_H

#include <stddef.h>

/* Room for a sentence that tells why something was refused. */
#define MODEL_MESSAGE_SIZE 256

/* The variables, by their names in variables.def. */
typedef struct {
#define PARAMETER(name, unit, start, min, max, text) double name;
#define TUNABLE(name, unit, start, min, max, text) double name;
#define INPUT(name, unit, start, min, max, text) double name;
#define OUTPUT(name, unit, text) double name;
#define INT_PARAMETER(name, start, min, max, text)
#define INT_OUTPUT(name, text)
#include "variables.def"
#undef PARAMETER
#undef TUNABLE
#undef INPUT
#undef OUTPUT
#undef INT_PARAMETER
#undef INT_OUTPUT
} Reals;

typedef struct {
#define PARAMETER(name, unit, start, min, max, text)
#define TUNABLE(name, unit, start, min, max, text)
#define INPUT(name, unit, start, min, max, text)
#define OUTPUT(name, unit, text)
#define INT_PARAMETER(name, start, min, max, text) int name;
#define INT_OUTPUT(name, text) int name;
#include "variables.def"
#undef PARAMETER
#undef TUNABLE
#undef INPUT
#undef OUTPUT
#undef INT_PARAMETER
#undef INT_OUTPUT
} Integers;

enum { N_REALS = sizeof(Reals) / sizeof(double), N_INTEGERS = sizeof(Integers) / sizeof(int) };

/* Places in the state vector. The slip d = z_part - z_surface and its rate w are states of their
 * own: while the part sticks they do not change by a single bit. */
enum {
    Z, V, Q, U, D, W,
    I_COIL, I_EDDY, /* of the source, at rest without one */
    E_IN, E_FRICTION, E_IMPACT, E_DAMPING,
    E_OUTPUT, E_COPPER, /* of the source */
    N_STATES,
    N_ACTING = E_IN /* what the rates depend on; the energies only follow */
};

/* Surfaces that can move by themselves. Their states lie one after the other, N_STATES each. */
enum { N_MOVING = 2, N_ALL = N_MOVING * N_STATES };

typedef enum {
    WALL_FREE,
    WALL_TOUCH,   /* compliant contact, the force acts */
    WALL_PARTING, /* compliant contact, penetrated, but the force has vanished (1 + lambda rate < 0) */
    WALL_REST     /* rigid contact at rest: q is held, the wall's force is a reaction */
} WallMode;

typedef struct {
    WallMode wall;
    int side;  /* of a touched wall: +1 above, -1 below */
    int slip;  /* 0 sticking; else the sign of w */
    int plate; /* 0 part held by the spring-loaded plate; else the sign of the part's velocity */
    int output;  /* of the source: 0 the current follows its target; else the limit of that sign
                    holds the output, and the current is on its way to the target */
    int limited; /* 0 the target is the command; else the current limit of that sign */
} Mode;

/* The solution within one long step (see dense.h): a polynomial of each state that acts in the share of
 * the step that has gone by. */
typedef struct {
    double length, per_length; /* of the step, s or s/m^0.5, and its inverse */
    int wall;      /* the surface whose wall's clock it goes by; -1: the time */
    double c[8][N_ALL], clock[8];
} Dense;

/* An extreme of the first surface, or of its coil's current, between the ends of a long step. */
typedef enum { EXTREME_A, EXTREME_V, EXTREME_Z, EXTREME_CURRENT } ExtremeOf;
typedef struct {
    ExtremeOf of;
    double at, value; /* time since the start of the step, s */
} Extreme;
enum { MAX_EXTREMES = 16 };

/* A long step that goes on beyond the last communication point, since the inputs do. The mode, and y
 * but for the energies, are those at that point; the energies are those at the step's start. What ends
 * the step is still to come. */
typedef struct {
    int active;
    int ends_with;  /* the kind of the event that the step ends with; -1: none */
    int surface;    /* whose event that is */
    int n_extremes;
    double at, end;      /* of the communication point and of the step's end, since its start, s */
    double acceleration; /* of the first surface now, m/s2 */
    Extreme extremes[MAX_EXTREMES];
    double last[N_ALL]; /* states at the end */
    Dense dense;
} Ahead;

typedef struct {
    Reals r;
    Integers n;
    Mode mode[N_MOVING];
    double y[N_ALL];
    /* The next step of order 5 that the error control would take, s: where no compliant wall is
     * touched, and where one is. */
    double step[2];
    double touch_step; /* the next long step by a wall's clock, s/m^0.5; 0: unknown */
    double steady_for; /* time since an input was changed, s */
    double energy_at_start;
    double a_q; /* d2 q/dt2 of the first surface, as old as the outputs, m/s2 */
    int initialised;
    int coupling_old, energies_old; /* outputs: see model.h */
    int extremes_over; /* the next step begins them anew */
    Ahead ahead; /* the last: what is before it makes a state by itself */
} Model;

/* One more; beyond the largest number from the smallest on, as days of stepping may come to. */
static inline void stickslip_count(int *counter)
{
    *counter = (int)((unsigned)*counter + 1u);
}

/* How many surfaces are solved for: 1, which stands for all that move alike, or 2. */
static inline int moving(const Model *m)
{
    return m->n.independent ? 2 : 1;
}

#endif
