/* The whole chain, current source, coil, ram, surface, part and springed plate, stepped through time
 * for LANES sets of parameters at once: what the search of an identification runs on. The laws are
 * those of the FMU (fmu/src/physics); tests hold the two together. SI. */

#ifndef CHAIN_STEPPER_H
#define CHAIN_STEPPER_H

#include <stdint.h>

enum { LANES = 8 };

/* Numbers of a rig, then those of one trial on it; chain.py has the same names in the same order. */
enum {
    FORCE_FACTOR, SURFACE_MASS, FLEXURE_STIFFNESS, FLEXURE_DAMPING, SUSPENSION_K1, SUSPENSION_K2,
    SUSPENSION_K3, SUSPENSION_DAMPING, TRAVEL_UP, TRAVEL_DOWN, WALL_UP, WALL_DOWN, WALL_DAMPING,
    MU_PLATE, MU_K, MU_S, RAM_MASS, PART_MASS, PLATE_MASS, PLATE_STIFFNESS, PLATE_DAMPING,
    RESISTANCE, INDUCTANCE, SENSE_RESISTANCE, OUTPUT_HIGH, OUTPUT_LOW, CURRENT_LIMIT, GRAVITY,
    N_RIG,
    AMPLITUDE = N_RIG, /* V peak-to-peak at V1 */
    OFFSET,            /* V */
    PHASE,             /* share of the period that has gone by at time 0; the drop is at whole numbers */
    START,             /* s, when the drive is switched on; rest before */
    LIFT,              /* height at rest, above equilibrium, as a share of what the plate's friction holds */
    NORMAL_FORCE,      /* N */
    FREQUENCY,         /* Hz, of the drive */
    N_ALL,
    N_OWN = N_ALL - N_RIG
};

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

/* ---- between the files of the stepper ---- */

/* Before the drive starts, so many steps, as long as the first, before the first sample. */
typedef struct {
    int64_t steps;
    double surface[LANES], ram[LANES], plate[LANES]; /* heights, m */
    double jump[LANES];                              /* s, when the command drops first */
} Rest;

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

#endif
