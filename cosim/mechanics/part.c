/* Motion of a part that is pressed against a surface whose velocity is prescribed.

   All forces stand as accelerations, force over the part's mass, m/s^2. law[] holds
       [0] mu_s F_n/m   the most that the surface can do while the part sticks to it
       [1] mu_k F_n/m   what it does while the part slips
       [2] mu_p F_n/m   friction of the spring-loaded plate, against the part's own velocity
       [3] g            gravity along the motion, downwards
   The surface's velocity is linear between knots (time, v), or part of a sine; a time that is
   repeated is a jump. The knots repeat `periods` times. Every function writes height, velocity and
   the time spent sticking so far, and returns the number of changes between sticking and slipping. */

#include <float.h>
#include <math.h>
#include <stddef.h>

#include "surface.h"

#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

enum { STATIC, KINETIC, PLATE, GRAVITY };
enum { MOST_EVENTS = 64 }; /* in one piece; a handful suffices, and after these it is ended */

typedef struct {
    long count; /* of knots */
    const double *time, *v;
    long periods;
} Surface;

typedef struct {
    double a;  /* acceleration of the part; sticking, about */
    int side;  /* sign of part minus surface velocity; 0 sticks */
} Mode;

/* What part_exact tells besides, as it stands just before a jump: the surface's motion and its
   friction on the part, and sums from the start, of energies over the part's mass. */
enum { STICKS, HEIGHT, SPEED, SLOPE, FRICTION, WORK, HEAT, EVENTS, N_TOLD };

typedef struct {
    long count, next; /* of times; the next to be written */
    const double *time; /* NULL: at the knots */
    double *z, *v, *stuck;
    double *told; /* rows of N_TOLD, or NULL */
} Output;

static int sign(double x) { return (x > 0) - (x < 0); }

/* What friction must give a part that sticks besides the surface's acceleration, about `slope`. */
static double burden(const double *law, double v, double slope)
{
    const int way = sign(v), going = way ? way : sign(slope);
    if (going == 0) /* all at rest: the plate carries what it can */
        return copysign(fmax(0.0, fabs(law[GRAVITY]) - law[PLATE]), law[GRAVITY]);
    return law[GRAVITY] + going * law[PLATE];
}

/* What moves the part from here on, while the surface's acceleration is about `slope`. Sticking
   comes first, as the law has it; else the surface pulls the part the way that sticking would have
   needed, but too weakly. `slack` is what rounding leaves open of the needed acceleration. */
static Mode decide(const double *law, double relative, double v, double slope, double slack)
{
    int side = sign(relative), way = sign(v);
    if (side == 0) {
        const double need = slope + burden(law, v, slope);
        if (fabs(need) <= law[STATIC] + slack)
            return (Mode){slope, 0};
        side = need > 0 ? -1 : 1;
    }
    const double down = law[GRAVITY] + side * law[KINETIC];
    if (way == 0) {
        if (fabs(down) <= law[PLATE] + slack)
            return (Mode){law[PLATE] > 0 ? 0.0 : -down, side};
        way = down > 0 ? -1 : 1;
    }
    return (Mode){-down - way * law[PLATE], side};
}

static void emit(Output *out, double z, double v, double stuck, const double *told)
{
    out->z[out->next] = z;
    out->v[out->next] = v;
    out->stuck[out->next] = stuck;
    if (out->told)
        for (int k = 0; k < N_TOLD; k++)
            out->told[out->next * N_TOLD + k] = told[k];
    out->next++;
}

/* The part at the begin of a stretch without events. */
typedef struct {
    double z, v, stuck;
} State;

/* The state `tau` (s) after `from`, into a piece; it ends at the velocity `v`. */
static inline State later(const State *s, const Piece *p, int sticks, double from, double tau,
                          double v)
{
    const double up = sticks && p->turn > 0 ? risen(p, from, from + tau) : 0.5 * tau * (s->v + v);
    return (State){s->z + up, v, s->stuck + (sticks ? tau : 0.0)};
}

/* What is to be told once the part, which was in the state `s`, has risen by `up` in that time. */
static void tell(const State *s, const Piece *p, const double *law, int side, double from,
                 double tau, double up, double told[N_TOLD])
{
    const double before = speed_at(p, from), height = risen(p, from, from + tau);
    told[STICKS] = side == 0;
    told[HEIGHT] += height;
    told[SPEED] = speed_at(p, from + tau);
    told[SLOPE] = slope_at(p, from + tau);
    if (side == 0) {
        const double carried = burden(law, s->v, p->slope);
        told[FRICTION] = told[SLOPE] + carried;
        told[WORK] += 0.5 * (told[SPEED] - before) * (told[SPEED] + before) + carried * height;
    } else {
        told[FRICTION] = -side * law[KINETIC];
        told[WORK] += told[FRICTION] * height;
        told[HEAT] += law[KINETIC] * fabs(up - height);
    }
    told[HEAT] += law[PLATE] * fabs(up);
}

/* Exact: from event to event in closed form. With `turn` (rad/s) the surface's velocity is
   half sin(turn t); then each piece lies within a quarter turn, and all of it needs either more or
   less than static friction. A difference of velocities below what rounding can have made of zero
   (`noise`, a bound that grows with each piece and begins anew when the part sticks) is zero, so that
   an event on a knot is not missed by a bit. Times are known to `resolution`: knots no farther apart
   are a jump, and a velocity that the forces give or take within it (`least`) is zero, or an interval
   of 1e-309 s would decide whether the part slips. */
static long follow(long knots, const double *time, const double *v_surface, long periods,
                   const double *law, double z, double v, double half, double turn,
                   long outputs, const double *at, double *z_out, double *v_out,
                   double *stuck_out, double *told_out)
{
    const double period = time[knots - 1] - time[0], eps = DBL_EPSILON;
    const double forces = law[STATIC] + law[PLATE] + fabs(law[GRAVITY]);
    const double resolution = eps * fmax(fabs(time[0]), fabs(time[knots - 1]));
    const double least = forces * resolution;
    Output out = {at ? outputs : periods * knots, 0, at, z_out, v_out, stuck_out, told_out};
    State now = {z, v, 0.0};
    double told[N_TOLD] = {0.0};
    double noise = least;
    int sticks = -1; /* unknown yet */
    long events = 0;

    for (long k = 0; k < periods; k++) {
        const double shift = (double)k * period;
        if (!at)
            emit(&out, now.z, now.v, now.stuck, told);
        for (long i = 1; i < knots; i++) {
            const double start = time[i - 1], length = time[i] - start;
            const double begin = v_surface[i - 1], end = v_surface[i];
            double left = length, done = 0.0, speed = begin;
            if (length > resolution) {
                const Piece piece = piece_between(time + i - 1, v_surface + i - 1, half, turn);
                const double slope = piece.slope;
                const double late = eps * (fabs(start) + fabs(time[i])); /* rounding of times */
                const double slack = 4 * eps * (forces + fabs(slope))
                    + (2 * eps * (fabs(begin) + fabs(end)) + late * fabs(slope)) / length;
                const double here = 2 * eps * (fabs(begin) + fabs(end)) + late * fabs(slope);
                for (int n = 0; left > 0; n++) {
                    double relative = now.v - speed;
                    if (fabs(relative) <= noise)
                        relative = 0.0;
                    if (law[PLATE] > 0 && fabs(now.v) <= noise)
                        now.v = 0.0;
                    const Mode mode = decide(law, relative, now.v, slope, slack);
                    const int follows = mode.side == 0 && turn > 0; /* the sine, to its end */
                    double tau = left;
                    int meet = 0, rest = 0;
                    if (n < MOST_EVENTS && !follows) {
                        const double next =
                            meeting(&piece, done, now.v, mode.a, relative, mode.side);
                        if (next >= 0 && next <= tau) {
                            tau = next;
                            meet = 1;
                        }
                        if (law[PLATE] > 0 && now.v * mode.a < 0 && -now.v / mode.a <= tau) {
                            meet = meet && -now.v / mode.a == tau;
                            tau = -now.v / mode.a;
                            rest = 1;
                        }
                    }
                    if (sticks >= 0 && sticks != (mode.side == 0))
                        events++;
                    sticks = mode.side == 0;
                    told[EVENTS] = (double)events;

                    const int last = !(tau < left);
                    while (at && out.next < out.count) {
                        /* What rounding puts behind the end of a stretch is at its end. */
                        const double since = at[out.next] - shift - start - done;
                        if (!(since <= tau + 4 * eps * fabs(at[out.next])))
                            break;
                        const double dt = since > tau ? tau : since > 0 ? since : 0.0;
                        const double v_then =
                            follows ? speed_at(&piece, done + dt) : now.v + mode.a * dt;
                        const State then = later(&now, &piece, sticks, done, dt, v_then);
                        emit(&out, then.z, then.v, then.stuck, told);
                        if (told_out)
                            tell(&now, &piece, law, mode.side, done, dt, then.z - now.z,
                                 told_out + (out.next - 1) * N_TOLD);
                    }
                    const State before = now;
                    const double from = done;
                    done += tau;
                    left = last ? 0.0 : length - done;
                    speed = last ? end : speed_at(&piece, done);
                    now = later(&before, &piece, sticks, from, tau,
                                rest              ? 0.0
                                : sticks || meet ? speed
                                                 : before.v + mode.a * tau);
                    if (told_out)
                        tell(&before, &piece, law, mode.side, from, tau, now.z - before.z, told);
                    if (sticks || meet)
                        noise = least;
                    noise += here + 2 * eps * (fabs(before.v) + fabs(now.v)) + late * fabs(mode.a);
                }
            } else {
                noise += forces * length;
            }
            if (!at)
                emit(&out, now.z, now.v, now.stuck, told);
        }
    }
    while (out.next < out.count) /* times that rounding puts behind the end */
        emit(&out, now.z, now.v, now.stuck, told);
    return events;
}

EXPORT long part_exact(long knots, const double *time, const double *v_surface, long periods,
                       const double *law, double z, double v, double half, double turn,
                       long outputs, const double *at, double *z_out, double *v_out,
                       double *stuck_out, double *told_out)
{
    return follow(knots, time, v_surface, periods, law, z, v, half, turn, outputs, at, z_out,
                  v_out, stuck_out, told_out);
}

typedef struct {
    Surface surface;
    long knot, period;
} Cursor;

static double velocity(Cursor *c, double t)
{
    const Surface *s = &c->surface;
    const double length = s->time[s->count - 1] - s->time[0];
    double local = t - (double)c->period * length;
    while (local >= s->time[s->count - 1] && c->period + 1 < s->periods) {
        local = t - (double)++c->period * length;
        c->knot = 0;
    }
    while (c->knot + 2 < s->count && local >= s->time[c->knot + 1])
        c->knot++;
    const double t0 = s->time[c->knot], dt = s->time[c->knot + 1] - t0;
    const double v0 = s->v[c->knot], v1 = s->v[c->knot + 1];
    return dt > 0 ? v0 + (v1 - v0) * ((local - t0) / dt) : v1;
}

/* A threshold of velocity instead of the set-valued law: sticking is |part - surface| < v_min. */
typedef struct {
    Cursor cursor;
    const double *law;
    double v_min;
    double t, speed; /* of the surface, at the last full step; t = infinity: there was none */
} Threshold;

/* The part's acceleration. The surface's is the difference quotient since the last full step, which
   is what Simulink's Derivative block makes of an interpolated velocity. */
static double regularised(Threshold *h, int full, double t, double v, int *sticks)
{
    const double speed = velocity(&h->cursor, t), relative = v - speed;
    const double slope = h->t < t ? (speed - h->speed) / (t - h->t) : 0.0;
    const double other = -h->law[GRAVITY] - (fabs(v) < h->v_min ? 0 : sign(v)) * h->law[PLATE];
    const double need = slope - other;
    if (full) {
        h->t = t;
        h->speed = speed;
    }
    *sticks = fabs(relative) < h->v_min && fabs(need) <= h->law[STATIC];
    return (*sticks ? need : -sign(relative) * h->law[KINETIC]) + other;
}

/* The third-order method of Bogacki and Shampine with a fixed step (Simulink's ode3), events
   ignored; rows 0...steps. */
EXPORT long part_threshold(long knots, const double *time, const double *v_surface, long periods,
                           const double *law, double z, double v, double step, double v_min,
                           long steps, double *z_out, double *v_out, double *stuck_out)
{
    Threshold h = {{{knots, time, v_surface, periods}, 0, 0}, law, v_min, INFINITY, 0.0};
    Output out = {steps + 1, 0, NULL, z_out, v_out, stuck_out, NULL};
    double stuck = 0.0;
    int before = -1, sticks, minor;
    long events = 0;
    emit(&out, z, v, stuck, NULL);
    for (long n = 0; n < steps; n++) {
        const double t = time[0] + (double)n * step;
        const double a1 = regularised(&h, 1, t, v, &sticks), v2 = v + 0.5 * step * a1;
        const double a2 = regularised(&h, 0, t + 0.5 * step, v2, &minor);
        const double v3 = v + 0.75 * step * a2;
        const double a3 = regularised(&h, 0, t + 0.75 * step, v3, &minor);
        z += step * (2 * v + 3 * v2 + 4 * v3) / 9;
        v += step * (2 * a1 + 3 * a2 + 4 * a3) / 9;
        stuck += sticks ? step : 0.0;
        events += before >= 0 && sticks != before;
        before = sticks;
        emit(&out, z, v, stuck, NULL);
    }
    return events;
}

/* Implicit in the friction (Moreau's time stepping): the velocity at the end of each step solves
   the set-valued law, height by the trapezoidal rule; rows 0...steps. */
EXPORT long part_moreau(long knots, const double *time, const double *v_surface, long periods,
                        const double *law, double z, double v, double step, long steps,
                        double *z_out, double *v_out, double *stuck_out)
{
    Cursor c = {{knots, time, v_surface, periods}, 0, 0};
    Output out = {steps + 1, 0, NULL, z_out, v_out, stuck_out, NULL};
    const double plate = step * law[PLATE];
    double stuck = 0.0;
    int before = -1;
    long events = 0;
    emit(&out, z, v, stuck, NULL);
    for (long n = 0; n < steps; n++) {
        const double t = time[0] + (double)(n + 1) * step, speed = velocity(&c, t);
        const double free = v - step * law[GRAVITY], old = v;
        double need = speed - free + sign(speed) * plate;
        if (speed == 0) /* the plate's share is whatever helps, up to its limit */
            need = copysign(fmax(0.0, fabs(free) - plate), -free);
        const double late = 1 + fabs(t) / step; /* what the rounding of t can do */
        const double slack = 8 * DBL_EPSILON * (fabs(v) + fabs(speed) + late * fabs(speed - v));
        const int sticks = fabs(need) <= step * law[STATIC] + slack;
        if (sticks) {
            v = speed;
        } else {
            v = free + sign(need) * step * law[KINETIC];
            v = fabs(v) <= plate ? 0.0 : v - sign(v) * plate;
        }
        z += 0.5 * step * (old + v);
        stuck += sticks ? step : 0.0;
        events += before >= 0 && sticks != before;
        before = sticks;
        emit(&out, z, v, stuck, NULL);
    }
    return events;
}
