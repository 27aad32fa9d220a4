/* SPDX-License-Identifier: BSD-2-Clause */
/* Finding events and applying them. */
#ifndef STICKSLIP_EVENTS_H
#define STICKSLIP_EVENTS_H

#include "event.h"
#include "internal.h"

STICKSLIP_INTERNAL_BEGIN

/* The event functions of the present mode at state y. Returns their number; the order is the same
 * for the same mode. */
int stickslip_event_functions(const Model *m, const double y[N_ALL], double tau,
                              EventFunction functions[MAX_EVENT_FUNCTIONS]);

/* Apply one event of surface s to state and mode, then settle. */
void stickslip_apply_event(Model *m, int s, double tau, EventKind kind);

/* Make the mode agree with state and inputs: after a jump of either, several conditions can be
 * violated at once (impact and slip, release and stick, ...). */
void stickslip_settle_mode(Model *m, double tau);

STICKSLIP_INTERNAL_END

#endif
