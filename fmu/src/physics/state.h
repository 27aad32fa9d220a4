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
#define INPUT(name, unit, start, min, max, text) double name;
#define OUTPUT(name, unit, text) double name;
#define INT_PARAMETER(name, start, min, max, text)
#define INT_OUTPUT(name, text)
#include "variables.def"
#undef PARAMETER
#undef INPUT
#undef OUTPUT
#undef INT_PARAMETER
#undef INT_OUTPUT
} Reals;

typedef struct {
#define PARAMETER(name, unit, start, min, max, text)
#define INPUT(name, unit, start, min, max, text)
#define OUTPUT(name, unit, text)
#define INT_PARAMETER(name, start, min, max, text) int name;
#define INT_OUTPUT(name, text) int name;
#include "variables.def"
#undef PARAMETER
#undef INPUT
#undef OUTPUT
#undef INT_PARAMETER
#undef INT_OUTPUT
} Integers;

enum { N_REALS = sizeof(Reals) / sizeof(double), N_INTEGERS = sizeof(Integers) / sizeof(int) };

/* Places in the state vector. The slip d = z_part - z_surface and its rate w are states of their
 * own: while the part sticks they do not change by a single bit. */
enum {
    Z, V, Q, U, D, W, E_IN, E_FRICTION, E_IMPACT, E_DAMPING,
    I_COIL, I_EDDY, E_OUTPUT, E_COPPER, /* of the source, at rest without one */
    N_STATES
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
    int plate; /* 0 part held by the springed plate; else the sign of the part's velocity */
    int output;  /* of the source: 0 the current follows its target; else the limit of that sign
                    holds the output, and the current is on its way to the target */
    int limited; /* 0 the target is the command; else the current limit of that sign */
} Mode;

typedef struct {
    Reals r;
    Integers n;
    Mode mode[N_MOVING];
    double y[N_ALL];
    double step;           /* the next internal step that the error control would take, s */
    double energy_at_start;
    int initialised;
} Model;

/* How many surfaces are solved for: 1, which stands for all that move alike, or 2. */
static inline int moving(const Model *m)
{
    return m->n.independent ? 2 : 1;
}

#endif
