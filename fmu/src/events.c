#include "events.h"

#include <math.h>

#include "source.h"

/* A bounce that would last less than this, s, ends a Zeno sequence in resting contact. What it
 * leaves out is of the order 1e-14 J and 1e-12 m. */
static const double ZENO_FLIGHT = 1e-7;

/* m/s; a ram that meets a wall more slowly is at rest against it. */
static const double STILL = 1e-15;

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

/* What rounding makes of a friction force, N. */
static double force_noise(const Forces *f)
{
    return 1e-13 * (fabs(f->friction) + f->normal);
}

int event_functions(const Model *m, const double y[N_STATES], double tau,
                    EventFunction functions[MAX_EVENT_FUNCTIONS])
{
    const Reals *p = &m->r;
    const Mode *mode = &m->mode;
    Forces f;
    ForceRates rate;
    int n = 0;
    forces(m, mode, y, tau, &f);
    force_rates(m, mode, y, tau, &f, &rate);

    const double length = 1e-15 * p->travel, force = force_noise(&f);
    const double speed = 1e-16;
#define ADD(k, v, r, e) functions[n++] = (EventFunction){.kind = k, .value = v, .rate = r, .noise = e}
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
        n = source_events(m, y, tau, back_emf_slope(m, y, f.a_q), functions, n);
    return n;
}

/* Newton's impact: the ram's velocity in the actuator becomes u, the momentum of ram and surface
 * stays, unless the ram stands on the ground; the part keeps its velocity. */
static void jump_to(Model *m, double u)
{
    const double ram = m->r.ram_mass, surface = m->r.surface_mass;
    const double share = m->n.ram_fixed ? 1.0 : ram / (ram + surface);
    const double dv = m->n.ram_fixed ? -u - m->y[V] : -share * (u - m->y[U]);
    m->y[E_IMPACT] += 0.5 * share * surface * (m->y[U] * m->y[U] - u * u);
    m->y[U] = u;
    m->y[V] += dv;
    if (m->mode.plate == 0 && plate_acts(m))
        m->y[W] = -m->y[V];
    else
        m->y[W] -= dv;
}

/* The ram comes to rest in the actuator, so gently that a sticking part goes along. */
static void stop_ram(Model *m)
{
    if (m->mode.slip != 0) {
        jump_to(m, 0.0);
        return;
    }
    const double ram = m->r.ram_mass, body = m->r.surface_mass + part_mass_per_surface(m);
    const int held = m->mode.plate == 0 && plate_acts(m); /* then nothing moves but the ram */
    const double share = held ? 0.0 : ram / (ram + body);
    const double loss = m->n.ram_fixed ? body : ram * (1.0 - share);
    m->y[E_IMPACT] += 0.5 * loss * m->y[U] * m->y[U];
    m->y[V] = m->n.ram_fixed ? 0.0 : m->y[V] + share * m->y[U];
    m->y[U] = 0.0;
}

/* Acceleration with which a free ram would press into the wall of the given side. */
static double pressing(const Model *m, double tau, int side)
{
    Mode free = m->mode;
    Forces f;
    free.wall = WALL_FREE;
    forces(m, &free, m->y, tau, &f);
    return side * f.a_q;
}

/* The surface comes to rest, held through the part by the springed plate. */
static void stop_surface(Model *m)
{
    m->y[V] = 0.0;
    if (m->n.ram_fixed)
        m->y[U] = 0.0;
}

static void set_wall(Model *m, WallMode wall, int side)
{
    m->mode.wall = wall;
    m->mode.side = side;
}

static void set_friction(Model *m, int slip, int plate)
{
    if ((m->mode.slip == 0) != (slip == 0))
        m->n.stick_slip_events++;
    m->mode.slip = slip;
    m->mode.plate = plate;
}

static void impact(Model *m, double tau, int side)
{
    m->y[Q] = side * m->r.travel;
    m->n.impacts++;
    if (m->n.contact == 1) {
        set_wall(m, WALL_TOUCH, side);
        return;
    }
    const double closing = side * m->y[U], before = pressing(m, tau, side);
    if (2.0 * closing <= fmax(ZENO_FLIGHT * before, 2.0 * STILL)) {
        /* A ram at rest that is said to meet the wall left it and came back unseen: it rests. */
        const int unseen = closing == 0.0;
        stop_ram(m);
        if (before > 0.0 || unseen)
            set_wall(m, WALL_REST, side);
        return;
    }
    jump_to(m, -m->r.restitution * m->y[U]);
    if (m->mode.slip == 0)
        set_friction(m, sign(m->y[W]), m->mode.plate); /* the surface jumped, the part did not */
    const double after = pressing(m, tau, side);
    if (after >= 0.0 && 2.0 * fabs(m->y[U]) <= ZENO_FLIGHT * after) {
        jump_to(m, 0.0);
        set_wall(m, WALL_REST, side);
    }
}

/* Touch or rest where the free ram is at a wall and does not leave it. */
static int settle_wall(Model *m, double tau)
{
    if (m->mode.wall != WALL_FREE)
        return 0;
    for (int side = -1; side <= 1; side += 2) {
        double closing = side * m->y[U];
        if (m->r.travel - side * m->y[Q] > 0.0 || closing < 0.0)
            continue;
        if (closing > 0.0) {
            impact(m, tau, side);
            return 1;
        }
        if (pressing(m, tau, side) > KEPT * m->r.gravity) {
            set_wall(m, m->n.contact == 1 ? WALL_TOUCH : WALL_REST, side);
            return 1;
        }
    }
    return 0;
}

static int starts(double acceleration, double scale, double slack)
{
    return slack > 0.0 ? acceleration >= -slack * scale : acceleration > 0.0;
}

/* Is a friction mode (slip, plate) consistent with the state and the forces that it makes? */
static int consistent(const Model *m, double tau, int slip, int plate, double slack)
{
    Mode mode = m->mode;
    Forces f;
    mode.slip = slip;
    mode.plate = plate;
    forces(m, &mode, m->y, tau, &f);
    const double w = m->y[W], v_part = m->y[V] + m->y[W];
    const double scale = fabs(f.a_surface) + m->r.gravity;
    const double noise = force_noise(&f);

    if (slip == 0 && plate == 0 && m->n.prescribed && f.a_surface != 0.0)
        return 0; /* the surface moves off, and takes the part from the plate or leaves it */
    if (slip == 0) {
        if (w != 0.0 || fabs(f.friction) > m->r.mu_s * f.normal + noise)
            return 0;
    } else if (w != 0.0 ? slip != sign(w) : !starts(slip * f.a_slip, scale, slack)) {
        return 0;
    }
    if (!plate_acts(m))
        return 1;
    if (plate == 0)
        return v_part == 0.0 && fabs(f.plate) <= m->r.mu_plate * f.normal + noise;
    return v_part != 0.0 ? plate == sign(v_part)
                         : starts(plate * (f.a_surface + f.a_slip), scale, slack);
}

enum { ANY = 2 };

/* Take the first consistent mode of those asked for, sticking before slipping, as Coulomb's law has
 * it where both are possible. */
static int choose(Model *m, double tau, int slip, int plate, double slack)
{
    static const int ORDER[3] = {0, -1, 1};
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            int this_plate = plate_acts(m) ? ORDER[j] : m->mode.plate;
            if ((slip != ANY && slip != ORDER[i]) || (plate != ANY && plate != this_plate) ||
                !consistent(m, tau, ORDER[i], this_plate, slack))
                continue;
            set_friction(m, ORDER[i], this_plate);
            return 1;
        }
    }
    return 0;
}

/* The present mode, if it is consistent and may be kept; else another. */
static int settle_friction(Model *m, double tau, int keep)
{
    const Mode before = m->mode;
    if (keep && consistent(m, tau, before.slip, before.plate, KEPT))
        return 0;
    /* If neither finds one, the state is on a boundary to the last bit, and the present mode is as
     * good as its neighbour. */
    if (!choose(m, tau, ANY, ANY, CLEAR))
        choose(m, tau, ANY, ANY, KEPT);
    return m->mode.slip != before.slip || m->mode.plate != before.plate;
}

/* Break away in a given direction. The other friction keeps its mode if it can. */
static void break_slip(Model *m, double tau, int slip)
{
    if (!choose(m, tau, slip, m->mode.plate, BROKEN) && !choose(m, tau, slip, ANY, BROKEN))
        set_friction(m, slip, m->mode.plate);
}

static void break_plate(Model *m, double tau, int plate)
{
    if (!choose(m, tau, m->mode.slip, plate, BROKEN) && !choose(m, tau, ANY, plate, BROKEN))
        set_friction(m, m->mode.slip, plate);
}

static void settle(Model *m, double tau, int keep)
{
    if (m->mode.plate == 0 && !plate_acts(m))
        m->mode.plate = 1;
    /* Two passes suffice; a limit, so that rounding on a boundary cannot make an endless loop. */
    for (int pass = 0; pass < 8; pass++) {
        int changed = settle_wall(m, tau);
        changed |= settle_friction(m, tau, keep);
        keep = 1;
        if (!changed)
            break;
    }
    source_settle_output(m, tau);
}

void settle_mode(Model *m, double tau)
{
    source_settle_command(m, tau);
    settle(m, tau, 1);
}

void apply_event(Model *m, double tau, EventKind kind)
{
    const Mode before = m->mode;
    const int no_slip = m->y[W] == 0.0, no_travel = m->y[V] + m->y[W] == 0.0;
    int keep = 1;
    switch (kind) {
    case EVENT_WALL_ABOVE:
    case EVENT_WALL_BELOW:
        impact(m, tau, kind == EVENT_WALL_ABOVE ? 1 : -1);
        break;
    case EVENT_WALL_LEFT:
        /* Not to be settled again: it would find the ram at the wall, as near to pressing as not. */
        m->y[Q] = m->mode.side * m->r.travel;
        set_wall(m, WALL_FREE, 0);
        settle_friction(m, tau, 1);
        return;
    case EVENT_WALL_PARTING:
        /* While parted, E_IMPACT counts all that the spring holds as lost; model_outputs takes off
         * what it still holds. */
        if (m->mode.wall == WALL_TOUCH) {
            m->mode.wall = WALL_PARTING;
            m->y[E_IMPACT] += wall_energy(m, m->y);
        } else {
            m->y[E_IMPACT] -= wall_energy(m, m->y);
            m->mode.wall = WALL_TOUCH;
        }
        break;
    case EVENT_SLIP_ENDS:
        m->y[W] = 0.0;
        if (m->mode.plate == 0 && plate_acts(m) && !m->n.prescribed)
            stop_surface(m);
        keep = 0;
        break;
    case EVENT_SLIP_DOWN:
        break_slip(m, tau, -1);
        return;
    case EVENT_SLIP_UP:
        break_slip(m, tau, 1);
        return;
    case EVENT_PLATE_STOPS:
        if (m->mode.slip == 0)
            stop_surface(m);
        else
            m->y[W] = -m->y[V];
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
        source_apply(m, tau, kind);
        return;
    case N_EVENTS:
        break;
    }
    settle(m, tau, keep);
    /* A motion that ends at the instant of its start, and would start again, is none. */
    if (kind == EVENT_SLIP_ENDS && no_slip && m->mode.slip == before.slip)
        set_friction(m, 0, m->mode.plate);
    if (kind == EVENT_PLATE_STOPS && no_travel && m->mode.plate == before.plate)
        set_friction(m, m->mode.slip, 0);
}
