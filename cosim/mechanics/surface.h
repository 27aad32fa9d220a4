/* The velocity of a prescribed surface between two knots: a straight or a part of a sine. SI. */

#ifndef SURFACE_H
#define SURFACE_H

#include <math.h>

typedef struct {
    double begin, end;    /* velocity at the knots */
    double start, length; /* s; the first knot's time, and how long to the second */
    double slope;         /* of a straight, or of a sine in the middle */
    double half, turn;    /* of half sin(turn t): m/s, and rad/s; turn is 0 for a straight */
} Piece;

/* A piece between two knots. That of a sine lies within a quarter turn. */
static inline Piece piece_between(const double time[2], const double v[2], double half, double turn)
{
    Piece p = {v[0], v[1], time[0], time[1] - time[0], 0.0, half, turn};
    p.slope = turn > 0 ? half * turn * cos(turn * (time[0] + 0.5 * p.length))
                       : (v[1] - v[0]) / p.length;
    return p;
}

/* Velocity `tau` (s) after the first knot. */
static inline double speed_at(const Piece *p, double tau)
{
    if (tau >= p->length)
        return p->end;
    return p->turn > 0 ? p->half * sin(p->turn * (p->start + tau)) : p->begin + p->slope * tau;
}

static inline double slope_at(const Piece *p, double tau)
{
    return p->turn > 0 ? p->half * p->turn * cos(p->turn * (p->start + tau)) : p->slope;
}

/* How far it rises from `from` to `to` (s after the first knot). */
static inline double risen(const Piece *p, double from, double to)
{
    if (!(p->turn > 0))
        return 0.5 * (speed_at(p, from) + speed_at(p, to)) * (to - from);
    const double middle = p->start + 0.5 * (from + to), reach = 0.5 * p->turn * (to - from);
    return 2 * p->half / p->turn * sin(p->turn * middle) * sin(reach);
}

double meeting_sine(const Piece *p, double from, double v, double a, double relative, int side);

/* How long after `from` (s) a body with velocity v there and acceleration a next has the surface's
   own velocity; a negative number: not in this piece. `relative`, its velocity less the surface's, may
   be 0: then it leaves towards `side`. */
static inline double meeting(const Piece *p, double from, double v, double a, double relative,
                             int side)
{
    if (p->turn > 0)
        return meeting_sine(p, from, v, a, relative, side);
    const double rate = a - p->slope;
    return relative * rate < 0 ? -relative / rate : -1.0;
}

#endif
