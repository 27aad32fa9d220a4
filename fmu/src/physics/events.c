/* SPDX-License-Identifier: BSD-2-Clause */
#include "events.h"

#include <math.h>

#include "coil.h"
#include "mechanics.h"
#include "source.h"

/* A bounce that would last less than this, s, ends a Zeno sequence in resting contact. What it
 * leaves out is of the order 1e-14 J and 1e-12 m. */
static const double ZENO_FLIGHT = 1e-7;

/* m/s; a ram that meets a wall more slowly is at rest against it. */
static const double STILL = 1e-15;

/* m/s; two slips that differ by less are equal but for rounding. */
static const double SAME_SPEED = 1e-12;

/* How far an acceleration that starts a motion from rest may seem to point the wrong way, against
 * gravity and the surface's: a choice between modes must be clear; a mode once taken is kept through
 * rounding; and where a motion has just broken away, the direction is known from the event, which
 * time can resolve only so far. */
static const double CLEAR = 0.0, KEPT = 1e-12, BROKEN = 1e-6;

static int plate_acts(const Model *m)
{
    return m->r.mu_plate > 0.0;
}

static int sign(double x)
{
    return (x > 0.0) - (x < 0.0);
}

/* What rounding makes of a friction force, N: where a part needs none, what those on the ram leave. */
static double force_noise(const Forces *f)
{
    return 1e-13 * (fabs(f->friction) + f->normal + fabs(f->drive) + fabs(f->wall));
}

static int functions_of(const Model *m, const double all[N_ALL], int s, double tau,
                        EventFunction functions[MAX_EVENT_FUNCTIONS], int n)
{
    const Reals *p = &m->r;
    const Mode *mode = m->mode + s;
    const double *y = all + s * N_STATES;
    Forces f;
    ForceRates rate = {0};
    stickslip_forces(m, m->mode, all, s, tau, &f);
    if (mode->wall == WALL_REST || mode->slip == 0 || plate_acts(m)) /* else nothing looks at them */
        stickslip_force_rates(m, m->mode, all, s, tau, &f, &rate);

    const double length = 1e-15 * p->travel, force = force_noise(&f);
    const double speed = 1e-16;
#define ADD(k, v, r, e)                                                                            \
    functions[n++] =                                                                               \
        (EventFunction){.kind = k, .surface = s, .value = v, .rate = r, .noise = e}
    switch (mode->wall) {
    case WALL_FREE:
        ADD(EVENT_WALL_ABOVE, p->travel - y[Q], -y[U], length);
        ADD(EVENT_WALL_BELOW, p->travel + y[Q], y[U], length);
        break;
    case WALL_TOUCH:
    case WALL_PARTING: {
        double closing = mode->side * y[U], way = mode->wall == WALL_TOUCH ? 1.0 : -1.0;
        ADD(EVENT_WALL_LEFT, mode->side * y[Q] - p->travel, closing, length);
        ADD(EVENT_WALL_PARTING, way * (1.0 + p->contact_damping * closing),
            way * p->contact_damping * mode->side * f.a_q, 1e-15);
        break;
    }
    case WALL_REST:
        ADD(EVENT_WALL_LEFT, -mode->side * f.wall, -mode->side * rate.wall,
            1e-13 * (fabs(f.drive) + p->ram_mass * p->gravity +
                     (m->n.ram_fixed ? p->flexure_stiffness * fabs(y[Z]) : 0.0)));
        break;
    }
    if (mode->slip != 0) {
        ADD(EVENT_SLIP_ENDS, mode->slip * y[W], mode->slip * f.a_slip, speed);
    } else {
        double limit = p->mu_s * f.normal, limit_rate = p->mu_s * rate.normal;
        ADD(EVENT_SLIP_DOWN, limit - f.friction, limit_rate - rate.friction, force);
        ADD(EVENT_SLIP_UP, limit + f.friction, limit_rate + rate.friction, force);
    }
    if (plate_acts(m)) {
        double limit = p->mu_plate * f.normal, limit_rate = p->mu_plate * rate.normal;
        if (mode->plate != 0) {
            ADD(EVENT_PLATE_STOPS, mode->plate * (y[V] + y[W]),
                mode->plate * (f.a_surface + f.a_slip), speed);
        } else {
            ADD(EVENT_PLATE_DOWN, limit - f.plate, limit_rate - rate.plate, force);
            ADD(EVENT_PLATE_UP, limit + f.plate, limit_rate + rate.plate, force);
        }
    }
#undef ADD
    if (m->n.source)
        n = stickslip_source_events(m, y, s, tau, back_emf_slope(m, y, f.a_q), functions, n);
    return n;
}

int stickslip_event_functions(const Model *m, const double y[N_ALL], double tau,
                              EventFunction functions[MAX_EVENT_FUNCTIONS])
{
    int n = 0;
    for (int s = 0; s < moving(m); s++)
        n = functions_of(m, y, s, tau, functions, n);
    return n;
}

/* Newton's impact: the ram's velocity in the actuator becomes u, the momentum of ram and surface
 * stays, unless the ram stands on the ground; the part keeps its velocity. */
static void jump_to(Model *m, int s, double u)
{
    double *y = m->y + s * N_STATES;
    const double ram = m->r.ram_mass, surface = m->r.surface_mass;
    const double share = m->n.ram_fixed ? 1.0 : ram / (ram + surface);
    const double dv = m->n.ram_fixed ? -u - y[V] : -share * (u - y[U]);
    y[E_IMPACT] += 0.5 * share * surface * (y[U] * y[U] - u * u);
    y[U] = u;
    y[V] += dv;
    if (m->mode[s].plate == 0 && plate_acts(m))
        y[W] = -y[V];
    else
        y[W] -= dv;
}

/* Add dv to the surface's velocity. A free ram keeps its own. */
static void shove(Model *m, int s, double dv)
{
    m->y[s * N_STATES + V] += dv;
    if (m->mode[s].wall != WALL_REST)
        m->y[s * N_STATES + U] -= dv;
}

/* The ram comes to rest in the actuator, so gently that a sticking part goes along. */
static void stop_ram(Model *m, int s)
{
    double *y = m->y + s * N_STATES;
    if (m->mode[s].slip != 0) {
        jump_to(m, s, 0.0);
        return;
    }
    const double ram = m->r.ram_mass,
                 body = m->r.surface_mass + stickslip_carried_mass(m, m->mode, s);
    const int held = m->mode[s].plate == 0 && plate_acts(m); /* then nothing moves but the ram */
    const double share = held ? 0.0 : ram / (ram + body);
    const double loss = m->n.ram_fixed ? body : ram * (1.0 - share);
    y[E_IMPACT] += 0.5 * loss * y[U] * y[U];
    if (m->n.independent && m->mode[1 - s].slip == 0)
        shove(m, 1 - s, share * y[U]);
    else if (m->n.independent)
        m->y[(1 - s) * N_STATES + W] += share * y[U];
    y[V] = m->n.ram_fixed ? 0.0 : y[V] + share * y[U];
    y[U] = 0.0;
}

/* Acceleration with which a free ram would press into the wall of the given side. */
static double pressing(const Model *m, int s, double tau, int side)
{
    Mode free[N_MOVING] = {m->mode[0], m->mode[1]};
    Forces f;
    free[s].wall = WALL_FREE;
    stickslip_forces(m, free, m->y, s, tau, &f);
    return side * f.a_q;
}

/* The surface comes to rest, held through the part by the spring-loaded plate. */
static void stop_surface(Model *m, int s)
{
    double *y = m->y + s * N_STATES;
    y[V] = 0.0;
    if (m->n.ram_fixed)
        y[U] = 0.0;
}

static void set_wall(Model *m, int s, WallMode wall, int side)
{
    m->mode[s].wall = wall;
    m->mode[s].side = side;
}

static void set_friction(Model *m, int s, int slip, int plate)
{
    if ((m->mode[s].slip == 0) != (slip == 0))
        stickslip_count(&m->n.stick_slip_events);
    m->mode[s].slip = slip;
    m->mode[s].plate = plate;
}

static void impact(Model *m, int s, double tau, int side)
{
    double *y = m->y + s * N_STATES;
    y[Q] = side * m->r.travel;
    stickslip_count(&m->n.impacts);
    if (m->n.contact == 1) {
        set_wall(m, s, WALL_TOUCH, side);
        return;
    }
    const double closing = side * y[U], before = pressing(m, s, tau, side);
    if (2.0 * closing <= fmax(ZENO_FLIGHT * before, 2.0 * STILL)) {
        /* A ram at rest that is said to meet the wall left it and came back unseen: it rests. */
        const int unseen = closing == 0.0;
        stop_ram(m, s);
        if (before > 0.0 || unseen)
            set_wall(m, s, WALL_REST, side);
        return;
    }
    jump_to(m, s, -m->r.restitution * y[U]);
    if (m->mode[s].slip == 0)
        set_friction(m, s, sign(y[W]), m->mode[s].plate); /* the surface jumped, the part did not */
    const double after = pressing(m, s, tau, side);
    if (after >= 0.0 && 2.0 * fabs(y[U]) <= ZENO_FLIGHT * after) {
        jump_to(m, s, 0.0);
        set_wall(m, s, WALL_REST, side);
    }
}

/* Touch or rest where the free ram is at a wall and does not leave it. */
static int settle_wall(Model *m, int s, double tau)
{
    const double *y = m->y + s * N_STATES;
    if (m->mode[s].wall != WALL_FREE)
        return 0;
    for (int side = -1; side <= 1; side += 2) {
        double closing = side * y[U];
        if (m->r.travel - side * y[Q] > 0.0 || closing < 0.0)
            continue;
        if (closing > 0.0) {
            impact(m, s, tau, side);
            return 1;
        }
        if (pressing(m, s, tau, side) > KEPT * m->r.gravity) {
            set_wall(m, s, m->n.contact == 1 ? WALL_TOUCH : WALL_REST, side);
            return 1;
        }
    }
    return 0;
}

static int starts(double acceleration, double scale, double slack)
{
    return slack > 0.0 ? acceleration >= -slack * scale : acceleration > 0.0;
}

/* Beside a surface's slip a second friction has a mode: that of the spring-loaded plate or, where two
 * surfaces move by themselves, that of the other surface. There is no plate then. */
static int second_mode(const Model *m, int s)
{
    return m->n.independent ? m->mode[1 - s].slip : m->mode[s].plate;
}

static void set_frictions(Model *m, int s, int slip, int second)
{
    if (!m->n.independent) {
        set_friction(m, s, slip, second);
        return;
    }
    set_friction(m, s, slip, m->mode[s].plate);
    set_friction(m, 1 - s, second, m->mode[1 - s].plate);
}

/* Does surface s, with these modes, slip or stick as its mode says? */
static int slips_so(const Model *m, const Mode mode[N_MOVING], int s, const Forces *f, double slack)
{
    const double w = m->y[s * N_STATES + W];
    const int slip = mode[s].slip;
    if (slip == 0)
        return w == 0.0 && fabs(f->friction) <= m->r.mu_s * f->normal + force_noise(f);
    const double scale = fabs(f->a_surface) + m->r.gravity;
    return w != 0.0 ? slip == sign(w) : starts(slip * f->a_slip, scale, slack);
}

/* Are two friction modes consistent with the state and the forces that they make? */
static int consistent(const Model *m, int s, double tau, int slip, int second, double slack)
{
    Mode mode[N_MOVING] = {m->mode[0], m->mode[1]};
    Forces f;
    mode[s].slip = slip;
    if (m->n.independent)
        mode[1 - s].slip = second;
    else
        mode[s].plate = second;
    stickslip_forces(m, mode, m->y, s, tau, &f);

    if (slip == 0 && second == 0 && m->n.prescribed && f.a_surface != 0.0)
        return 0; /* the surface moves off, and takes the part from the plate or leaves it */
    if (!slips_so(m, mode, s, &f, slack))
        return 0;
    if (m->n.independent) {
        stickslip_forces(m, mode, m->y, 1 - s, tau, &f);
        return slips_so(m, mode, 1 - s, &f, slack);
    }
    if (!plate_acts(m))
        return 1;
    const double v_part = m->y[V] + m->y[W];
    if (second == 0)
        return v_part == 0.0 && fabs(f.plate) <= m->r.mu_plate * f.normal + force_noise(&f);
    return v_part != 0.0 ? second == sign(v_part)
                         : starts(second * (f.a_surface + f.a_slip),
                                  fabs(f.a_surface) + m->r.gravity, slack);
}

enum { ANY = 2 };

/* Take the first consistent mode of those asked for, sticking before slipping, as Coulomb's law has
 * it where both are possible. */
static int choose(Model *m, int s, double tau, int slip, int second, double slack)
{
    static const int ORDER[3] = {0, -1, 1};
    const int open = plate_acts(m) || m->n.independent;
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            int this_second = open ? ORDER[j] : m->mode[s].plate;
            if ((slip != ANY && slip != ORDER[i]) || (second != ANY && second != this_second) ||
                !consistent(m, s, tau, ORDER[i], this_second, slack))
                continue;
            set_frictions(m, s, ORDER[i], this_second);
            return 1;
        }
    }
    return 0;
}

/* The present mode, if it is consistent and may be kept; else another. */
static int settle_friction(Model *m, int s, double tau, int keep)
{
    const int slip = m->mode[s].slip, second = second_mode(m, s);
    if (keep && consistent(m, s, tau, slip, second, KEPT))
        return 0;
    /* If neither finds one, the state is on a boundary to the last bit, and the present mode is as
     * good as its neighbour. */
    if (!choose(m, s, tau, ANY, ANY, CLEAR))
        choose(m, s, tau, ANY, ANY, KEPT);
    return m->mode[s].slip != slip || second_mode(m, s) != second;
}

/* Break away in a given direction. The other friction keeps its mode if it can. */
static void break_slip(Model *m, int s, double tau, int slip)
{
    const int second = second_mode(m, s);
    if (!choose(m, s, tau, slip, second, BROKEN) && !choose(m, s, tau, slip, ANY, BROKEN))
        set_frictions(m, s, slip, second);
}

static void break_plate(Model *m, double tau, int plate)
{
    if (!choose(m, 0, tau, m->mode[0].slip, plate, BROKEN) &&
        !choose(m, 0, tau, ANY, plate, BROKEN))
        set_friction(m, 0, m->mode[0].slip, plate);
}

static void settle(Model *m, int s, double tau, int keep)
{
    for (int k = 0; k < moving(m); k++)
        if (m->mode[k].plate == 0 && !plate_acts(m))
            m->mode[k].plate = 1;
    /* Two passes suffice; a limit, so that rounding on a boundary cannot make an endless loop. */
    for (int pass = 0; pass < 8; pass++) {
        int changed = 0;
        for (int k = 0; k < moving(m); k++)
            changed |= settle_wall(m, k, tau);
        changed |= settle_friction(m, s, tau, keep);
        keep = 1;
        if (!changed)
            break;
    }
    for (int k = 0; k < moving(m); k++)
        stickslip_source_settle_output(m, k, tau);
}

void stickslip_settle_mode(Model *m, double tau)
{
    for (int k = 0; k < moving(m); k++)
        stickslip_source_settle_command(m, k, tau);
    settle(m, 0, tau, 1);
}

/* Where both surfaces come to stick at once, rounding must not make one of them do so alone: its
 * friction, bearing the whole part, could be too much. */
static void end_slip_of_both(Model *m, int s)
{
    const double w = m->y[s * N_STATES + W];
    if (m->mode[s].slip == 0 || fabs(w) > SAME_SPEED)
        return;
    m->y[s * N_STATES + W] = 0.0;
    shove(m, s, w);
}

void stickslip_apply_event(Model *m, int s, double tau, EventKind kind)
{
    double *y = m->y + s * N_STATES;
    const Mode before = m->mode[s];
    const int no_slip = y[W] == 0.0, no_travel = y[V] + y[W] == 0.0;
    int keep = 1;
    switch (kind) {
    case EVENT_WALL_ABOVE:
    case EVENT_WALL_BELOW:
        impact(m, s, tau, kind == EVENT_WALL_ABOVE ? 1 : -1);
        break;
    case EVENT_WALL_LEFT:
        /* Not to be settled again: it would find the ram at the wall, as near to pressing as not. */
        y[Q] = m->mode[s].side * m->r.travel;
        set_wall(m, s, WALL_FREE, 0);
        settle_friction(m, s, tau, 1);
        return;
    case EVENT_WALL_PARTING:
        /* While parted, E_IMPACT counts all that the spring holds as lost; the outputs take off
         * what it still holds. */
        if (m->mode[s].wall == WALL_TOUCH) {
            m->mode[s].wall = WALL_PARTING;
            y[E_IMPACT] += stickslip_wall_energy(m, m->mode + s, y);
        } else {
            y[E_IMPACT] -= stickslip_wall_energy(m, m->mode + s, y);
            m->mode[s].wall = WALL_TOUCH;
        }
        break;
    case EVENT_SLIP_ENDS:
        y[W] = 0.0;
        if (m->mode[s].plate == 0 && plate_acts(m) && !m->n.prescribed)
            stop_surface(m, s);
        if (m->n.independent)
            end_slip_of_both(m, 1 - s);
        keep = choose(m, s, tau, 0, second_mode(m, s), KEPT);
        break;
    case EVENT_SLIP_DOWN:
        break_slip(m, s, tau, -1);
        return;
    case EVENT_SLIP_UP:
        break_slip(m, s, tau, 1);
        return;
    case EVENT_PLATE_STOPS:
        if (m->mode[s].slip == 0)
            stop_surface(m, s);
        else
            y[W] = -y[V];
        keep = 0;
        break;
    case EVENT_PLATE_DOWN:
        break_plate(m, tau, -1);
        return;
    case EVENT_PLATE_UP:
        break_plate(m, tau, 1);
        return;
    case EVENT_COMMAND_HIGH:
    case EVENT_COMMAND_LOW:
    case EVENT_COMMAND_BACK:
    case EVENT_CURRENT_MET:
    case EVENT_OUTPUT_HIGH:
    case EVENT_OUTPUT_LOW:
        stickslip_source_apply(m, s, tau, kind);
        return;
    case N_EVENTS:
        break;
    }
    settle(m, s, tau, keep);
    /* A motion that ends at the instant of its start, and would start again, is none. */
    if (kind == EVENT_SLIP_ENDS && no_slip && m->mode[s].slip == before.slip)
        set_friction(m, s, 0, m->mode[s].plate);
    if (kind == EVENT_PLATE_STOPS && no_travel && m->mode[s].plate == before.plate)
        set_friction(m, s, m->mode[s].slip, 0);
}
