/* The whole chain, current source, coil, ram, surface, part and spring-loaded plate, stepped through
 * time for LANES sets of parameters at once: what the search of an identification runs on, and scenes with
 * run.solver = "fast". The laws are those of the FMU (fmu/src/physics); tests hold the two together.
 * SI. */

#ifndef CHAIN_STEPPER_H
#define CHAIN_STEPPER_H

#include <math.h>
#include <stdint.h>

#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

enum { LANES = 8 };

/* Places of the numbers. */
enum {
#define RIG(NAME, variable) NAME,
#define OWN(NAME, variable)
#include "parameters.def"
    N_RIG,
    BEFORE_OWN = N_RIG - 1,
#undef RIG
#undef OWN
#define RIG(NAME, variable)
#define OWN(NAME, variable) NAME,
#include "parameters.def"
#undef RIG
#undef OWN
    N_ALL
};

enum { N_OWN = 7 }; /* as a number, which the build reads: the lengths of a structure's arrays */
_Static_assert(N_OWN == N_ALL - N_RIG, "parameters.def has another number of OWN");

/* What is computed at each sample. */
enum { Z_SURFACE, V_SURFACE, Z_PART, V_PART, Z_PLATE, N_OUTPUTS };

/* The times at which a trial was sampled, and the steps between them. */
typedef struct {
    int64_t steps;         /* from the first sample to the last */
    const double *edges;   /* s; steps + 1, the first is 0 */
    const int32_t *sample; /* steps + 1: which sample an edge is, or -1 */
    const double *current; /* A at the edges, linear in between, in the coil; NULL: the drive decides */
} Schedule;

/* Lane by lane. */
typedef double Parameters[N_ALL][LANES];

/* Output k of sample j and lane l comes into out[(j * N_OUTPUTS + k) * LANES + l]. The machine is at
 * rest until the drive starts. */
void chain_run(const Schedule *schedule, const Parameters parameters, double *out);

/* ---- runs of scenes: without a plate that moves, in pieces ---- */

enum { N_STATE = 16, N_SUMS = 18 };

/* A period of V1 in one lane as straight lines: where each begins, as a share of the period, and V1 (V)
 * where it begins and ends. */
typedef struct {
    int64_t lines;
    const double *phase, *first, *last;
} Drive;

/* When settling and the run end, s, lane by lane. */
typedef struct {
    double settle[LANES], until[LANES];
} Span;

/* Where the runs stand between two pieces: lanes.h has the fields. */
typedef struct {
    double state[N_STATE][LANES], sums[N_SUMS][LANES];
} Kept;

/* The columns of a row, SI; cosim/simulation/fast.py has the same names in the same order. */
enum {
    ROW_CURRENT, ROW_COIL_VOLTAGE, ROW_BACK_EMF, ROW_Z_SURFACE, ROW_V_SURFACE, ROW_A_SURFACE,
    ROW_Z_RAM, ROW_V_RAM, ROW_Z_PART, ROW_V_PART, ROW_FRICTION_FORCE, ROW_STICKING, N_COLUMNS
};

/* A piece of the runs: the steps after `first` until `last`; step k ends at k times `step` (s). */
typedef struct {
    double step;
    int64_t first, last;
    int64_t samples;
    const double *times; /* s, rising; within the piece */
    int64_t rows;        /* 1: rows of the first lane; 0: heights of the surface of all */
    const Drive *drives; /* LANES */
} Stretch;

/* The machines at rest at time 0. */
EXPORT void stepper_begin(const Parameters parameters, const Drive drives[LANES], double step,
                          Kept *kept);

/* Go on through a piece. out[sample * N_COLUMNS + column], or out[sample * LANES + lane]. */
EXPORT void stepper_run(const Stretch *piece, const Parameters parameters, const Span *span,
                        Kept *kept, double *out);

/* Force of the suspension on a ram at rest at q, N, of the numbers RIG. */
EXPORT double stepper_suspension(const double rig[N_RIG], double q);

enum { MAX_RESTS = 4 };

/* The places (q, m) at which the ram rests without a current, rising: how many. */
EXPORT int64_t stepper_rests(const double rig[N_RIG], double rests[MAX_RESTS]);

EXPORT int64_t stepper_width(void); /* how many lanes this processor steps at once */

EXPORT int64_t stepper_sizes(int64_t which); /* bytes of Kept, of Stretch */

/* ---- between the files of the stepper ---- */

/* Before the drive starts, so many steps, as long as the first, before the first sample. */
typedef struct {
    int64_t steps;
    double surface[LANES], ram[LANES], plate[LANES]; /* heights, m */
    double jump[LANES];                              /* s, when the command drops first */
} Rest;

/* V1 on line `number` of a drive, counted from the first of the period 0: when it ends (s), what V1 is
 * there (V), and its slope (V/s). `phase` is the share of the period that has gone by at time 0. */
static inline void drive_line(const Drive *d, double number, double frequency, double phase,
                              double *end, double *top, double *slope)
{
    const double period = floor(number / (double)d->lines);
    const int64_t k = (int64_t)(number - period * (double)d->lines);
    const double until = k + 1 < d->lines ? d->phase[k + 1] : 1.0 + d->phase[0];
    *end = (period + until - phase) / frequency;
    *top = d->last[k];
    *slope = (d->last[k] - d->first[k]) * frequency / (until - d->phase[k]);
}

/* When step k begins. */
static inline double chain_edge(const Schedule *c, int64_t k)
{
    if (k < 0)
        return (double)k * c->edges[1];
    return k <= c->steps ? c->edges[k] : 2.0 * c->edges[c->steps] - c->edges[c->steps - 1];
}

typedef void ChainLanes(const Schedule *schedule, const Parameters parameters, const Rest *rest,
                        int from, double *out);
ChainLanes chain_lanes_2, chain_lanes_4, chain_lanes_8;

typedef void StepperFollow(const Stretch *piece, const Parameters parameters, const Span *span,
                           Kept *kept, double *out);
StepperFollow stepper_follow_2, stepper_follow_4, stepper_follow_8;

#endif
