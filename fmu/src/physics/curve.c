/* SPDX-License-Identifier: BSD-2-Clause */
#include "curve.h"

#include <math.h>

#include "events.h"
#include "integrator.h"

/* s; over so short a time a solution goes straight, to its square times the acceleration's rate. */
static const double SMALL_CORRECTION = 1e-10;

/* Of a long step: an event that is so near to where it was found is found, since a real step to it is
 * still to come. */
static const double NEAR = 1e-8;

enum { QUARTERS = 4 };

void stickslip_find_functions(const Model *m, Point *point)
{
    point->n = stickslip_event_functions(m, point->knot.y, point->knot.tau, point->functions);
}

/* One of a point's functions, with its rate by the curve's clock. By a wall's, that wall is left where
 * the root of the penetration falls through zero. */
static inline EventFunction seen(const Model *m, const Curve *curve, const Point *point, int i)
{
    EventFunction f = point->functions[i];
    if (curve->wall < 0)
        return f;
    f.rate *= point->knot.root;
    if (f.kind == EVENT_WALL_LEFT && f.surface == curve->wall) {
        f.value = point->knot.root;
        f.rate = 0.5 * m->mode[curve->wall].side * point->knot.y[curve->wall * N_STATES + U];
    }
    return f;
}

int stickslip_may_have_event(const Model *m, const Curve *curve, const Point *to)
{
    const double half = 0.5 * to->at;
    for (int i = 0; i < to->n; i++) {
        const EventFunction a = seen(m, curve, curve->start, i), b = seen(m, curve, to, i);
        if (!(a.value > half * fabs(a.rate) && b.value > half * fabs(b.rate)))
            return 1;
    }
    return 0;
}

static void look_at(const Model *m, const Curve *curve, double at, Point *point)
{
    const Knot *start = &curve->start->knot;
    Knot *knot = &point->knot;
    point->at = at;
    if (curve->dense) {
        stickslip_interpolate(m, curve->dense, at / curve->dense->length, knot);
        knot->tau += start->tau;
        stickslip_find_functions(m, point);
        return;
    }
    stickslip_trial_step(m, start->tau, at, start->y, start->dy, knot->y, knot->dy);
    knot->tau = start->tau + at;
    stickslip_find_functions(m, point);
}

/* Root of function (or, with use_rate, zero of its rate) between two places on the curve at which
 * it differs in sign: Newton where it stays inside and helps, else bisection. */
static double locate(const Model *m, const Curve *curve, int index, int use_rate, double low,
                     double high, double value_low)
{
    Point end;
    double h = 0.5 * (low + high), before = high - low;
    for (int i = 0; i < 200; i++) {
        const double resolution =
            curve->dense ? NEAR * high : 2e-16 * (curve->start->knot.tau + high);
        look_at(m, curve, h, &end);
        const EventFunction f = seen(m, curve, &end, index);
        double value = use_rate ? f.rate : f.value;
        if ((value < 0.0) == (value_low < 0.0))
            low = h;
        else
            high = h;
        if (value == 0.0 || high - low <= resolution)
            break;
        double next = 0.5 * (low + high);
        if (!use_rate && f.rate != 0.0) {
            const double change = -value / f.rate;
            if (fabs(change) <= 0.5 * resolution)
                return curve->dense && h + change > low && h + change < high ? h + change : h;
            if (h + change > low && h + change < high && fabs(change) < 0.5 * before)
                next = h + change;
        }
        before = fabs(next - h);
        h = next;
    }
    return h;
}

/* Has a jump made the wall of a ram at rest pull? It may press again by the step's end; not where the
 * ram would be back before it has left by more than rounding. */
static int pulls(const Model *m, const EventFunction *f)
{
    if (f->kind != EVENT_WALL_LEFT || m->mode[f->surface].wall != WALL_REST || f->value >= -f->noise)
        return 0;
    const double mass = m->r.ram_mass + m->r.surface_mass + m->r.part_mass;
    const double time = f->rate > 0.0 ? -f->value / f->rate : INFINITY;
    return -f->value * time * time > 1e-15 * m->r.travel * mass;
}

/* The first event between two points of the curve. */
static double first_between(const Model *m, const Curve *curve, const Point *from, const Point *to,
                            int *which)
{
    const double begin = from->at;
    double h = to->at, found = -1.0;
    const Point *stop = to;
    Point nearer;
    for (int i = 0; i < from->n; i++) {
        const EventFunction a = seen(m, curve, from, i), b = seen(m, curve, stop, i);
        double high = -1.0;
        if (pulls(m, &from->functions[i])) {
            *which = i;
            return begin;
        }
        if (b.value < -b.noise) {
            high = h;
        } else if (a.rate < 0.0 && b.rate > 0.0 && a.value > 0.0 &&
                   (a.value + a.rate * (h - begin) / 3.0 < 0.0 ||
                    b.value - b.rate * (h - begin) / 3.0 < 0.0)) {
            /* Both ends are clear, but the curve may dip below zero between them (grazing). */
            Point dip;
            double lowest = locate(m, curve, i, 1, begin, h, a.rate);
            look_at(m, curve, lowest, &dip);
            if (seen(m, curve, &dip, i).value < -dip.functions[i].noise)
                high = lowest;
        }
        if (high < 0.0)
            continue;
        if (h - begin < STEP_MIN && a.value < 0.0 && a.rate > 0.0)
            continue; /* on its way back, and another event is due within the same instant */
        *which = i;
        if (a.value <= 0.0) {
            if (a.rate < 0.0)
                return begin;
            /* It begins on the boundary, leaves it and comes back: halve until it is outside. */
            Point inside;
            double low = high - begin;
            do {
                low *= 0.5;
                if (low < STEP_MIN)
                    return begin;
                look_at(m, curve, begin + low, &inside);
            } while (seen(m, curve, &inside, i).value <= 0.0);
            found = locate(m, curve, i, 0, begin + low, high, 1.0);
        } else {
            found = locate(m, curve, i, 0, begin, high, 1.0);
        }
        h = found;
        look_at(m, curve, h, &nearer);
        stop = &nearer;
    }
    return found;
}

double stickslip_first_event(const Model *m, const Curve *curve, const Point *to, int *which)
{
    if (!curve->dense)
        return first_between(m, curve, curve->start, to, which);
    /* Within a long step a function may do what a cubic does not: quarter by quarter. */
    Point inner[2];
    const Point *from = curve->start;
    for (int i = 1; i <= QUARTERS; i++) {
        const Point *stop = to;
        if (i < QUARTERS) {
            look_at(m, curve, 0.25 * i * to->at, &inner[i % 2]);
            stop = &inner[i % 2];
        }
        const double found = first_between(m, curve, from, stop, which);
        if (found >= 0.0)
            return found;
        from = stop;
    }
    return -1.0;
}

double stickslip_land(const Model *m, const Curve *curve, int which, double at, Point *end)
{
    const Knot *start = &curve->start->knot;
    Knot *knot = &end->knot;
    Stages stages;
    for (int i = 0; i < 4; i++) {
        stickslip_long_step(m, curve->wall, at, start, knot, &stages);
        end->at = at;
        stickslip_find_functions(m, end);
        const EventFunction f = seen(m, curve, end, which);
        const double off = f.rate != 0.0 ? -f.value / f.rate : 0.0;
        if (!(fabs(off) <= 0.01 * at))
            break; /* a graze, or nothing that a straight line could find */
        const double late = curve->wall < 0 ? off : off * knot->root;
        if (fabs(late) <= SMALL_CORRECTION) {
            for (int j = 0; j < moving(m) * N_STATES; j++)
                knot->y[j] += late * knot->dy[j];
            knot->tau += late;
            break;
        }
        at += off;
    }
    return knot->tau - start->tau;
}
