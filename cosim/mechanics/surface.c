#include "surface.h"

/* The one zero, for times in [low, high], of the relative velocity, or with `rate` of its rate; its
   sign at `low` is `side`. */
static double zero(const Piece *p, double from, double v, double a, int rate, int side, double low,
                   double high)
{
    for (;;) {
        const double middle = 0.5 * (low + high);
        if (!(low < middle && middle < high))
            return high;
        const double value =
            rate ? a - slope_at(p, middle) : v + a * (middle - from) - speed_at(p, middle);
        if (side * value > 0)
            low = middle;
        else
            high = middle;
    }
}

double meeting_sine(const Piece *p, double from, double v, double a, double relative, int side)
{
    const double end = p->length;
    /* The rate of the relative velocity has at most one zero within a quarter turn: the body draws
       nearer and then away, or the other way round. */
    const double now = side * (a - slope_at(p, from)), then = side * (a - slope_at(p, end));
    double low = from, high = end;
    if (relative != 0 && now < 0) {
        if (then > 0)
            high = zero(p, from, v, a, 1, -side, from, end);
    } else if (then < 0) {
        if (relative == 0)
            low = zero(p, from, v, a, 1, side, from, end);
    } else {
        return -1.0;
    }
    if (side * (v + a * (high - from) - speed_at(p, high)) > 0)
        return -1.0;
    return zero(p, from, v, a, 0, side, low, high) - from;
}
