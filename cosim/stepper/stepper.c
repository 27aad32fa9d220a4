#include "stepper.h"

#include <string.h>

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

/* Lane l at rest; `middle` is that of its first step, s: drops before it are over. */
static void rest_of(const double p[N_ALL][LANES], int l, double middle, Rest *rest)
{
    const double held = p[LIFT][l] * p[MU_PLATE][l] * p[NORMAL_FORCE][l];
    const double weight = p[GRAVITY][l] * (p[SURFACE_MASS][l] + p[RAM_MASS][l] + p[PART_MASS][l]);
    rest->surface[l] = (held - weight) / p[FLEXURE_STIFFNESS][l];
    rest->ram[l] = rest->surface[l] + hanging(p, l);
    rest->plate[l] = p[PLATE_MASS][l] > 0.0 ? -held / p[PLATE_STIFFNESS][l] : 0.0;
    const double cycle = floor(p[FREQUENCY][l] * middle + p[PHASE][l]) + 1.0;
    rest->jump[l] = (cycle - p[PHASE][l]) / p[FREQUENCY][l];
}

/* How many lanes this processor steps at once. */
static int width(void)
{
#ifdef __x86_64__
    if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq"))
        return 8;
    if (__builtin_cpu_supports("avx2"))
        return 4;
#endif
    return 2;
}

#ifdef __x86_64__
#define OF_WIDTH(name) (width() == 8 ? name##_8 : width() == 4 ? name##_4 : name##_2)
#else
#define OF_WIDTH(name) name##_2
#endif

void chain_run(const Schedule *c, const Parameters p, double *out)
{
    Rest rest = {0};
    for (int l = 0; l < LANES; l++) {
        const double before = ceil(-p[START][l] / c->edges[1]) + 1.0;
        if (before > (double)rest.steps)
            rest.steps = (int64_t)before;
    }
    for (int l = 0; l < LANES; l++)
        rest_of(p, l, (0.5 - (double)rest.steps) * c->edges[1], &rest);
    ChainLanes *lanes = OF_WIDTH(chain_lanes);
    for (int from = 0; from < LANES; from += width())
        lanes(c, p, &rest, from, out);
}

void stepper_begin(const Parameters p, const Drive drives[LANES], double step, Kept *kept)
{
    /* As the fields lie in lanes.h. */
    enum { T, Z, V, Y, R, X, W, PLATE, S, I, SLIP, JUMP, TOP, SLOPE, LINE };
    enum { V_MAX = 7, V_MIN, Z_MAX, Z_MIN, I_MAX, I_MIN };
    Rest rest = {0};
    memset(kept, 0, sizeof *kept);
    for (int l = 0; l < LANES; l++) {
        rest_of(p, l, 0.5 * step, &rest);
        kept->state[Z][l] = kept->state[X][l] = rest.surface[l];
        kept->state[Y][l] = rest.ram[l];
        double number = (double)drives[l].lines * floor(0.5 * step * p[FREQUENCY][l] + p[PHASE][l]) - 1.0;
        do
            drive_line(drives + l, ++number, p[FREQUENCY][l], p[PHASE][l], &kept->state[JUMP][l],
                       &kept->state[TOP][l], &kept->state[SLOPE][l]);
        while (kept->state[JUMP][l] <= 0.5 * step);
        kept->state[LINE][l] = number;
        kept->sums[V_MAX][l] = kept->sums[Z_MAX][l] = kept->sums[I_MAX][l] = -INFINITY;
        kept->sums[V_MIN][l] = kept->sums[Z_MIN][l] = kept->sums[I_MIN][l] = INFINITY;
    }
}

void stepper_run(const Stretch *piece, const Parameters p, const Span *span, Kept *kept, double *out)
{
    OF_WIDTH(stepper_follow)(piece, p, span, kept, out);
}

int64_t stepper_sizes(int64_t which)
{
    return (int64_t)(which ? sizeof(Stretch) : sizeof(Kept));
}
