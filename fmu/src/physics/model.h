/* The mechanics of a vibrating surface: ram, surface and part, with walls and set-valued friction.
 *
 * Free of FMI. SI units; up is positive. Only + - * / and sqrt are used, so that every IEEE-754
 * platform computes the same bits (build with -ffp-contract=off).
 *
 * Call order: model_defaults; model_set_* (parameters); model_initialise; then any number of
 * { model_set_* (inputs); model_step; model_outputs }. */
#ifndef STICKSLIP_MODEL_H
#define STICKSLIP_MODEL_H

#include "state.h"

typedef enum { KIND_PARAMETER, KIND_INPUT, KIND_OUTPUT } Kind;

typedef struct {
    const char *name, *unit, *text;
    Kind kind;
    double start, min, max;
} VariableInfo;

extern const VariableInfo REAL_INFO[N_REALS];
extern const VariableInfo INTEGER_INFO[N_INTEGERS];

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
