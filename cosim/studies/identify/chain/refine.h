/* How far the chain is from measured trials, and a trial's own numbers fitted on a given rig. */

#ifndef CHAIN_REFINE_H
#define CHAIN_REFINE_H

#include "../../../stepper/stepper.h"

#include <stdatomic.h>

typedef struct {
    Schedule schedule;
    int64_t samples;
    const double *measured[N_OUTPUTS]; /* NaN where nothing is known; NULL: was not measured */
    double weight[N_OUTPUTS];          /* of a squared residual: 1/(m²) or 1/(m/s)² */
    int64_t differenced[N_OUTPUTS];    /* 1: a velocity made of the two heights about a sample */
    const double *rate;                /* samples; 1/s, one over the time between those two */
    double low[N_OWN], high[N_OWN];    /* bounds of the trial's own numbers */
    double scale[N_OWN];               /* their units for the fit; 0: not fitted */
} Trial;

/* One fit, or one look at LANES sets of own numbers. */
typedef struct {
    const Trial *trial;
    const double *rig; /* N_RIG */
    double *own;       /* N_OWN, replaced by what was found; with 0 rounds LANES times N_OWN, of
                          which the phases are replaced by better ones */
    double *cost;      /* 1, or LANES */
    int64_t rounds;    /* of Gauss-Newton */
} Job;

/* Do jobs until there are none; any number of threads may be in here with the same `next`. 0, or -1
 * where there is no memory. */
EXPORT int64_t chain_work(const Job *jobs, int64_t n, atomic_llong *next);

/* Outputs of LANES sets, as chain_run() has them, and residuals, signal after signal, for each lane:
 * residuals[(k * samples + j) * LANES + l], scaled so that their squares add up to the cost. */
EXPORT int64_t chain_look(const Trial *trial, const Parameters parameters, double *out,
                          double *residuals);

EXPORT int64_t chain_sizes(int64_t which); /* bytes of Trial, of Job */

#endif
