#ifndef STICKSLIP_ADVANCE_H
#define STICKSLIP_ADVANCE_H

#include "state.h"

/* Integrate the model over h with the inputs' ramps, from event to event. The inputs themselves are
 * left as they were. 0, or -1 with a sentence in message. */
int advance(Model *m, double h, char *message);

#endif
