/* SPDX-License-Identifier: BSD-2-Clause */
/* The laws of springs, dampers and walls, each stated here alone: its force, what follows from it for
 * the rest, for events and for the account of energies. In a header, since every evaluation of the
 * rates takes them; a sum's order of operations is part of it, as the same bits are promised. */
#ifndef STICKSLIP_ELEMENTS_H
#define STICKSLIP_ELEMENTS_H

#include <math.h>

#include "state.h"

/* ---- the suspension between ram and surface, against q and u: c u, and by its law
 *
 * cubic      k1 q + k2 q^2 + k3 q^3
 * knee       k1 q - a max(knee - q, 0)^2
 * repulsion  -c/(1 + q/d)^3; below the lower wall the straight line that goes on from there, so that
 *            it is regular however deep the ram presses into the wall ---- */

enum { CUBIC = 1, KNEE = 2, REPULSION = 3 };

static inline double suspension_linear(const Model *m, double q)
{
    return m->n.suspension == REPULSION ? 0.0 : q * m->r.suspension_k1;
}

/* Of the law repulsion: its force at the nearest place that is not below the lower wall; how far q is
 * from there (0 or less); and its stiffness. */
typedef struct {
    double force, below, stiffness, share;
} Repulsion;

static inline Repulsion repulsion_at(const Reals *p, double q)
{
    const double place = q < -p->travel ? -p->travel : q;
    Repulsion r = {.below = q - place, .share = 1.0 + place / p->suspension_distance};
    r.force = p->suspension_repulsion / (r.share * r.share * r.share);
    r.stiffness = 3.0 * r.force / (r.share * p->suspension_distance);
    return r;
}

static inline double below_knee(const Reals *p, double q)
{
    return q < p->suspension_knee ? p->suspension_knee - q : 0.0;
}

static inline double suspension_bent(const Model *m, double q)
{
    const Reals *p = &m->r;
    if (m->n.suspension == CUBIC)
        return q * q * (p->suspension_k2 + q * p->suspension_k3);
    if (m->n.suspension == KNEE)
        return -p->suspension_hardening * below_knee(p, q) * below_knee(p, q);
    const Repulsion r = repulsion_at(p, q);
    return r.stiffness * r.below - r.force;
}

static inline double suspension_damper(const Reals *p, double u)
{
    return p->suspension_damping * u;
}

/* On the ram, N. */
static inline double suspension_force(const Model *m, double q, double u)
{
    return -(suspension_damper(&m->r, u) + suspension_linear(m, q)) - suspension_bent(m, q);
}

/* On the ram at rest, N. */
static inline double suspension_at_rest(const Model *m, double q)
{
    const Reals *p = &m->r;
    if (m->n.suspension != CUBIC)
        return -(suspension_linear(m, q) + suspension_bent(m, q));
    return -q * (p->suspension_k1 + q * (p->suspension_k2 + q * p->suspension_k3));
}

/* N/m */
static inline double suspension_stiffness(const Model *m, double q)
{
    const Reals *p = &m->r;
    if (m->n.suspension == KNEE)
        return p->suspension_k1 + 2.0 * p->suspension_hardening * below_knee(p, q);
    if (m->n.suspension == REPULSION)
        return repulsion_at(p, q).stiffness;
    return p->suspension_k1 + q * (2.0 * p->suspension_k2 + q * 3.0 * p->suspension_k3);
}

/* J; of the laws knee and repulsion against that at the knee and at the centre. */
static inline double suspension_energy(const Model *m, double q)
{
    const Reals *p = &m->r;
    if (m->n.suspension == KNEE) {
        const double below = below_knee(p, q);
        return 0.5 * p->suspension_k1 * q * q +
               p->suspension_hardening * below * below * below * (1.0 / 3.0);
    }
    if (m->n.suspension == REPULSION) {
        const Repulsion r = repulsion_at(p, q);
        return 0.5 * p->suspension_repulsion * p->suspension_distance *
                   (1.0 / (r.share * r.share) - 1.0) -
               r.below * (r.force - 0.5 * r.stiffness * r.below);
    }
    return q * q * (p->suspension_k1 / 2.0 +
                    q * (p->suspension_k2 / 3.0 + q * p->suspension_k3 / 4.0));
}

/* ---- the flexures between surface and ground: k z + c v, against z and v ---- */

static inline double flexure_spring(const Reals *p, double z)
{
    return p->flexure_stiffness * z;
}

static inline double flexure_damper(const Reals *p, double v)
{
    return p->flexure_damping * v;
}

/* On the surface, N/s; of its velocity and acceleration. */
static inline double flexure_force_rate(const Reals *p, double v, double a)
{
    return -p->flexure_stiffness * v - p->flexure_damping * a;
}

/* J */
static inline double flexure_energy(const Reals *p, double z)
{
    return 0.5 * p->flexure_stiffness * z * z;
}

/* Heat in the dampers of flexures and suspension, W. */
static inline double damping_power(const Reals *p, double v, double u)
{
    return p->flexure_damping * v * v + p->suspension_damping * u * u;
}

/* ---- a compliant wall on the side +1 or -1: K depth^1.5 (1 + lambda speed), Hunt and Crossley ---- */

/* Of the penetration and of its root, N; the second form waits for the root alone. */
static inline double wall_spring(const Reals *p, double depth)
{
    return p->contact_stiffness * depth * sqrt(depth);
}

static inline double wall_spring_of_root(const Reals *p, double root)
{
    return (p->contact_stiffness * root) * (root * root);
}

/* Of the spring's force and the speed into the wall, N. */
static inline double wall_damper(const Reals *p, double spring, double speed)
{
    return spring * (p->contact_damping * speed);
}

/* On the ram, N. */
static inline double wall_force(const Reals *p, int side, double depth, double u)
{
    return -side * p->contact_stiffness * depth * sqrt(depth) *
           (1.0 + p->contact_damping * side * u);
}

/* N/s; `a` is the ram's acceleration in the actuator. */
static inline double wall_force_rate(const Reals *p, int side, double depth, double u, double a)
{
    const double speed = side * u;
    return -side * p->contact_stiffness * sqrt(depth) *
           (1.5 * speed * (1.0 + p->contact_damping * speed) + depth * p->contact_damping * side * a);
}

/* J */
static inline double wall_spring_energy(const Reals *p, double depth)
{
    return 0.4 * p->contact_stiffness * depth * depth * sqrt(depth);
}

#endif
