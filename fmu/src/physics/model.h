/* The mechanics of a vibrating surface: ram, surface and part, with walls and set-valued friction.
 *
 * Free of FMI. Everything that changes is in one plain structure without pointers, so a copy of it
 * is the whole state. SI units; up is positive. Only + - * / and sqrt are used, so that every
 * IEEE-754 platform computes the same bits (build with -ffp-contract=off).
 *
 * Call order: model_defaults; model_set_* (parameters); model_initialise; then any number of
 * { model_set_* (inputs); model_step; model_outputs }. */
#ifndef STICKSLIP_MODEL_H
#define STICKSLIP_MODEL_H

#include <stddef.h>

#define MODEL_MESSAGE_SIZE 256

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

typedef enum { KIND_PARAMETER, KIND_INPUT, KIND_OUTPUT } Kind;

typedef struct {
    const char *name, *unit, *text;
    Kind kind;
    double start, min, max;
} VariableInfo;

extern const VariableInfo REAL_INFO[N_REALS];
extern const VariableInfo INTEGER_INFO[N_INTEGERS];

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

void model_defaults(Model *m);

/* Set one variable by its place. 0, or -1 with a sentence in message: unknown place, an output, a
 * parameter after initialisation, not finite, out of range. */
int model_set_real(Model *m, size_t place, double value, char *message);
int model_set_integer(Model *m, size_t place, int value, char *message);

/* Static equilibrium without current: the ram on its suspension, the surface on its flexures
 * carrying all three bodies (a fixed ram apart), the part sticking. 0, or -1 with a sentence in message. */
int model_initialise(Model *m, char *message);

/* Advance by h > 0 seconds. The inputs run on with their slopes. 0, or -1 with a sentence in
 * message; the state is then to be discarded. */
int model_step(Model *m, double h, char *message);

/* Refresh the outputs from state and inputs, after a step or a change of an input. */
void model_outputs(Model *m);

/* d(output)/d(current, current_2, normal_force or surface_acceleration) in the present mode,
 * analytically exact: forces are affine in all four; and d(coil_voltage)/d(command_slope), of either source. 0 for every other pair. */
double model_derivative(const Model *m, size_t output, size_t input);

#endif
