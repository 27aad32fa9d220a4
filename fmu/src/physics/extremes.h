/* SPDX-License-Identifier: BSD-2-Clause */
/* Largest and smallest values of the first surface's motion, and of its coil's current. */
#ifndef STICKSLIP_EXTREMES_H
#define STICKSLIP_EXTREMES_H

#include "dense.h"

STICKSLIP_INTERNAL_BEGIN

/* Begin with a point; take another one in. With the acceleration there. */
void stickslip_begin_extremes(Model *m, const double y[N_ALL], double acceleration);
void stickslip_note_extremes(Model *m, const double y[N_ALL], double acceleration);

/* Could an extreme lie between the ends of a long step, by a wall's clock or (-1) the time? Its
 * stages tell. */
int stickslip_may_have_extreme(const Model *m, int wall, const Knot *from, const Stages *stages);

/* What lies between the ends of the long step that m->ahead holds, from time tau on. */
void stickslip_find_extremes(Model *m, double tau);

/* Take in the acceleration's extreme between the ends of a short step over h (s): that of the parabola
 * with the acceleration at both, under which the velocity changes as it did. */
void stickslip_note_short_extreme(Model *m, const Knot *from, const Knot *to, double h);

/* Take in what of that lies between two times after the step's start, s. */
void stickslip_note_inner_extremes(Model *m, double from, double to);

STICKSLIP_INTERNAL_END

#endif
