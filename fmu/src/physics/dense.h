/* SPDX-License-Identifier: BSD-2-Clause */
/* One step of order 8 with an interpolant of order 7, after Dormand and Prince: Hairer, Norsett,
 * Wanner: Solving Ordinary Differential Equations I, 2nd edition, II.5 and II.6 (DOP853).
 *
 * The independent variable of a step is the time, or a clock that goes with it. The force of a
 * compliant wall grows with the power 3/2 of the penetration d, and what has such a root in it no
 * high order integrates well. With r = sqrt(d) in the place of q, and a variable s for which
 * dt/ds = r, all is smooth, from before the touch until after the wall is left:
 * dr/ds = (dd/dt) / 2, and the force is K r^3 (1 + lambda dd/dt). The time is a state then. */
#ifndef STICKSLIP_DENSE_H
#define STICKSLIP_DENSE_H

#include "internal.h"
#include "state.h"

STICKSLIP_INTERNAL_BEGIN

/* A point of the solution. */
typedef struct {
    double tau, y[N_ALL], dy[N_ALL]; /* s; the states and their rates in time */
    double root; /* of the wall's penetration, m^0.5, if the step is by the wall's clock */
} Knot;

enum { STAGES = 16 };
typedef struct {
    double k[STAGES][N_ALL], clock[STAGES];
} Stages;

/* Whose wall's clock a step from here should go by; a surface, or -1 for that of the time. */
int stickslip_clock_of(const Model *m, const double y[N_ALL]);
double stickslip_root_of(const Model *m, int surface, const double y[N_ALL]);

/* Step from one knot over h (s, or s/m^0.5 by a wall's clock) in the model's present mode. Returns
 * the local error over the model's tolerance, as stickslip_trial_step does. */
double stickslip_long_step(const Model *m, int wall, double h, const Knot *from, Knot *to,
                           Stages *stages);

/* The solution within that step, of which `stages` is what the step left. */
void stickslip_interpolant(const Model *m, int wall, double h, const Knot *from, const Knot *to,
                           Stages *stages, Dense *dense);

/* About what the interpolant is off within the step, over the tolerance: measured against steps to
 * its middle, this share of its last term is never less. The end of the step is free of it. */
double stickslip_reading_error(const Model *m, const Dense *dense);

/* The share of the step at a time (s) after its start. */
double stickslip_share_at(const Dense *dense, double time);

/* At a share of the step: all of a knot but its rates, of the states those that act; these states
 * alone, giving the wall's root if the step is by its clock; or the other states. */
void stickslip_interpolate(const Model *m, const Dense *dense, double share, Knot *knot);
double stickslip_interpolate_acting(const Model *m, const Dense *dense, double share,
                                    double y[N_ALL]);
void stickslip_interpolate_energies(const Model *m, const Dense *dense, double share,
                                    double y[N_ALL]);

/* Of one state's interpolant: the value and its derivatives in the share. */
enum { N_DERIVATIVES = 4 };
void stickslip_derivatives(const Dense *dense, int state, double share, double d[N_DERIVATIVES]);

/* Those of the time since the start of the step. */
void stickslip_clock_derivatives(const Dense *dense, double share, double d[N_DERIVATIVES]);

/* The factor by which the next long step may differ, for an error as stickslip_long_step has it. */
double stickslip_long_factor(double error);

STICKSLIP_INTERNAL_END

#endif
