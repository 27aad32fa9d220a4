/* SPDX-License-Identifier: BSD-2-Clause */
/* One step of the Runge-Kutta pair of Dormand and Prince, 5(4).
 * Dormand, Prince: A family of embedded Runge-Kutta formulae, J. Comput. Appl. Math. 6 (1980). */
#ifndef STICKSLIP_INTEGRATOR_H
#define STICKSLIP_INTEGRATOR_H

#include <math.h>

#include "internal.h"
#include "state.h"

STICKSLIP_INTERNAL_BEGIN

/* Step from y0 (time tau, rates dy0) over h in the model's present mode, to y1 with rates dy1.
 * Returns the local error over the model's tolerance: accept up to 1. NaN or infinity where the
 * trial left the range of numbers. */
double stickslip_trial_step(const Model *m, double tau, double h, const double y0[N_ALL],
                            const double dy0[N_ALL], double y1[N_ALL], double dy1[N_ALL]);

/* The factor by which the next step may differ, for an error as trial_step returns it. */
double stickslip_step_factor(double error);

STICKSLIP_INTERNAL_END

/* The error that the tolerance allows in a state, by its place among those of a surface: relative to
 * |value| plus what counts as large for this machine, m, m/s, A; of currents, which drive all that
 * moves and change for short times alone, a small share of that. */
static inline double stickslip_allowed_error(const Model *m, int state, double value)
{
    static const double POSITION_SCALE = 1e-3, VELOCITY_SCALE = 0.1, CURRENT_SCALE = 0.1;
    static const double CURRENT_SHARE = 0.03;
    const double scale = state >= I_COIL                          ? CURRENT_SCALE
                         : state == V || state == U || state == W ? VELOCITY_SCALE
                                                                  : POSITION_SCALE;
    const double allowed = m->r.tolerance * (scale + fabs(value));
    return state >= I_COIL ? CURRENT_SHARE * allowed : allowed;
}

#endif
