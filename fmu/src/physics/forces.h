/* SPDX-License-Identifier: BSD-2-Clause */
/* The forces of the present mode. In a header, since every event function and every row takes them. */
#ifndef STICKSLIP_FORCES_H
#define STICKSLIP_FORCES_H

#include <math.h>

#include "coil.h"
#include "elements.h"
#include "mechanics.h"
#include "source.h"

/* Penetration of the touched wall. Clamped at 0: trial points of a step may lie beyond the event. */
static inline double penetration(const Model *m, const Mode *mode, const double y[N_STATES])
{
    double depth = mode->side * y[Q] - m->r.travel;
    return depth > 0.0 ? depth : 0.0;
}

static inline int held_by_plate(const Model *m, const Mode *mode)
{
    return mode->plate == 0 && m->r.mu_plate > 0.0;
}

static inline double normal_force_at(const Model *m, double tau)
{
    const double force = m->r.normal_force + m->r.normal_force_slope * tau;
    return force > 0.0 ? force : 0.0; /* not fmax, which is a call */
}

/* What acts on one surface without friction. */
typedef struct {
    double suspension, drive, wall; /* on the ram, N */
    double body;                    /* mass that moves as one with the surface, kg */
    double load;                    /* force on it, N */
} Load;

static inline void load_on(const Model *m, const Mode *mode, const double y[N_STATES], int s, double tau,
                    Load *l)
{
    const Reals *p = &m->r;
    const double q = y[Q], u = y[U];
    const int rest = mode->wall == WALL_REST;
    l->suspension = suspension_force(m, q, u);
    l->drive = force_factor_at(m, q) * stickslip_coil_current(m, y, s, tau);
    l->wall = 0.0;
    if (mode->wall == WALL_TOUCH)
        l->wall = wall_force(p, mode->side, penetration(m, mode, y), u);
    const double on_ram = l->drive + l->suspension + l->wall;
    l->body = rest ? p->surface_mass + p->ram_mass : p->surface_mass;
    l->load = (-flexure_spring(p, y[Z]) - flexure_damper(p, y[V]) - l->body * p->gravity) -
              (rest ? 0.0 : on_ram);
}

/* `plain` is a constant for the compiler: 1 only where the machine is. */
STICKSLIP_INLINE void forces_of(const int plain, const Model *m, const Mode modes[N_MOVING],
                                const double all[N_ALL], int s, double tau, Forces *f)
{
    if (!plain && m->n.prescribed) {
        stickslip_forces_on_part(m, modes, tau, m->r.surface_acceleration, f);
        return;
    }
    const Reals *p = &m->r;
    const Mode *mode = modes + s;
    const double *y = all + s * N_STATES;

    if (!plain && mode->wall == WALL_REST && m->n.ram_fixed) {
        stickslip_forces_on_part(m, mode, tau, 0.0, f);
        f->drive = force_factor_at(m, y[Q]) * stickslip_coil_current(m, y, s, tau);
        f->wall = -flexure_spring(p, y[Z]) - p->surface_mass * p->gravity - f->friction -
                  f->drive - suspension_force(m, y[Q], y[U]);
        return;
    }
    Load l;
    load_on(m, mode, y, s, tau, &l);
    f->drive = l.drive;
    f->wall = l.wall;
    f->normal = normal_force_at(m, tau);
    const int alone = plain || !m->n.independent;
    const double part = alone ? stickslip_part_mass_per_surface(m) : stickslip_carried_mass(m, modes, s);
    const double body = l.body;
    const double lift = alone ? 0.0 : stickslip_lift_on(m, modes, all, s, tau, f->normal);
    const int held = !plain && held_by_plate(m, mode);
    /* Divisions that need not wait for the states. */
    const double per_ram = 1.0 / p->ram_mass, per_part = 1.0 / part;
    const double per_moving = 1.0 / (mode->slip == 0 ? body + part : body);

    f->plate = plain ? 0.0 : -p->mu_plate * f->normal * mode->plate;
    if (mode->slip == 0) {
        if (held) {
            f->a_surface = 0.0;
            f->friction = l.load;
            f->plate = part * p->gravity - f->friction;
        } else {
            f->a_surface = (l.load - part * p->gravity + f->plate + lift) * per_moving;
            f->friction = part * (f->a_surface + p->gravity) - f->plate - lift;
        }
        f->a_slip = 0.0;
    } else {
        f->friction = -p->mu_k * f->normal * mode->slip;
        f->a_surface = (l.load - f->friction) * per_moving;
        if (held) {
            f->plate = part * p->gravity - f->friction;
            f->a_slip = -f->a_surface;
        } else {
            f->a_slip = (f->friction + f->plate + lift) * per_part - p->gravity - f->a_surface;
        }
    }
    if (mode->wall == WALL_REST) {
        f->a_q = 0.0;
        f->wall = p->ram_mass * (f->a_surface + p->gravity) - f->drive - l.suspension;
    } else if (!plain && m->n.ram_fixed) {
        f->a_q = -f->a_surface;
    } else {
        f->a_q = (l.drive + l.suspension + l.wall) * per_ram - p->gravity - f->a_surface;
    }
}

#endif
