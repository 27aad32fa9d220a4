#include "stepper.h"

#include <stdatomic.h>
#include <string.h>
#ifdef __x86_64__
#include <cpuid.h>
#endif

double stepper_suspension(const double p[N_RIG], double q)
{
    if (p[SUSPENSION] == 1.0)
        return -q * (p[SUSPENSION_K1] + q * (p[SUSPENSION_K2] + q * p[SUSPENSION_K3]));
    if (p[SUSPENSION] == 2.0) {
        const double below = fmax(p[SUSPENSION_KNEE] - q, 0.0);
        return p[SUSPENSION_HARDENING] * below * below - q * p[SUSPENSION_K1];
    }
    const double place = fmax(q, -p[TRAVEL_DOWN]), d = p[SUSPENSION_DISTANCE];
    const double force = p[SUSPENSION_REPULSION] / pow(1.0 + place / d, 3.0);
    return force * (1.0 - 3.0 * (q - place) / (d + place));
}

/* Force on the ram at rest at q, without a current. */
static double balance(const double p[N_RIG], double q)
{
    const double above = fmax(q - p[TRAVEL_UP], 0.0), below = fmax(-q - p[TRAVEL_DOWN], 0.0);
    return stepper_suspension(p, q) - p[RAM_MASS] * p[GRAVITY] +
           p[WALL_DOWN] * below * sqrt(below) - p[WALL_UP] * above * sqrt(above);
}

/* Where the balance, above 0 at `low`, falls through 0. */
static double zero_between(const double p[N_RIG], double low, double high)
{
    for (int k = 0; k < 60; k++) {
        const double middle = 0.5 * (low + high);
        if (balance(p, middle) > 0.0)
            low = middle;
        else
            high = middle;
    }
    return 0.5 * (low + high);
}

/* Where the travel is cut into pieces on each of which the balance only rises or only falls, rising:
 * its ends, the centre, and where the cubic has no stiffness. */
static void cuts(const double p[N_RIG], double at[5])
{
    const double k1 = p[SUSPENSION_K1], k2 = p[SUSPENSION_K2], k3 = p[SUSPENSION_K3];
    const double square = p[SUSPENSION] == 1.0 ? k2 * k2 - 3.0 * k1 * k3 : 0.0;
    const double twice = k2 < 0.0 ? sqrt(fmax(square, 0.0)) - k2 : -sqrt(fmax(square, 0.0)) - k2;
    const double found[5] = {-p[TRAVEL_DOWN], 0.0, p[TRAVEL_UP],
                             square > 0.0 ? k1 / twice : 0.0, square > 0.0 ? twice / (3.0 * k3) : 0.0};
    for (int n = 0; n < 5; n++) {
        const double next = fmin(fmax(found[n], found[0]), p[TRAVEL_UP]);
        int k = n;
        for (; k > 0 && at[k - 1] > next; k--)
            at[k] = at[k - 1];
        at[k] = next;
    }
}

int64_t stepper_rests(const double p[N_RIG], double rests[MAX_RESTS])
{
    const double bottom = -p[TRAVEL_DOWN], top = p[TRAVEL_UP];
    int64_t n = 0;
    double at[5];
    cuts(p, at);
    if (balance(p, bottom) < 0.0) {
        double low = bottom;
        for (int k = 0; k < 60 && balance(p, low) < 0.0; k++)
            low *= 2.0;
        rests[n++] = zero_between(p, low, bottom);
    }
    for (int k = 0; k < 4; k++)
        if (balance(p, at[k]) > 0.0 && balance(p, at[k + 1]) <= 0.0)
            rests[n++] = zero_between(p, at[k], at[k + 1]);
    if (balance(p, top) > 0.0) {
        double high = top;
        for (int k = 0; k < 60 && balance(p, high) > 0.0; k++)
            high *= 2.0;
        rests[n++] = zero_between(p, top, high);
    }
    return n;
}

/* Where the ram hangs at rest: as the FMU has it, at the place nearest to the centre. */
static double hanging(const double all[N_ALL][LANES], int l)
{
    double p[N_RIG], rests[MAX_RESTS], nearest = INFINITY;
    for (int k = 0; k < N_RIG; k++)
        p[k] = all[k][l];
    const int64_t n = stepper_rests(p, rests);
    for (int64_t k = 0; k < n; k++)
        if (fabs(rests[k]) < fabs(nearest))
            nearest = rests[k];
    return n ? nearest : 0.0;
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

#ifndef WIDEST
#define WIDEST 8 /* lanes at once, at most */
#endif

#ifdef __x86_64__
/* How many lanes the processor can step at once, where the system keeps registers of that width. The
 * compilers have a function for it, but that of zig's library says that no processor can do anything. */
static int able(void)
{
    unsigned a, b, c, d, kept, high;
    if (!__get_cpuid(1, &a, &b, &c, &d) || !(c & bit_OSXSAVE) || !(c & bit_AVX))
        return 2;
    __asm__("xgetbv" : "=a"(kept), "=d"(high) : "c"(0));
    if (!__get_cpuid_count(7, 0, &a, &b, &c, &d))
        return 2;
    const unsigned avx512 = bit_AVX512F | bit_AVX512DQ;
    if (WIDEST >= 8 && (b & avx512) == avx512 && (kept & 0xe6) == 0xe6)
        return 8;
    return WIDEST >= 4 && (b & bit_AVX2) && (kept & 0x6) == 0x6 ? 4 : 2;
}

/* How many it steps; asked once, since under a hypervisor an answer takes as long as many steps. */
static int width(void)
{
    static _Atomic int known;
    if (!known)
        known = able();
    return known;
}

#define OF_WIDTH(name) (width() == 8 ? name##_8 : width() == 4 ? name##_4 : name##_2)
#else
static int width(void) { return 2; }

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

int64_t stepper_width(void) { return width(); }

int64_t stepper_sizes(int64_t which)
{
    return (int64_t)(which ? sizeof(Stretch) : sizeof(Kept));
}
