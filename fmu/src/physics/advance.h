#ifndef STICKSLIP_ADVANCE_H
#define STICKSLIP_ADVANCE_H

#include "internal.h"
#include "state.h"

STICKSLIP_INTERNAL_BEGIN

/* Integrate the model over h with the inputs' ramps, from event to event. The inputs themselves are
 * left as they were. 0, or -1 with a sentence in message. */
int stickslip_advance(Model *m, double h, char *message);

STICKSLIP_INTERNAL_END

#endif
