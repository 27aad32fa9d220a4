/* SPDX-License-Identifier: BSD-2-Clause */
/* The rates of the states as the integration takes them: what the mode and the inputs decide is
 * decided once a step and not at each of its stages. The laws are those of elements.h and coil.h;
 * forces.h puts them together in all cases, here is the one that most steps are of. In a header, for
 * speed. */
#ifndef STICKSLIP_LAW_H
#define STICKSLIP_LAW_H

#include <math.h>

#include "elements.h"
#include "mechanics.h"
#include "source.h"

typedef struct {
    const Model *m;
    int general; /* only mechanics.c has this case; then nothing below is set */
    int touch, rest, slips, eddy, clamped;
    double side, slip;
    double per_moving, per_ram, per_part; /* inverse masses, 1/kg */
    double per_both;                      /* of the ram against the surface: their sum; 0 at rest */
    double load;                          /* constant part of what moves the surface, N */
    double kinetic;                       /* mu_k, against the slip */
    double following_rate;                /* of the current while it follows its target, A/s */
} Law;

static inline Law stickslip_law(const Model *m)
{
    const Reals *p = &m->r;
    const Mode *mode = m->mode;
    Law l = {.m = m};
    l.general = !is_plain(m);
    if (l.general)
        return l;
    const double part = stickslip_part_mass_per_surface(m);
    const double body = p->surface_mass + (mode->wall == WALL_REST ? p->ram_mass : 0.0);
    l.touch = mode->wall == WALL_TOUCH;
    l.rest = mode->wall == WALL_REST;
    l.slips = mode->slip != 0;
    l.side = mode->side;
    l.slip = mode->slip;
    l.per_moving = 1.0 / (l.slips ? body : body + part);
    l.per_ram = 1.0 / p->ram_mass;
    l.per_part = 1.0 / part;
    l.per_both = l.rest ? 0.0 : l.per_ram + l.per_moving;
    l.load = -(l.slips ? body : body + part) * p->gravity;
    l.kinetic = -p->mu_k * mode->slip;
    l.eddy = m->n.source && has_eddy(m);
    l.clamped = m->n.source && mode->output;
    if (m->n.source)
        l.following_rate = target_rate(m, mode, 0);
    return l;
}

static inline double stickslip_law_root(const Law *l, const double y[N_STATES])
{
    const double depth = l->side * y[Q] - l->m->r.travel;
    return depth > 0.0 ? sqrt(depth) : 0.0;
}

/* Of one surface, each times `per`, which a loop could not do as fast: a processor cannot read as a
 * vector what it has just written one by one. `root` is that of the penetration; it counts while a
 * compliant wall is touched. A stage waits for the one before it: the sums are such that few
 * operations lie between the ram's place and its acceleration. */
STICKSLIP_INLINE void
stickslip_law_rates(const Law *l, const int source, const double y[N_STATES], double root,
                    double tau, const double per, double dy[N_STATES])
{
    const Model *m = l->m;
    const Reals *p = &m->r;
    const double q = y[Q], u = y[U], v = y[V], w = y[W];
    const double shape = force_factor_shape(m, q);
    const double i = source ? y[I_COIL] : p->current + p->current_slope * tau;
    const double drive = (p->force_factor * i) * shape;
    const double suspension = suspension_linear(m, q) + suspension_bent(m, q);
    double on_ram = (drive - suspension_damper(p, u)) - suspension;
    double lost = 0.0;
    if (l->touch) {
        const double spring = wall_spring_of_root(p, root), closing = l->side * u;
        const double damped = wall_damper(p, spring, closing);
        on_ram -= l->side * (spring + damped);
        lost = damped * closing;
    }
    double friction = 0.0;
    if (l->slips) {
        const double normal = p->normal_force + p->normal_force_slope * tau;
        friction = normal > 0.0 ? l->kinetic * normal : 0.0;
    }
    /* Acceleration of the surface but for what the ram does to it. */
    const double alone =
        ((l->load - friction) - flexure_spring(p, y[Z]) - flexure_damper(p, v)) * l->per_moving;
    const double a = l->rest ? alone : alone - on_ram * l->per_moving;
    dy[Z] = per * v;
    dy[V] = per * a;
    dy[Q] = per * u;
    dy[U] = l->rest ? 0.0 : per * (on_ram * l->per_both - (p->gravity + alone));
    dy[D] = per * w;
    dy[W] = l->slips ? per * ((friction * l->per_part - p->gravity) - a) : 0.0;
    dy[E_IN] = per * (drive * u);
    dy[E_FRICTION] = per * (-friction * w); /* of sticking, w is 0 */
    dy[E_IMPACT] = per * lost;
    dy[E_DAMPING] = per * damping_power(p, v, u);
    if (!source) {
        dy[I_COIL] = dy[I_EDDY] = dy[E_OUTPUT] = dy[E_COPPER] = 0.0;
        return;
    }
    const double eddy = l->eddy ? p->eddy_resistance * (i - y[I_EDDY]) : 0.0;
    const double loop = loop_resistance(m), at_rest = loop * i + eddy + (p->force_factor * u) * shape;
    double output, rate = l->following_rate;
    if (l->clamped) {
        output = output_limit(m, m->mode[0].output);
        rate = (output - at_rest) / p->inductance;
    } else {
        output = at_rest + p->inductance * rate;
    }
    dy[I_COIL] = per * rate;
    dy[I_EDDY] = l->eddy ? per * (eddy / p->eddy_inductance) : 0.0;
    dy[E_OUTPUT] = per * (output * i);
    dy[E_COPPER] = per * (loop * i * i + (l->eddy ? eddy * (i - y[I_EDDY]) : 0.0));
}

#endif
