/* SPDX-License-Identifier: BSD-2-Clause */
#include "mechanics.h"

#include <math.h>

#include "forces.h"

double stickslip_rest_height(const Model *m)
{
    const double ram = m->n.ram_fixed ? 0.0 : m->r.ram_mass;
    const double weight =
        (ram + m->r.surface_mass + stickslip_part_mass_per_surface(m)) * m->r.gravity;
    /* A ram on the ground does not hang in the suspension, which may push the surface, too. */
    const double pushed = m->n.ram_fixed ? suspension_at_rest(m, 0.0) : 0.0;
    return -(weight + pushed) / m->r.flexure_stiffness;
}

void stickslip_forces_on_part(const Model *m, const Mode *mode, double tau, double a_surface,
                              Forces *f)
{
    const Reals *p = &m->r;
    const double part = stickslip_part_mass_per_surface(m), weight = part * p->gravity;
    const int held = held_by_plate(m, mode);

    f->a_surface = a_surface;
    f->a_q = f->wall = f->drive = 0.0;
    f->normal = normal_force_at(m, tau);
    f->plate = -p->mu_plate * f->normal * mode->plate;
    f->a_slip = 0.0;
    if (mode->slip == 0 && held) {
        /* At rest on both: who carries the weight is not determined; the surface does if it can. */
        f->friction = fmin(weight, p->mu_s * f->normal);
        f->plate = weight - f->friction;
    } else if (mode->slip == 0) {
        f->friction = part * f->a_surface + weight - f->plate;
    } else {
        f->friction = -p->mu_k * f->normal * mode->slip;
        if (held)
            f->plate = weight - f->friction;
        f->a_slip = (f->friction + f->plate) / part - p->gravity - f->a_surface;
        if (held)
            f->a_slip = -f->a_surface;
    }
}

static void rates_on_part(const Model *m, const Mode *mode, const Forces *f, ForceRates *rate)
{
    const double normal = f->normal > 0.0 ? m->r.normal_force_slope : 0.0;
    const double weight = stickslip_part_mass_per_surface(m) * m->r.gravity;
    const int held = held_by_plate(m, mode);

    rate->wall = 0.0;
    rate->normal = normal;
    rate->plate = -m->r.mu_plate * normal * mode->plate;
    if (mode->slip == 0)
        rate->friction = !held                           ? -rate->plate
                         : m->r.mu_s * f->normal < weight ? m->r.mu_s * normal
                                                          : 0.0;
    else
        rate->friction = -m->r.mu_k * normal * mode->slip;
    if (held)
        rate->plate = -rate->friction;
}

double stickslip_carried_mass(const Model *m, const Mode mode[N_MOVING], int s)
{
    if (!m->n.independent)
        return stickslip_part_mass_per_surface(m);
    const Mode *other = &mode[1 - s];
    if (other->slip != 0)
        return m->r.part_mass;
    return m->r.part_mass + m->r.surface_mass + (other->wall == WALL_REST ? m->r.ram_mass : 0.0);
}

double stickslip_lift_on(const Model *m, const Mode mode[N_MOVING], const double y[N_ALL], int s,
                         double tau, double normal)
{
    const int other = 1 - s;
    if (mode[other].slip != 0)
        return -m->r.mu_k * normal * mode[other].slip;
    Load l;
    load_on(m, &mode[other], y + other * N_STATES, other, tau, &l);
    return l.load + l.body * m->r.gravity;
}

void stickslip_forces(const Model *m, const Mode modes[N_MOVING], const double all[N_ALL], int s,
                      double tau, Forces *f)
{
    if (is_plain(m))
        forces_of(1, m, modes, all, s, tau, f);
    else
        forces_of(0, m, modes, all, s, tau, f);
}

/* Rate of the force on the ram without the wall's. */
static double ram_rate(const Model *m, const Mode *mode, const double y[N_STATES], int s,
                       double tau, const Forces *f)
{
    const Reals *p = &m->r;
    const double q = y[Q], u = y[U];
    return force_factor_rate(m, q, u) * stickslip_coil_current(m, y, s, tau) +
           force_factor_at(m, q) * stickslip_coil_current_rate(m, mode, y, s) -
           suspension_stiffness(m, q) * u - suspension_damper(p, f->a_q);
}

/* Rate of Load.load; *wall receives that of the wall's force. */
static double load_rate(const Model *m, const Mode *mode, const double y[N_STATES], const Forces *f,
                        double own, double *wall)
{
    const Reals *p = &m->r;
    *wall = 0.0;
    if (mode->wall == WALL_TOUCH)
        *wall = wall_force_rate(p, mode->side, penetration(m, mode, y), y[U], f->a_q);
    return flexure_force_rate(p, y[V], f->a_surface) -
           (mode->wall == WALL_REST ? 0.0 : own + *wall);
}

static double lift_rate(const Model *m, const Mode mode[N_MOVING], const double y[N_ALL], int s,
                        double tau, double normal_rate)
{
    const int other = 1 - s;
    if (mode[other].slip != 0)
        return -m->r.mu_k * normal_rate * mode[other].slip;
    const double *own = y + other * N_STATES;
    Forces f;
    double wall;
    stickslip_forces(m, mode, y, other, tau, &f);
    return load_rate(m, &mode[other], own, &f, ram_rate(m, &mode[other], own, other, tau, &f),
                     &wall);
}

void stickslip_force_rates(const Model *m, const Mode modes[N_MOVING], const double all[N_ALL],
                           int s, double tau, const Forces *f, ForceRates *rate)
{
    if (m->n.prescribed) {
        rates_on_part(m, modes, f, rate);
        return;
    }
    const Reals *p = &m->r;
    const Mode *mode = modes + s;
    const double *y = all + s * N_STATES;
    const double part = stickslip_carried_mass(m, modes, s);
    const int rest = mode->wall == WALL_REST;
    const int held = held_by_plate(m, mode);

    const double own = ram_rate(m, mode, y, s, tau, f);
    if (rest && m->n.ram_fixed) {
        rates_on_part(m, mode, f, rate);
        rate->wall = -rate->friction - own;
        return;
    }
    const double load = load_rate(m, mode, y, f, own, &rate->wall);
    const double body = rest ? p->surface_mass + p->ram_mass : p->surface_mass;
    double jerk = 0.0;

    rate->normal = f->normal > 0.0 ? p->normal_force_slope : 0.0;
    rate->plate = -p->mu_plate * rate->normal * mode->plate;
    if (mode->slip == 0) {
        if (held) {
            rate->friction = load;
            rate->plate = -load;
        } else {
            const double lift =
                m->n.independent ? lift_rate(m, modes, all, s, tau, rate->normal) : 0.0;
            jerk = (load + rate->plate + lift) / (body + part);
            rate->friction = part * jerk - rate->plate - lift;
        }
    } else {
        rate->friction = -p->mu_k * rate->normal * mode->slip;
        jerk = (load - rate->friction) / body;
        if (held)
            rate->plate = -rate->friction;
    }
    if (rest)
        rate->wall = p->ram_mass * jerk - own;
}

void stickslip_state_rates(const Model *m, const Mode modes[N_MOVING], const double all[N_ALL],
                           double tau, double rates[N_ALL])
{
    const Reals *p = &m->r;
    for (int s = 0; s < moving(m); s++) {
        const Mode *mode = modes + s;
        const double *y = all + s * N_STATES;
        double *dy = rates + s * N_STATES;
        Forces f;
        stickslip_forces(m, modes, all, s, tau, &f);
        dy[Z] = y[V];
        dy[V] = f.a_surface;
        dy[Q] = y[U];
        dy[U] = f.a_q;
        dy[D] = y[W];
        dy[W] = f.a_slip;
        dy[E_IN] = m->n.prescribed ? f.friction * y[V] : f.drive * y[U];
        dy[E_FRICTION] = -f.friction * y[W] - f.plate * (y[V] + y[W]);
        dy[E_DAMPING] = m->n.prescribed ? 0.0 : damping_power(p, y[V], y[U]);
        stickslip_source_rates(m, mode, y, s, dy);
        dy[E_IMPACT] = 0.0;
        if (mode->wall == WALL_TOUCH) {
            /* What the wall takes, less what its spring stores. */
            double spring = wall_spring(p, penetration(m, mode, y));
            dy[E_IMPACT] = -(f.wall * mode->side + spring) * mode->side * y[U];
        }
    }
}

double stickslip_wall_energy(const Model *m, const Mode *mode, const double y[N_STATES])
{
    if (mode->wall != WALL_TOUCH && mode->wall != WALL_PARTING)
        return 0.0;
    return wall_spring_energy(&m->r, penetration(m, mode, y));
}

/* With the given mass of the part, kg. */
static double energy_of_surface(const Model *m, const Mode *mode, const double y[N_STATES],
                                double part)
{
    const Reals *p = &m->r;
    const double q = y[Q], v_ram = y[V] + y[U], v_part = y[V] + y[W];
    if (m->n.prescribed)
        return part * (0.5 * v_part * v_part + p->gravity * (y[Z] + y[D]));
    const double ram = m->n.ram_fixed ? 0.0 : p->ram_mass; /* what stands on the ground has none */
    double kinetic = 0.5 * (ram * v_ram * v_ram + p->surface_mass * y[V] * y[V] +
                            part * v_part * v_part);
    double weight = p->gravity * (ram * (y[Z] + q) + p->surface_mass * y[Z] +
                                  part * (y[Z] + y[D]));
    double springs = flexure_energy(p, y[Z]) + suspension_energy(m, q);
    return kinetic + weight + springs + stickslip_wall_energy(m, mode, y);
}

double stickslip_energy_stored(const Model *m, const double y[N_ALL])
{
    if (!m->n.independent)
        return energy_of_surface(m, m->mode, y, stickslip_part_mass_per_surface(m));
    return energy_of_surface(m, m->mode, y, m->r.part_mass) +
           energy_of_surface(m, m->mode + 1, y + N_STATES, 0.0);
}
