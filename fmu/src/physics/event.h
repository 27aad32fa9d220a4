/* SPDX-License-Identifier: BSD-2-Clause */
/* An event: what changes a mode. */
#ifndef STICKSLIP_EVENT_H
#define STICKSLIP_EVENT_H

#include "state.h"

typedef enum {
    EVENT_WALL_ABOVE, /* the ram reaches the upper wall */
    EVENT_WALL_BELOW,
    EVENT_WALL_LEFT,    /* a touched wall is left */
    EVENT_WALL_PARTING, /* the compliant force vanishes or comes back within the wall */
    EVENT_SLIP_ENDS,
    EVENT_SLIP_DOWN, /* the part can no longer keep up: w becomes negative */
    EVENT_SLIP_UP,
    EVENT_PLATE_STOPS,
    EVENT_PLATE_DOWN, /* the part breaks away from the spring-loaded plate */
    EVENT_PLATE_UP,
    EVENT_COMMAND_HIGH, /* the source is asked for more than its current limit */
    EVENT_COMMAND_LOW,
    EVENT_COMMAND_BACK,
    EVENT_CURRENT_MET, /* the current meets its target again */
    EVENT_OUTPUT_HIGH, /* to follow its target would take more voltage than there is */
    EVENT_OUTPUT_LOW,
    N_EVENTS
} EventKind;

/* An event happens where its value falls through zero. */
typedef struct {
    EventKind kind;
    int surface; /* whose event it is */
    double value, rate; /* rate: d(value)/dt */
    double noise;       /* values above -noise are rounding, not an event */
} EventFunction;

enum { MAX_EVENT_FUNCTIONS = N_MOVING * 10 };

#endif
