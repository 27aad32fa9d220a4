/* SPDX-License-Identifier: BSD-2-Clause */
/* The laws of springs, dampers and walls, each stated here alone: its force, what follows from it for
 * the rest, for events and for the account of energies. In a header, since every evaluation of the
 * rates takes them; a sum's order of operations is part of it, as the same bits are promised. */
#ifndef STICKSLIP_ELEMENTS_H
#define STICKSLIP_ELEMENTS_H

#include <math.h>

#include "state.h"

/* ---- the suspension between ram and surface: k1 q + k2 q^2 + k3 q^3 + c u, against q and u ---- */

static inline double suspension_linear(const Reals *p, double q)
{
    return q * p->suspension_k1;
}

static inline double suspension_bent(const Reals *p, double q)
{
    return q * q * (p->suspension_k2 + q * p->suspension_k3);
}

static inline double suspension_damper(const Reals *p, double u)
{
    return p->suspension_damping * u;
}

/* On the ram, N. */
static inline double suspension_force(const Reals *p, double q, double u)
{
    return -(suspension_damper(p, u) + suspension_linear(p, q)) - suspension_bent(p, q);
}

/* On the ram at rest, N. */
static inline double suspension_at_rest(const Reals *p, double q)
{
    return -q * (p->suspension_k1 + q * (p->suspension_k2 + q * p->suspension_k3));
}

/* N/m */
static inline double suspension_stiffness(const Reals *p, double q)
{
    return p->suspension_k1 + q * (2.0 * p->suspension_k2 + q * 3.0 * p->suspension_k3);
}

/* J */
static inline double suspension_energy(const Reals *p, double q)
{
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
