/* The steps of WIDTH lanes side by side, for each kind of processor: lanes2.c, lanes4.c and lanes8.c
 * include this with WIDTH, INLINE and FUNCTION defined, and LEAST, MOST and ANY where the processor has
 * one instruction for what compilers make four of. No lane's numbers depend on another's, and nothing is
 * contracted, so each width gives the same bits.
 *
 * Moreau's time stepping with the midpoint rule. What is not smooth is either linear within a step
 * (the current at its limits) or solved for at its end (friction), and steps end where the command
 * jumps. Friction that turns within a step would leave an error of first order, so steps are divided
 * there, and where the ram begins to press on a damped wall. */

#include <string.h>

#include "stepper.h"

#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC optimize("schedule-insns") /* or nothing is computed while a group waits: see follow */
#endif

/* WIDTH numbers, and as many masks: all bits or none. */
typedef double Wide __attribute__((vector_size(8 * WIDTH)));
typedef int64_t Mask __attribute__((vector_size(8 * WIDTH)));

INLINE Wide choose(Mask mask, Wide a, Wide b) { return (Wide)((mask & (Mask)a) | (~mask & (Mask)b)); }
#ifndef LEAST /* the second where the two are equal, or one is no number: so do the instructions */
#define LEAST(a, b) choose((a) < (b), a, b)
#define MOST(a, b) choose((a) > (b), a, b)
#endif
INLINE Wide least(Wide a, Wide b) { return LEAST(a, b); }
INLINE Wide most(Wide a, Wide b) { return MOST(a, b); }
INLINE Wide within(Wide x, Wide bound) { return least(most(x, -bound), bound); }

INLINE int any(Mask mask)
{
#ifdef ANY
    return ANY(mask);
#else
    int64_t found = 0;
    for (int l = 0; l < WIDTH; l++)
        found |= mask[l];
    return found != 0;
#endif
}

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
    Wide jump;                      /* when the line of the command ends */
    Wide top, slope;                /* V1 at its end, V, and its slope, V/s */
    Wide line;                      /* its number */
    Wide rate;                      /* of the ram over the surface, mean of the last step, m/s^2 */
} State;

/* Friction of the surface (first) and the plate (second) on the part, as impulses. Both are set-valued:
 * at most `bound` and `held`; the second follows from the first. */
typedef struct {
    Wide part, surface, plate; /* velocities without friction */
    Wide a, b, d;              /* by which an impulse changes them: 1/mass */
    Wide both, alone, second;  /* 1/(resistance to an impulse) */
    Wide loose, held;          /* impulse of the surface while it slips; greatest of the plate */
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

/* As the FMU numbers the laws of the suspension. What a lane's law does not have becomes 0, so that
 * the sum of all laws is that lane's own. Whether any lane has more than the cubic. */
INLINE int choose_laws(Wide p[N_ALL])
{
    const Wide zero = {0}, law = p[SUSPENSION];
    p[SUSPENSION_K1] = choose(law == 3.0, zero, p[SUSPENSION_K1]);
    p[SUSPENSION_K2] = choose(law == 1.0, p[SUSPENSION_K2], zero);
    p[SUSPENSION_K3] = choose(law == 1.0, p[SUSPENSION_K3], zero);
    p[SUSPENSION_HARDENING] = choose(law == 2.0, p[SUSPENSION_HARDENING], zero);
    p[SUSPENSION_REPULSION] = choose(law == 3.0, p[SUSPENSION_REPULSION], zero);
    for (int l = 0; l < WIDTH; l++)
        if (law[l] != 1.0)
            return 1;
    return 0;
}

/* The force that lifts the ram below a knee and above magnets, N. */
INLINE Wide lift_of(const Wide p[N_ALL], Wide q)
{
    const Wide below = most(p[SUSPENSION_KNEE] - q, (Wide){0});
    const Wide place = most(q, -p[TRAVEL_DOWN]), share = 1.0 + place / p[SUSPENSION_DISTANCE];
    const Wide force = p[SUSPENSION_REPULSION] / (share * share * share);
    const Wide slope = 3.0 * force / (share * p[SUSPENSION_DISTANCE]);
    return p[SUSPENSION_HARDENING] * below * below + (force - slope * (q - place));
}

/* Where a step is worth two: where the part turns, not as early in it as EARLY; and where the ram goes
 * on by a share DEEP of its depth in a wall whose damper presses DAMPED times as hard as its spring. But
 * nowhere if the step, times the wall's frequency by its secant, is over SOFT when squared: steps of one
 * length keep the energy of a bounce. */
#define EARLY 0.05
#define DEEP 0.3
#define DAMPED 0.5
#define SOFT 0.1

/* What is left by rounding of the speed of a part that rests on the plate is less, m/s. */
#define REST 1e-10

/* What acted within a step. */
typedef struct {
    Wide current;         /* mean, A */
    Wide high, low;       /* share of the step that the output was at its highest, lowest */
    Wide limited;         /* share at the current limit */
    Wide friction, plate; /* impulses of surface and plate on the part, N s */
    Wide wall, wall_damping; /* force of the walls' springs, down, N; their dampers, N s/m */
    Mask drops;              /* the line of the command has ended */
    Mask turns, hits, hard;  /* the part may turn; the ram begins to press on a wall; that is stiff */
    Contact contact;
} Effect;

/* A step ends at `edge`, or where the command jumps, if that lies between `low` and `high`; s. */
typedef struct {
    double low, edge, high;
    int lifted;     /* as choose_laws() has it */
    int moving;     /* whether the plate moves, or stands on the ground */
    int measured;   /* whether the current is given; then no effect has limits */
    double current; /* A, at `edge`, where it is given */
} Step;

/* One step of all lanes from `m` to `then`: the share `*made` of it, or all where that is NULL. What of
 * the effect nobody reads costs nothing. */
INLINE void step(const Wide p[N_ALL], const State *m, State *then, const Step *c, const Wide *made,
                 Effect *effect)
{
    const Wide zero = {0}, one = zero + 1.0;
    const Wide start = p[START], jump = m->jump, t = m->t;
    Wide end = choose((start > c->low) & (start <= c->high), start, zero + c->edge);
    const Mask drops = jump <= c->high;
    end = choose(drops, most(jump, 0.5 * (t + c->low)), end);
    if (made)
        end = choose(*made < 1.0, t + *made * (end - t), end);
    const Wide h = end - t, half = 0.5 * h;

    /* The coil. What it can reach within the step lies between `lowest` and `highest`. */
    const Wide v = m->v, r = m->r, u = r - v, i = m->i;
    Wide now, mean;
    if (c->measured) {
        now = zero + c->current;
        if (made)
            now = choose(*made < 1.0, i + *made * (now - i), now);
        mean = 0.5 * (i + now);
    } else {
        const Mask on = t + half > start;
        const Wide gain = 1.0 / p[SENSE_RESISTANCE], limit = p[CURRENT_LIMIT];
        const Wide slope = m->slope;
        const Wide v1 = m->top - slope * (jump - t);
        const Wide target0 = choose(on, within(gain * v1, limit), zero);
        const Wide target1 = choose(on, within(gain * (v1 + slope * h), limit), zero);
        const Wide drop = half * (p[RESISTANCE] + p[SENSE_RESISTANCE]);
        /* By `bend` the decay is a Padé approximant of fourth order, and its mean that of a parabola. */
        const Wide bend = drop * (1.0 / (3.0 * p[INDUCTANCE]));
        const Wide inductance = p[INDUCTANCE] + bend * drop, inverse = 1.0 / (inductance + drop);
        const Wide own =
            (inductance - drop) * i - h * p[FORCE_FACTOR] * (u + half * m->rate);
        const Wide highest = (own + h * p[OUTPUT_HIGH]) * inverse;
        const Wide lowest = (own + h * p[OUTPUT_LOW]) * inverse;
        now = least(most(target1, lowest), highest);
        /* On its way at the limit until it meets its target, then with it. */
        const Wide gap = target0 - i;
        const Wide closing = choose(gap > 0.0, highest, lowest) - i - (target1 - target0);
        const Wide share = choose(gap == 0.0, zero, least(most(gap / closing, zero), one));
        const Wide met = target0 + share * (target1 - target0);
        const Wide meeting = 0.5 * (share * (i + met) + (1.0 - share) * (met + target1));
        mean = choose(now == target1, meeting, 0.5 * (i + now + bend * (now - i)));
        const Wide clamped = choose(now == target1, share, one);
        effect->high = choose((now < target1) | ((now == target1) & (gap > 0.0)), clamped, zero);
        effect->low = clamped - effect->high;
        const Wide asked = gain * (v1 + half * slope);
        effect->limited = choose(on & ((asked > limit) | (asked < -limit)), one - clamped, zero);
    }
    effect->current = mean;

    /* Forces on the ram in the middle of the step, the dampers' as a coefficient. */
    const Wide zm = m->z + half * v, ym = m->y + half * r, q = ym - zm;
    const Wide up = most(q - p[TRAVEL_UP], zero), down = most(-q - p[TRAVEL_DOWN], zero);
    const Wide damping = p[WALL_DAMPING];
    Wide above = p[WALL_UP] * up * root(up), below = p[WALL_DOWN] * down * root(down);
    above = choose(1.0 + damping * u > 0.0, above, zero); /* a wall does not pull */
    below = choose(1.0 - damping * u > 0.0, below, zero);
    Wide force = p[FORCE_FACTOR] * mean + below - above -
                 q * (p[SUSPENSION_K1] + q * (p[SUSPENSION_K2] + q * p[SUSPENSION_K3]));
    if (c->lifted)
        force += lift_of(p, q);
    const Wide d = half * (p[SUSPENSION_DAMPING] + damping * (above + below));
    effect->wall = above - below;
    effect->wall_damping = damping * (above + below);

    /* Velocities without friction: of the surface with the ram eliminated. */
    const Wide ram = p[RAM_MASS], body = p[SURFACE_MASS], g = p[GRAVITY];
    const Wide flexure = half * p[FLEXURE_DAMPING];
    const Wide inverse_ram = 1.0 / (ram + d);
    const Wide on_ram = ram * r + h * (force - ram * g) - d * u;
    const Wide on_body =
        body * v - h * (force + p[FLEXURE_STIFFNESS] * zm + body * g) + d * u - flexure * v;
    const Wide mass = body + flexure + d * ram * inverse_ram;
    const Wide pm = m->p + half * m->s;

    Contact k;
    k.a = 1.0 / p[PART_MASS];
    k.b = 1.0 / mass;
    k.part = m->w - h * g;
    k.surface = (on_body + d * inverse_ram * on_ram) * k.b;
    k.alone = 1.0 / (k.a + k.b);
    if (c->moving) {
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
    k.loose = normal * p[MU_K];

    /* Sticking takes µ_s; who slips sticks once the slip has come to rest within the step. */
    const Wide loose = k.loose, firm = normal * p[MU_S];
    Wide plate_slip, plate_stick;
    const Wide slipping = of_surface(&k, loose, &plate_slip);
    const Wide sticking = of_surface(&k, firm, &plate_stick);
    const Mask goes_on = m->slip * slipping == -loose;
    const Mask sticks = (sticking < firm) & (sticking > -firm) & ~goes_on;
    const Wide impulse = choose(sticks, sticking, slipping);
    const Wide plate = choose(sticks, plate_stick, plate_slip);
    effect->friction = impulse;
    effect->plate = plate;
    const Wide slip = choose(sticks, zero, choose(slipping > 0.0, -one, one));
    const Wide on = m->w - m->s, deep = up + down, speed = most(u, -u);
    effect->turns = ((m->slip != zero) & (slip != m->slip)) |
                    (((on > REST) | (on < -REST)) & (plate != choose(on > zero, -k.held, k.held)));
    effect->hits = (deep > zero) & (h * speed > DEEP * deep) & (damping * speed > DAMPED);
    effect->hard = h * h * (above + below) > SOFT * ram * deep;
    effect->contact = k;

    const Wide v1 = k.surface - k.b * impulse, r1 = (on_ram + d * v1) * inverse_ram;
    const Wide w1 = k.part + k.a * (impulse + plate), s1 = k.plate - k.d * plate;
    then->x = m->x + half * (m->w + w1);
    then->z = zm + half * v1;
    then->y = ym + half * r1;
    then->p = c->moving ? pm + half * s1 : zero;
    then->v = v1;
    then->r = r1;
    then->w = w1;
    then->s = c->moving ? s1 : zero;
    then->i = now;
    then->slip = slip;
    then->t = end;
    then->jump = jump;
    then->top = m->top;
    then->slope = m->slope;
    then->line = m->line;
    then->rate = (r1 - v1 - u) / h;
    effect->drops = drops;
}

/* By what share of a step from `m` the part, with the friction it had at the begin, comes to rest on the
 * plate or, if it slips, on the surface; 1 where it does not. The plate's impulse was `plate` by the state
 * at the end. */
INLINE Wide turning(const State *m, const Contact *c, Wide plate)
{
    const Wide zero = {0}, one = zero + 1.0;
    const Wide on = m->w - m->s, off = m->v - m->w; /* velocities over the plate, under the surface */
    const Wide against = choose(on > zero, -c->held, c->held);
    const Wide rubbing = within((c->surface - c->part - c->a * against) * c->alone, c->loose);
    const Wide then = c->part + c->a * (rubbing + against) - (c->plate - c->d * against);
    const Wide on_plate = choose((on * then < zero) & (plate != against), on / (on - then), one);

    const Wide goes_on = -m->slip * c->loose;
    const Wide held = within((c->plate - c->part - c->a * goes_on) * c->second, c->held);
    const Wide left = c->surface - c->b * goes_on - (c->part + c->a * (goes_on + held));
    const Wide on_surface =
        choose((m->slip != zero) & (off * left < zero), off / (off - left), one);
    return least(on_plate, on_surface);
}

/* The share after which a step from `m` is better divided; 1: nowhere. */
INLINE Wide divide(const State *m, const Effect *e)
{
    const Wide one = (Wide){0} + 1.0;
    Wide share = turning(m, &e->contact, e->plate);
    share = choose(share < EARLY, one, share);
    share = choose(e->hits & (share == one), 0.5 * one, share);
    return choose(e->hard | e->drops, one, share);
}

/* ---- the runs of scenes ---- */

typedef struct {
    Wide x_settle, x_end;                        /* height of the part, m */
    Wide i_end;                                  /* current of the coil, A */
    Wide sticking, high, low, limited;           /* s after settling: in sticking, at each limit */
    Wide v_max, v_min, z_max, z_min;             /* of the surface after settling */
    Wide i_max, i_min;                           /* of the coil after settling */
    Wide coil, copper, friction, impact, damping; /* J, done or lost since the start */
} Sums;

_Static_assert(sizeof(State) == N_STATE * sizeof(Wide), "a state is N_STATE numbers");
_Static_assert(sizeof(Sums) == N_SUMS * sizeof(Wide), "the sums are N_SUMS numbers");

/* A quantity at a time `late` after the step's end (before it: negative), within the step, of its
 * value and rate there and its rate's slope. */
INLINE Wide read(Wide value, Wide rate, Wide slope, Wide late)
{
    return value + late * (rate + 0.5 * late * slope);
}

/* What the step from `a` to `b`, until `until` (s), takes in energy. */
INLINE void add_energies(const Wide p[N_ALL], const State *a, const State *b, const Effect *e,
                         Wide until, Sums *sum)
{
    const Wide zero = {0}, h = choose(b->t <= until, b->t - a->t, zero);
    const Wide v = 0.5 * (a->v + b->v), u = 0.5 * (a->r + b->r) - v, w = 0.5 * (a->w + b->w);
    const Wide rise = b->i - a->i, square = u * u;
    sum->coil += h * p[FORCE_FACTOR] * e->current * u;
    sum->copper += h * (p[RESISTANCE] + p[SENSE_RESISTANCE]) *
                   (e->current * e->current + rise * rise * (1.0 / 12.0));
    sum->friction += choose(h > zero, e->friction * (v - w) - e->plate * w, zero);
    /* A ram that leaves a wall faster than its spring unbends leaves the spring's energy there. */
    sum->impact += h * (e->wall * u + e->wall_damping * square);
    sum->damping += h * (p[FLEXURE_DAMPING] * v * v + p[SUSPENSION_DAMPING] * square);
}

/* What the step adds to times and extremes after settling. */
INLINE void add_settled(const State *a, const State *b, const Effect *e, Wide settle, Wide until,
                        Sums *sum)
{
    const Wide zero = {0};
    const Wide counted = most(least(b->t, until) - most(a->t, settle), zero); /* s */
    const Mask counts = counted > zero;
    sum->sticking += choose(b->slip == zero, counted, zero);
    sum->high += counted * e->high;
    sum->low += counted * e->low;
    sum->limited += counted * e->limited;
    sum->v_max = choose(counts, most(b->v, sum->v_max), sum->v_max);
    sum->v_min = choose(counts, least(b->v, sum->v_min), sum->v_min);
    sum->z_max = choose(counts, most(b->z, sum->z_max), sum->z_max);
    sum->z_min = choose(counts, least(b->z, sum->z_min), sum->z_min);
    sum->i_max = choose(counts, most(b->i, sum->i_max), sum->i_max);
    sum->i_min = choose(counts, least(b->i, sum->i_min), sum->i_min);
}

/* What is asked for where settling or the run ends, if it does within the step. */
INLINE void note_ends(const State *a, const State *b, Wide settle, Wide until, Sums *sum)
{
    const Wide per = 1.0 / (b->t - a->t), slope = (b->w - a->w) * per;
    sum->x_settle = choose((a->t <= settle) & (b->t > settle),
                           read(b->x, b->w, slope, settle - b->t), sum->x_settle);
    const Mask ends = (a->t <= until) & (b->t > until);
    sum->x_end = choose(ends, read(b->x, b->w, slope, until - b->t), sum->x_end);
    sum->i_end = choose(ends, b->i + (until - b->t) * (b->i - a->i) * per, sum->i_end);
}

/* A row of the first lane at a time `late` after the end of the step from `a` to `b`; forces and
 * accelerations are their means over the step. */
INLINE void write_row(const Wide p[N_ALL], const State *a, const State *b, const Effect *e,
                      Wide late, double row[N_COLUMNS])
{
    const Wide per = 1.0 / (b->t - a->t);
    const Wide surface = (b->v - a->v) * per, ram = (b->r - a->r) * per, part = (b->w - a->w) * per;
    const Wide rise = (b->i - a->i) * per, i = b->i + late * rise;
    const Wide v = b->v + late * surface, r = b->r + late * ram;
    const Wide emf = p[FORCE_FACTOR] * (r - v);
    row[ROW_CURRENT] = i[0];
    row[ROW_COIL_VOLTAGE] = (p[RESISTANCE] * i + p[INDUCTANCE] * rise + emf)[0];
    row[ROW_BACK_EMF] = emf[0];
    row[ROW_Z_SURFACE] = read(b->z, b->v, surface, late)[0];
    row[ROW_V_SURFACE] = v[0];
    row[ROW_A_SURFACE] = surface[0];
    row[ROW_Z_RAM] = read(b->y, b->r, ram, late)[0];
    row[ROW_V_RAM] = r[0];
    row[ROW_Z_PART] = read(b->x, b->w, part, late)[0];
    row[ROW_V_PART] = (b->w + late * part)[0];
    row[ROW_FRICTION_FORCE] = (e->friction * per)[0];
    row[ROW_STICKING] = b->slip[0] == 0.0;
}

/* Where a line has ended, the next one begins. */
INLINE void pass_corners(const Drive *drives, const Wide p[N_ALL], Mask drops, State *m)
{
    if (!any(drops))
        return;
    for (int l = 0; l < WIDTH; l++) {
        if (!drops[l])
            continue;
        double end, top, slope;
        drive_line(drives + l, m->line[l] += 1.0, p[FREQUENCY][l], p[PHASE][l], &end, &top, &slope);
        m->jump[l] = end;
        m->top[l] = top;
        m->slope[l] = slope;
    }
}

/* When settling and the run end in some lanes, s; what is to be noted of the step at hand. */
typedef struct {
    Wide settle, until;
    int settled, ends;
} Notes;

INLINE void note(const Wide p[N_ALL], const State *a, const State *b, const Effect *e,
                 const Notes *notes, Sums *sum)
{
    add_energies(p, a, b, e, notes->until, sum);
    if (notes->settled)
        add_settled(a, b, e, notes->settle, notes->until, sum);
    if (notes->ends)
        note_ends(a, b, notes->settle, notes->until, sum);
}

/* A step of all lanes from `before` to `m`, in two where that is better; then a lane's `before` and the
 * effect's friction are those of its last. */
INLINE void advance(const Wide p[N_ALL], State *before, State *m, const Step *c, const Notes *notes,
                    Effect *e, Sums *sum)
{
    step(p, before, m, c, NULL, e);
    Wide share = {0};
    if (any(e->turns | e->hits))
        share = divide(before, e);
    else
        share += 1.0;
    const Mask divided = share < 1.0, drops = e->drops;
    if (!any(divided)) {
        if (notes)
            note(p, before, m, e, notes, sum);
        return;
    }
    State middle;
    step(p, before, &middle, c, &share, e);
    if (notes)
        note(p, before, &middle, e, notes, sum);
    const Wide friction = e->friction;
    step(p, &middle, m, c, NULL, e);
    for (int k = 0; k < N_STATE; k++) { /* lanes that are not divided are there already */
        Wide *then = (Wide *)before + k, *now = (Wide *)m + k;
        const Wide between = ((const Wide *)&middle)[k];
        *now = choose(divided, *now, between);
        *then = choose(divided, between, *then);
    }
    if (notes)
        note(p, &middle, m, e, notes, sum);
    e->friction = choose(divided, e->friction, friction);
    e->drops = drops;
}

/* As many groups of WIDTH lanes, step by step in turn: while one waits for its quotients, the other
 * is computed. */
INLINE void follow(const Stretch *c, const Parameters all, const Span *span, const int groups,
                   Kept *kept, double *out)
{
    Wide p[LANES / WIDTH][N_ALL];
    Notes notes[LANES / WIDTH];
    State states[2][LANES / WIDTH]; /* before a step and after it, in turn */
    State *before, *m = states[(c->first + 1) & 1];
    Sums sum[LANES / WIDTH];
    Effect e[LANES / WIDTH];
    double settled = INFINITY, all_settled = 0.0, ended = INFINITY;
    int lifted = 0;
    for (int g = 0, from = 0; g < groups; g++, from += WIDTH) {
        for (int k = 0; k < N_ALL; k++)
            memcpy(p[g] + k, all[k] + from, sizeof(Wide));
        lifted |= choose_laws(p[g]);
        memcpy(&notes[g].settle, span->settle + from, sizeof(Wide));
        memcpy(&notes[g].until, span->until + from, sizeof(Wide));
        for (int k = 0; k < N_STATE; k++)
            memcpy((Wide *)(m + g) + k, kept->state[k] + from, sizeof(Wide));
        for (int k = 0; k < N_SUMS; k++)
            memcpy((Wide *)(sum + g) + k, kept->sums[k] + from, sizeof(Wide));
        for (int l = 0; l < WIDTH; l++) {
            settled = fmin(settled, notes[g].settle[l]);
            all_settled = fmax(all_settled, notes[g].settle[l]);
            ended = fmin(ended, notes[g].until[l]);
        }
    }
    int64_t sample = 0;
    for (int64_t k = c->first + 1; k <= c->last; k++) {
        const double edge = (double)k * c->step, half = 0.5 * c->step;
        before = states[k & 1], m = states[(k + 1) & 1];
        /* No step ends further than a half one from its edge. */
        const int late = edge + c->step > settled;
        const int ends = (late && edge - 2.0 * c->step < all_settled) || edge + c->step > ended;
#pragma GCC unroll 4
        for (int g = 0; g < groups; g++) {
            notes[g].settled = late;
            notes[g].ends = ends;
            const Step each = {edge - half, edge, edge + half, lifted, 0, 0, 0.0};
            advance(p[g], before + g, m + g, &each, notes + g, e + g, sum + g);
            pass_corners(c->drives + g * WIDTH, p[g], e[g].drops, m + g);
        }
        /* Beyond a jump the next step has the row, but in the last step of a piece. */
        const double reached = c->rows && k < c->last ? m->t[0] : edge;
        for (; sample < c->samples && c->times[sample] <= reached; sample++) {
            if (c->rows) {
                const Wide late = c->times[sample] - m->t;
                write_row(p[0], before, m, e, late, out + sample * N_COLUMNS);
                continue;
            }
            for (int g = 0; g < groups; g++) {
                const Wide slope = (m[g].v - before[g].v) / (m[g].t - before[g].t);
                const Wide height = read(m[g].z, m[g].v, slope, c->times[sample] - m[g].t);
                memcpy(out + sample * LANES + g * WIDTH, &height, sizeof height);
            }
        }
    }
    for (int g = 0, from = 0; g < groups; g++, from += WIDTH) {
        for (int k = 0; k < N_STATE; k++)
            memcpy(kept->state[k] + from, (Wide *)(m + g) + k, sizeof(Wide));
        for (int k = 0; k < N_SUMS; k++)
            memcpy(kept->sums[k] + from, (Wide *)(sum + g) + k, sizeof(Wide));
    }
}

FUNCTION(stepper_follow)(const Stretch *c, const Parameters all, const Span *span, Kept *kept,
                         double *out)
{
    if (c->rows) /* of which only the first lane's are asked for */
        follow(c, all, span, 1, kept, out);
    else
        follow(c, all, span, LANES / WIDTH, kept, out);
}

/* ---- trials ---- */

FUNCTION(chain_lanes)(const Schedule *c, const Parameters all, const Rest *rest, int from, double *out)
{
    Wide p[N_ALL];
    for (int k = 0; k < N_ALL; k++)
        memcpy(p + k, all[k] + from, sizeof *p);
    const int lifted = choose_laws(p);
    State states[2] = {{{0}}}, *before, *m = states; /* before a step and after it, in turn */
    m->t += -(double)rest->steps * c->edges[1];
    memcpy(&m->z, rest->surface + from, sizeof m->z);
    memcpy(&m->y, rest->ram + from, sizeof m->y);
    memcpy(&m->p, rest->plate + from, sizeof m->p);
    memcpy(&m->jump, rest->jump + from, sizeof m->jump);
    m->x = m->z;
    m->i += c->current ? c->current[0] : 0.0;
    m->top = p[OFFSET] + 0.5 * p[AMPLITUDE];
    m->slope = p[AMPLITUDE] * p[FREQUENCY];
    const int moving = all[PLATE_MASS][0] > 0.0;
    for (int64_t k = -rest->steps; k <= c->steps; k++) {
        const double edge = chain_edge(c, k);
        if (k > -rest->steps) {
            const Step each = {0.5 * (chain_edge(c, k - 1) + edge), edge,
                               0.5 * (edge + chain_edge(c, k + 1)), lifted, moving,
                               c->current != NULL, c->current ? c->current[k < 0 ? 0 : k] : 0.0};
            Effect e;
            before = m, m = before == states ? states + 1 : states;
            advance(p, before, m, &each, NULL, &e, NULL);
            m->jump = choose(e.drops, m->jump + 1.0 / p[FREQUENCY], m->jump);
        }
        if (k < 0 || c->sample[k] < 0)
            continue;
        /* Where a jump has moved the step's end, the sample is a little apart. */
        const Wide late = edge - m->t;
        const Wide shown[N_OUTPUTS] = {m->z + late * m->v, m->v, m->x + late * m->w, m->w,
                                       m->p + late * m->s};
        double *row = out + (int64_t)c->sample[k] * N_OUTPUTS * LANES + from;
        for (int n = 0; n < N_OUTPUTS; n++)
            memcpy(row + n * LANES, shown + n, sizeof *shown);
    }
}
