/* SPDX-License-Identifier: BSD-2-Clause */
#ifndef STICKSLIP_ADVANCE_H
#define STICKSLIP_ADVANCE_H

#include "internal.h"
#include "state.h"

STICKSLIP_INTERNAL_BEGIN

/* Integrate the model over h with the inputs' ramps, from event to event. While the inputs hold beyond
 * that, so may the last step (m->ahead). The inputs themselves are left as they were. 0, or -1 with a
 * sentence in message. */
int stickslip_advance(Model *m, double h, char *message);

/* Advance by h where a step under way reaches beyond that: its interpolant has the states. 0 if none
 * does; then nothing has changed. */
int stickslip_advance_within(Model *m, double h);

/* To be called once the outputs are those of the point that was reached within a step under way. */
void stickslip_reached(Model *m);

/* The states there with the energies, which nothing but the outputs looks at. The inputs must have been
 * moved there. */
void stickslip_energies_now(const Model *m, double y[N_ALL]);

/* Stay at that point, and give up what the step under way has beyond it. */
void stickslip_turn_back(Model *m);

STICKSLIP_INTERNAL_END

#endif
