/* SPDX-License-Identifier: BSD-2-Clause */
#include "extremes.h"

#include <math.h>

#include "mechanics.h"

enum { QUARTERS = 4 };

static void widen(double value, double *most, double *least)
{
    if (value > *most)
        *most = value;
    if (value < *least)
        *least = value;
}

void stickslip_note_extremes(Model *m, const double y[N_ALL], double acceleration)
{
    Reals *r = &m->r;
    widen(acceleration, &r->a_surface_max, &r->a_surface_min);
    widen(y[V], &r->v_surface_max, &r->v_surface_min);
    widen(y[Z], &r->z_surface_max, &r->z_surface_min);
    widen(y[I_COIL], &r->coil_current_max, &r->coil_current_min);
}

void stickslip_begin_extremes(Model *m, const double y[N_ALL], double acceleration)
{
    Reals *r = &m->r;
    r->a_surface_max = r->a_surface_min = acceleration;
    r->v_surface_max = r->v_surface_min = y[V];
    r->z_surface_max = r->z_surface_min = y[Z];
    r->coil_current_max = r->coil_current_min = y[I_COIL];
}

void stickslip_note_inner_extremes(Model *m, double from, double to)
{
    Reals *r = &m->r;
    for (int i = 0; i < m->ahead.n_extremes; i++) {
        const Extreme *e = &m->ahead.extremes[i];
        if (e->at < from || e->at > to)
            continue;
        switch (e->of) {
        case EXTREME_A:
            widen(e->value, &r->a_surface_max, &r->a_surface_min);
            break;
        case EXTREME_V:
            widen(e->value, &r->v_surface_max, &r->v_surface_min);
            break;
        case EXTREME_Z:
            widen(e->value, &r->z_surface_max, &r->z_surface_min);
            break;
        case EXTREME_CURRENT:
            widen(e->value, &r->coil_current_max, &r->coil_current_min);
            break;
        }
    }
}

void stickslip_note_short_extreme(Model *m, const Knot *from, const Knot *to, double h)
{
    static const double SHORTEST = 1e-8; /* s; in less the rounding of the velocities would count */
    if (h < SHORTEST)
        return;
    const double rise = to->dy[V] - from->dy[V], mean = 0.5 * (from->dy[V] + to->dy[V]);
    const double bend = 6.0 * ((to->y[V] - from->y[V]) / h - mean);
    if (fabs(rise) < fabs(bend))
        widen(mean + 0.25 * (bend + rise * rise / bend), &m->r.a_surface_max, &m->r.a_surface_min);
}

/* Does the current bend? Else it is its straight target. */
static int bends(const Model *m)
{
    return m->n.source && m->mode[0].output;
}

/* Acceleration at a stage. */
static double acceleration(const Stages *g, int wall, int stage)
{
    return wall < 0 ? g->k[stage][V] : g->k[stage][V] / g->clock[stage];
}

int stickslip_may_have_extreme(const Model *m, int wall, const Knot *from, const Stages *g)
{
    static const int BETWEEN[] = {5, 6, 7, 8, 9, 10};
    const double a0 = from->dy[V], a1 = acceleration(g, wall, 12), rise = a1 - a0;
    const double least = a0 < a1 ? a0 : a1, most = a0 < a1 ? a1 : a0;
    const double z0 = from->y[V], i0 = bends(m) ? from->dy[I_COIL] : 0.0;
    /* Height, velocity and current: their rates keep their signs. The acceleration goes one way, not
     * least next to the ends: stage 6 lies at 0.25, stage 10 at 0.857. */
    if (!(4.0 * (acceleration(g, wall, 6) - a0) * rise >= 0.3 * rise * rise &&
          7.0 * (a1 - acceleration(g, wall, 10)) * rise >= 0.3 * rise * rise) ||
        a0 * a1 <= 0.0 || z0 * g->k[12][Z] <= 0.0 || (bends(m) && i0 * g->k[12][I_COIL] <= 0.0))
        return 1;
    for (size_t i = 0; i < sizeof BETWEEN / sizeof *BETWEEN; i++) {
        const int stage = BETWEEN[i];
        const double a = acceleration(g, wall, stage);
        if (!(a >= least && a <= most) || g->k[stage][Z] * z0 <= 0.0 ||
            (bends(m) && g->k[stage][I_COIL] * i0 <= 0.0))
            return 1;
    }
    return 0;
}

/* Of a state its rate at a share of the step, 0, and what has the signs and zeros of its first two
 * derivatives in time, 1 and 2. */
enum { N_SLOPES = 3 };
STICKSLIP_INLINE void slopes(const Dense *dense, int state, double share, double d[N_DERIVATIVES])
{
    double clock[N_DERIVATIVES];
    stickslip_derivatives(&dense->c[0][state], N_ALL, share, d);
    if (dense->wall < 0)
        return;
    /* dx/dt = x' / t', so d2x/dt2 goes with x'' t' - x' t''. */
    stickslip_derivatives(dense->clock, 1, share, clock);
    d[2] = d[2] * clock[1] - d[1] * clock[2];
}

/* Where one of them vanishes between two shares of the step at which it differs in sign: by false
 * position, after Illinois. Next to it the extreme is flat. */
static double zero_between(const Dense *dense, int state, int order, double low, double high,
                           double at_low, double at_high)
{
    static const double NEAR = 1e-5;
    double x = low;
    for (int i = 0; i < 40; i++) {
        double d[N_DERIVATIVES];
        const double before = x;
        x = (low * at_high - high * at_low) / (at_high - at_low);
        slopes(dense, state, x, d);
        if (d[order] == 0.0 || fabs(x - before) < NEAR)
            break;
        if (d[order] * at_high < 0.0) {
            low = high;
            at_low = at_high;
        } else {
            at_low *= 0.5;
        }
        high = x;
        at_high = d[order];
    }
    return x;
}

static void add(Model *m, double tau, ExtremeOf of, double share)
{
    Ahead *ahead = &m->ahead;
    Knot knot;
    if (ahead->n_extremes == MAX_EXTREMES)
        return;
    stickslip_interpolate(m, &ahead->dense, share, &knot);
    const double at = knot.tau, *y = knot.y;
    if (at > ahead->end)
        return;
    double value = of == EXTREME_V ? y[V] : of == EXTREME_Z ? y[Z] : y[I_COIL];
    if (of == EXTREME_A) {
        Forces f;
        stickslip_forces(m, m->mode, y, 0, tau + at, &f);
        value = f.a_surface;
    }
    ahead->extremes[ahead->n_extremes++] = (Extreme){.of = of, .at = at, .value = value};
}

void stickslip_find_extremes(Model *m, double tau)
{
    /* At the touch a wall's clock stands still. */
    const Dense *dense = &m->ahead.dense;
    const double first = dense->wall < 0 ? 0.0 : 1e-3;
    double v[2][N_DERIVATIVES], i[2][N_DERIVATIVES];
    slopes(dense, V, first, v[0]);
    if (bends(m))
        slopes(dense, I_COIL, first, i[0]);
    for (int k = 1; k <= QUARTERS; k++) {
        const double low = k == 1 ? first : 0.25 * (k - 1), high = 0.25 * k;
        double *a = v[(k - 1) % 2], *b = v[k % 2];
        slopes(dense, V, high, b);
        for (int order = 0; order < N_SLOPES; order++)
            if (a[order] * b[order] < 0.0)
                add(m, tau,
                    order == 0   ? EXTREME_Z
                    : order == 1 ? EXTREME_V
                                 : EXTREME_A,
                    zero_between(dense, V, order, low, high, a[order], b[order]));
        if (bends(m)) {
            double *c = i[(k - 1) % 2], *d = i[k % 2];
            slopes(dense, I_COIL, high, d);
            if (c[1] * d[1] < 0.0)
                add(m, tau, EXTREME_CURRENT, zero_between(dense, I_COIL, 1, low, high, c[1], d[1]));
        }
    }
}
