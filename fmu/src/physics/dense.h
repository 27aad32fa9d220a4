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

/* The share of a step by a wall's clock at a time (s) after its start. */
double stickslip_share_by_clock(const Dense *dense, double time);

/* At a share of the step: all of a knot but its rates and energies; or the states that act alone,
 * giving the wall's root if the step is by its clock. */
void stickslip_interpolate(const Model *m, const Dense *dense, double share, Knot *knot);
double stickslip_interpolate_acting(const Model *m, const Dense *dense, double share,
                                    double y[N_ALL]);

/* The factor by which the next long step may differ, for an error as stickslip_long_step has it. */
double stickslip_long_factor(double error);

STICKSLIP_INTERNAL_END

/* The share of any step at a time (s) after its start. */
static inline double stickslip_share_at(const Dense *dense, double time)
{
    return dense->wall < 0 ? time * dense->per_length : stickslip_share_by_clock(dense, time);
}

/* Of an interpolant whose coefficients lie `stride` apart, of a state or the clock: the value and its
 * first two derivatives in the share x of the step. Its terms are 1, x, x r, x^2 r, x^2 r^2 ... with
 * r = 1 - x. In a header, since the compiler can work out those of a constant share. */
enum { N_DERIVATIVES = 3 };
STICKSLIP_INLINE void stickslip_derivatives(const double *c, size_t stride, const double x,
                                            double d[N_DERIVATIVES])
{
    const double r = 1.0 - x, b = x * r, b2 = b * b, x2 = x * x, turn = r - x;
    const double c1 = c[stride], c2 = c[2 * stride], c3 = c[3 * stride], c4 = c[4 * stride],
                 c5 = c[5 * stride], c6 = c[6 * stride], c7 = c[7 * stride];
    d[0] = ((c[0] + c1 * x) + (c2 * b + c3 * (b * x))) +
           ((c4 * b2 + c5 * (b2 * x)) + (c6 * (b2 * b) + c7 * (b2 * b * x)));
    d[1] = ((c1 + c2 * turn) + (c3 * (x * (2.0 - 3.0 * x)) + c4 * (2.0 * b * turn))) +
           (c5 * (x * b * (3.0 - 5.0 * x)) +
            (c6 * (3.0 * b2 * turn) + c7 * (x * b2 * (4.0 - 7.0 * x))));
    d[2] = ((-2.0 * c2 + c3 * (2.0 - 6.0 * x)) + c4 * (2.0 - 12.0 * b)) +
           ((c5 * (x * (6.0 + x * (20.0 * x - 24.0))) + c6 * (6.0 * b * (1.0 - 5.0 * b))) +
            c7 * (6.0 * x2 * (2.0 + x * (x * (15.0 - 7.0 * x) - 10.0))));
}

#endif
