/* The steps of WIDTH lanes side by side, for each kind of processor: lanes2.c, lanes4.c and lanes8.c
 * include this with WIDTH, INLINE and RUN defined. Without branches between lanes, and without
 * contraction, each width gives the same bits.
 *
 * Moreau's time stepping with the midpoint rule: of second order, since what is not smooth is either
 * linear within a step (the current at its limits) or solved for at its end (friction), and since
 * steps end where the command jumps. */

#include <math.h>
#include <string.h>

#include "stepper.h"

/* WIDTH numbers, and as many masks: all bits or none. */
typedef double Wide __attribute__((vector_size(8 * WIDTH)));
typedef int64_t Mask __attribute__((vector_size(8 * WIDTH)));

INLINE Wide choose(Mask mask, Wide a, Wide b) { return (Wide)((mask & (Mask)a) | (~mask & (Mask)b)); }
INLINE Wide least(Wide a, Wide b) { return choose(a < b, a, b); }
INLINE Wide most(Wide a, Wide b) { return choose(a > b, a, b); }
INLINE Wide within(Wide x, Wide bound) { return least(most(x, -bound), bound); }

INLINE Wide root(Wide x)
{
    Wide y;
    for (int l = 0; l < WIDTH; l++)
        y[l] = sqrt(x[l]);
    return y;
}

typedef struct {
    Wide t, z, v, y, r, x, w, p, s; /* time; heights and velocities of surface, ram, part, plate */
    Wide i;                         /* current of the coil */
    Wide slip;                      /* sign of the part's slip on the surface, 0 while it sticks */
    Wide jump;                      /* when the command drops next */
} State;

/* Friction of the surface (first) and the plate (second) on the part, as impulses. Both are set-valued:
 * at most `bound` and `held`; the second follows from the first. */
typedef struct {
    Wide part, surface, plate; /* velocities without friction */
    Wide a, b, d;              /* by which an impulse changes them: 1/mass */
    Wide both, alone, second;  /* 1/(resistance to an impulse) */
    Wide held;                 /* greatest impulse of the plate */
} Contact;

INLINE Wide of_surface(const Contact *c, Wide bound, Wide *plate)
{
    /* The part resting on the plate, else the plate at its bound: the problem is monotone. */
    const Wide share = c->a * c->second;
    const Wide resting =
        within((c->surface - c->part + share * (c->part - c->plate)) * c->both, bound);
    const Wide wanted = -(c->part - c->plate + c->a * resting) * c->second;
    *plate = within(wanted, c->held);
    const Wide rubbing = within((c->surface - c->part - c->a * *plate) * c->alone, bound);
    return choose(*plate == wanted, resting, rubbing);
}

/* One step of all lanes, whose plate is moving or stands on the ground. It ends at `edge`, or where
 * the command jumps, if that lies between `low` and `high`. i0 and i1 give the current at both ends
 * where it is measured. */
INLINE void step(const Wide p[N_ALL], State *m, double low, double edge,
                 double high, int moving, int measured, double i0, double i1)
{
    const Wide zero = {0}, one = zero + 1.0;
    const Wide start = p[START], jump = m->jump, t = m->t;
    Wide end = choose((start > low) & (start <= high), start, zero + edge);
    const Mask drops = jump <= high;
    end = choose(drops, most(jump, 0.5 * (t + low)), end);
    const Wide h = end - t, half = 0.5 * h;

    /* The coil. What it can reach within the step lies between `lowest` and `highest`. */
    const Wide v = m->v, r = m->r, u = r - v, i = m->i;
    Wide now, mean;
    if (measured) {
        now = zero + i1;
        mean = zero + 0.5 * (i0 + i1);
    } else {
        const Mask on = t + half > start;
        const Wide gain = 1.0 / p[SENSE_RESISTANCE], limit = p[CURRENT_LIMIT];
        const Wide slope = p[AMPLITUDE] * p[FREQUENCY];
        const Wide v1 = p[OFFSET] + 0.5 * p[AMPLITUDE] - slope * (jump - t);
        const Wide target0 = choose(on, within(gain * v1, limit), zero);
        const Wide target1 = choose(on, within(gain * (v1 + slope * h), limit), zero);
        const Wide drop = half * (p[RESISTANCE] + p[SENSE_RESISTANCE]);
        const Wide inverse = 1.0 / (p[INDUCTANCE] + drop);
        const Wide own = (p[INDUCTANCE] - drop) * i - h * p[FORCE_FACTOR] * u;
        const Wide highest = (own + h * p[OUTPUT_HIGH]) * inverse;
        const Wide lowest = (own + h * p[OUTPUT_LOW]) * inverse;
        now = least(most(target1, lowest), highest);
        /* On its way at the limit until it meets its target, then with it. */
        const Wide gap = target0 - i;
        const Wide closing = choose(gap > 0.0, highest, lowest) - i - (target1 - target0);
        const Wide share = choose(gap == 0.0, zero, least(most(gap / closing, zero), one));
        const Wide met = target0 + share * (target1 - target0);
        const Wide meeting = 0.5 * (share * (i + met) + (1.0 - share) * (met + target1));
        mean = choose(now == target1, meeting, 0.5 * (i + now));
    }

    /* Forces on the ram in the middle of the step, the dampers' as a coefficient. */
    const Wide zm = m->z + half * v, ym = m->y + half * r, q = ym - zm;
    const Wide up = most(q - p[TRAVEL_UP], zero), down = most(-q - p[TRAVEL_DOWN], zero);
    const Wide damping = p[WALL_DAMPING];
    Wide above = p[WALL_UP] * up * root(up), below = p[WALL_DOWN] * down * root(down);
    above = choose(1.0 + damping * u > 0.0, above, zero); /* a wall does not pull */
    below = choose(1.0 - damping * u > 0.0, below, zero);
    const Wide force = p[FORCE_FACTOR] * mean + below - above -
                       q * (p[SUSPENSION_K1] + q * (p[SUSPENSION_K2] + q * p[SUSPENSION_K3]));
    const Wide c = half * (p[SUSPENSION_DAMPING] + damping * (above + below));

    /* Velocities without friction: of the surface with the ram eliminated. */
    const Wide ram = p[RAM_MASS], body = p[SURFACE_MASS], g = p[GRAVITY];
    const Wide flexure = half * p[FLEXURE_DAMPING];
    const Wide inverse_ram = 1.0 / (ram + c);
    const Wide on_ram = ram * r + h * (force - ram * g) - c * u;
    const Wide on_body =
        body * v - h * (force + p[FLEXURE_STIFFNESS] * zm + body * g) + c * u - flexure * v;
    const Wide mass = body + flexure + c * ram * inverse_ram;
    const Wide pm = m->p + half * m->s;

    Contact k;
    k.a = 1.0 / p[PART_MASS];
    k.b = 1.0 / mass;
    k.part = m->w - h * g;
    k.surface = (on_body + c * inverse_ram * on_ram) * k.b;
    k.alone = 1.0 / (k.a + k.b);
    if (moving) {
        const Wide damper = half * p[PLATE_DAMPING];
        k.d = 1.0 / (p[PLATE_MASS] + damper);
        k.plate = k.d * ((p[PLATE_MASS] - damper) * m->s - h * p[PLATE_STIFFNESS] * pm);
        k.second = 1.0 / (k.a + k.d);
        k.both = 1.0 / (k.b + k.a * k.d * k.second);
    } else {
        k.d = k.plate = zero;
        k.second = p[PART_MASS];
        k.both = mass;
    }
    const Wide normal = h * p[NORMAL_FORCE];
    k.held = normal * p[MU_PLATE];

    /* Sticking takes µ_s; who slips sticks once the slip has come to rest within the step. */
    const Wide loose = normal * p[MU_K], firm = normal * p[MU_S];
    Wide plate_slip, plate_stick;
    const Wide slipping = of_surface(&k, loose, &plate_slip);
    const Wide sticking = of_surface(&k, firm, &plate_stick);
    const Mask goes_on = m->slip * slipping == -loose;
    const Mask sticks = (sticking < firm) & (sticking > -firm) & ~goes_on;
    const Wide impulse = choose(sticks, sticking, slipping);
    const Wide plate = choose(sticks, plate_stick, plate_slip);

    const Wide v1 = k.surface - k.b * impulse, r1 = (on_ram + c * v1) * inverse_ram;
    const Wide w1 = k.part + k.a * (impulse + plate), s1 = k.plate - k.d * plate;
    m->x += half * (m->w + w1);
    m->z = zm + half * v1;
    m->y = ym + half * r1;
    m->p = moving ? pm + half * s1 : zero;
    m->v = v1;
    m->r = r1;
    m->w = w1;
    m->s = moving ? s1 : zero;
    m->i = now;
    m->slip = choose(sticks, zero, choose(slipping > 0.0, -one, one));
    m->t = end;
    m->jump = choose(drops, jump + 1.0 / p[FREQUENCY], jump);
}

RUN(const Schedule *c, const Parameters all, const Rest *rest, int from, double *out)
{
    Wide p[N_ALL];
    for (int k = 0; k < N_ALL; k++)
        memcpy(p + k, all[k] + from, sizeof *p);
    State m;
    memset(&m, 0, sizeof m);
    m.t += -(double)rest->steps * c->edges[1];
    memcpy(&m.z, rest->surface + from, sizeof m.z);
    memcpy(&m.y, rest->ram + from, sizeof m.y);
    memcpy(&m.p, rest->plate + from, sizeof m.p);
    memcpy(&m.jump, rest->jump + from, sizeof m.jump);
    m.x = m.z;
    const int moving = all[PLATE_MASS][0] > 0.0;
    for (int64_t k = -rest->steps; k <= c->steps; k++) {
        const double edge = chain_edge(c, k);
        if (k > -rest->steps) {
            const double low = 0.5 * (chain_edge(c, k - 1) + edge);
            const double high = 0.5 * (edge + chain_edge(c, k + 1));
            const double i1 = c->current ? c->current[k < 0 ? 0 : k] : 0.0;
            const double i0 = c->current ? c->current[k < 1 ? 0 : k - 1] : 0.0;
            if (!c->current && !moving)
                step(p, &m, low, edge, high, 0, 0, i0, i1);
            else if (!c->current)
                step(p, &m, low, edge, high, 1, 0, i0, i1);
            else if (!moving)
                step(p, &m, low, edge, high, 0, 1, i0, i1);
            else
                step(p, &m, low, edge, high, 1, 1, i0, i1);
        }
        if (k < 0 || c->sample[k] < 0)
            continue;
        /* Where a jump has moved the step's end, the sample is a little apart. */
        const Wide late = edge - m.t;
        const Wide shown[N_OUTPUTS] = {m.z + late * m.v, m.v, m.x + late * m.w, m.w,
                                       m.p + late * m.s};
        double *row = out + (int64_t)c->sample[k] * N_OUTPUTS * LANES + from;
        for (int n = 0; n < N_OUTPUTS; n++)
            memcpy(row + n * LANES, shown + n, sizeof *shown);
    }
}
