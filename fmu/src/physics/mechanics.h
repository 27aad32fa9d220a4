/* SPDX-License-Identifier: BSD-2-Clause */
/* Forces, accelerations and their rates in a given mode. No time stepping, no events. */
#ifndef STICKSLIP_MECHANICS_H
#define STICKSLIP_MECHANICS_H

#include "internal.h"
#include "state.h"

static inline double stickslip_part_mass_per_surface(const Model *m)
{
    return m->r.part_mass / m->n.n_surfaces;
}

/* One surface that moves with its ram by itself and touches no plate: the case that has code of its
 * own wherever speed counts. */
static inline int is_plain(const Model *m)
{
    return !(m->n.prescribed | m->n.independent | m->n.ram_fixed) && m->r.mu_plate == 0.0;
}

STICKSLIP_INTERNAL_BEGIN

typedef struct {
    double a_surface, a_q, a_slip; /* d2 z_s/dt2, d2 q/dt2, dw/dt, m/s2 */
    double friction, plate, wall;  /* on the part, on the part, on the ram, N */
    double drive;                  /* coil's force on the ram, N */
    double normal;                 /* normal force, N */
} Forces;

typedef struct {
    double friction, plate, wall; /* N/s */
    double normal;                /* N/s */
} ForceRates;

/* For surface s, of the modes and states of all that move. tau is the time since the inputs were
 * brought up to date (the start of the step), s. */
void stickslip_forces(const Model *m, const Mode mode[N_MOVING], const double y[N_ALL], int s,
                      double tau, Forces *f);
void stickslip_force_rates(const Model *m, const Mode mode[N_MOVING], const double y[N_ALL], int s,
                           double tau, const Forces *f, ForceRates *rate);
/* Mass that moves with surface s while the part sticks to it, without the surface and its ram, kg. */
double stickslip_carried_mass(const Model *m, const Mode mode[N_MOVING], int s);

/* Force on what surface s carries, beside that surface and the weight of carried_mass, N: the
 * friction of the other surface where that slips, and what acts on the other surface where it moves
 * along. */
double stickslip_lift_on(const Model *m, const Mode mode[N_MOVING], const double y[N_ALL], int s,
                         double tau, double normal);
/* Where the surface's acceleration is given: on the part alone, the ram standing still in the
 * actuator. */
void stickslip_forces_on_part(const Model *m, const Mode *mode, double tau, double a_surface,
                              Forces *f);

/* For all surfaces that move. */
void stickslip_state_rates(const Model *m, const Mode mode[N_MOVING], const double y[N_ALL],
                           double tau, double dy[N_ALL]);
double stickslip_energy_stored(const Model *m, const double y[N_ALL]);

/* For one surface, of its own mode and states. */

/* Height of the surface at rest, under the weight of all that it carries and, with the ram on the
 * ground, the suspension's force at the centre, m. */
double stickslip_rest_height(const Model *m);
/* What the spring of a touched compliant wall holds, J. */
double stickslip_wall_energy(const Model *m, const Mode *mode, const double y[N_STATES]);

STICKSLIP_INTERNAL_END

#endif
