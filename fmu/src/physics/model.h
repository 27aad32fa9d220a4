/* SPDX-License-Identifier: BSD-2-Clause */
/* The mechanics of a vibrating surface: ram, surface and part, with walls and set-valued friction.
 *
 * Free of FMI. SI units; up is positive. Only + - * / and sqrt are used, so that every IEEE-754
 * platform computes the same bits (build with -ffp-contract=off).
 *
 * Call order: stickslip_model_defaults; ..._set_* (parameters); ..._initialise; then any number of
 * { ..._set_* (inputs, tunable parameters); ..._step; ..._outputs }. */
#ifndef STICKSLIP_MODEL_H
#define STICKSLIP_MODEL_H

#include "internal.h"
#include "state.h"

STICKSLIP_INTERNAL_BEGIN

typedef enum { KIND_PARAMETER, KIND_TUNABLE, KIND_INPUT, KIND_OUTPUT } Kind;

typedef struct {
    const char *name, *unit, *text;
    Kind kind;
    double start, min, max;
} VariableInfo;

extern const VariableInfo stickslip_real_info[N_REALS];
extern const VariableInfo stickslip_integer_info[N_INTEGERS];

void stickslip_model_defaults(Model *m);

/* Set one variable by its place, or only see whether it can be. 0, or -1 with a sentence in message: unknown place, an output, a
 * fixed parameter after initialisation, not finite, out of range. */
int stickslip_model_set_real(Model *m, size_t place, double value, char *message);
int stickslip_model_check_real(const Model *m, size_t place, double value, char *message);
/* Set what can be. */
void stickslip_model_put_real(Model *m, size_t place, double value);
int stickslip_model_set_integer(Model *m, size_t place, int value, char *message);

/* Parameters that each are in range, but not together. 0, or -1 with a sentence in message. */
int stickslip_model_contradiction(const Model *m, char *message);

/* Could a model whose bytes come from elsewhere have been left by the functions below? 0, or -1 with
 * what is wrong in message. */
int stickslip_model_check(const Model *m, char *message);

/* Static equilibrium without current: the ram on its suspension, the surface on its flexures
 * carrying all three bodies (a fixed ram apart), the part sticking. 0, or -1 with a sentence in message. */
int stickslip_model_initialise(Model *m, char *message);

/* Advance by h > 0 seconds. The inputs run on with their slopes. 0, or -1 with a sentence in
 * message; the state is then to be discarded. */
int stickslip_model_step(Model *m, double h, char *message);

/* The same where an internal step under way reaches beyond h: the outputs are then those of its
 * interpolant, fresh. 0 if none does; then nothing has changed. */
int stickslip_model_step_within(Model *m, double h);

/* Refresh the outputs from state and inputs, after a step or a change of an input. */
void stickslip_model_outputs(Model *m);

/* The last outputs are refreshed by themselves, since few look at them: those that a circuit's
 * solver asks for, and those called energy_... m->coupling_old and m->energies_old tell that they
 * have not been since the last of the above. */
enum {
    FIRST_COUPLING = offsetof(Reals, back_emf_slope) / sizeof(double),
    FIRST_ENERGY = offsetof(Reals, energy_in) / sizeof(double)
};
void stickslip_model_coupling(Model *m);
void stickslip_model_energies(Model *m);

/* d(output)/d(current, current_2, normal_force or surface_acceleration) in the present mode,
 * analytically exact: forces are affine in all four, or piece by piece; and d(coil_voltage)/d(command_slope), of either source. 0 for every other pair. */
double stickslip_model_derivative(const Model *m, size_t output, size_t input);

STICKSLIP_INTERNAL_END

#endif
