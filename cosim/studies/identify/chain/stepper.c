#include "stepper.h"

#include <math.h>

/* Force on the ram at rest at q, without a current. */
static double balance(const double p[N_ALL][LANES], int l, double q)
{
    const double depth = -q - p[TRAVEL_DOWN][l];
    double force = -q * (p[SUSPENSION_K1][l] + q * (p[SUSPENSION_K2][l] + q * p[SUSPENSION_K3][l])) -
                   p[RAM_MASS][l] * p[GRAVITY][l];
    if (depth > 0.0)
        force += p[WALL_DOWN][l] * depth * sqrt(depth);
    return force;
}

/* Where the ram hangs at rest: as the FMU finds it, by bisection from the lower wall up. */
static double hanging(const double p[N_ALL][LANES], int l)
{
    double low = -p[TRAVEL_DOWN][l], high = 0.0;
    if (balance(p, l, low) < 0.0) {
        high = low;
        for (int k = 0; k < 60 && balance(p, l, low) < 0.0; k++)
            low *= 2.0;
    }
    for (int k = 0; k < 60; k++) {
        const double middle = 0.5 * (low + high);
        if (balance(p, l, middle) > 0.0)
            low = middle;
        else
            high = middle;
    }
    return 0.5 * (low + high);
}

void chain_run(const Schedule *c, const Parameters p, double *out)
{
    Rest rest = {0};
    for (int l = 0; l < LANES; l++) {
        const double before = ceil(-p[START][l] / c->edges[1]) + 1.0;
        if (before > (double)rest.steps)
            rest.steps = (int64_t)before;
    }
    for (int l = 0; l < LANES; l++) {
        const double held = p[LIFT][l] * p[MU_PLATE][l] * p[NORMAL_FORCE][l];
        const double weight =
            p[GRAVITY][l] * (p[SURFACE_MASS][l] + p[RAM_MASS][l] + p[PART_MASS][l]);
        rest.surface[l] = (held - weight) / p[FLEXURE_STIFFNESS][l];
        rest.ram[l] = rest.surface[l] + hanging(p, l);
        rest.plate[l] = p[PLATE_MASS][l] > 0.0 ? -held / p[PLATE_STIFFNESS][l] : 0.0;
        /* Drops before the middle of the first step are over. */
        const double middle = (0.5 - (double)rest.steps) * c->edges[1];
        const double cycle = floor(p[FREQUENCY][l] * middle + p[PHASE][l]) + 1.0;
        rest.jump[l] = (cycle - p[PHASE][l]) / p[FREQUENCY][l];
    }
    int width = 2;
    ChainLanes *lanes = chain_lanes_2;
#ifdef __x86_64__
    if (__builtin_cpu_supports("avx2"))
        width = 4, lanes = chain_lanes_4;
    if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq"))
        width = 8, lanes = chain_lanes_8;
#endif
    for (int from = 0; from < LANES; from += width)
        lanes(c, p, &rest, from, out);
}
