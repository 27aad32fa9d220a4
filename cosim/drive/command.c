#include "command.h"

#include <math.h>

static const double PI = 3.141592653589793;
static const double SAME_TIME = 1e-12; /* s; as in the recorder, which rows are from */

static inline double value_of(const Piece *p, const int64_t kind, double t)
{
    const double phase = (t - p->origin) * p->rate;
    if (kind == SINE)
        return p->offset + 0.5 * p->amplitude * sin(2 * PI * (t - p->origin) * p->rate);
    if (kind == LEVEL)
        return p->offset;
    const double shape = phase / p->span;
    return p->offset + p->amplitude * ((shape < 1.0 ? shape : 1.0) - 0.5);
}

double command_value(const Piece *p, double t)
{
    return value_of(p, p->kind, t);
}

const Piece *piece_at(Pieces *drive, double t)
{
    while (t >= drive->pieces[drive->now].until) {
        if (drive->now + 1 < drive->count) {
            drive->now++;
            continue;
        }
        const double last = drive->pieces[drive->now].until;
        drive->refill();
        if (drive->pieces[drive->count - 1].until <= last)
            break;
    }
    while (drive->now > 0 && t < drive->pieces[drive->now].begin)
        drive->now--;
    return &drive->pieces[drive->now];
}

/* Those of one piece at n times; with a constant kind the compiler makes vectors of them. */
static void values_within(const Piece piece, int64_t n, const double *restrict times,
                          double *restrict values)
{
    if (piece.kind == RAMP)
        for (int64_t k = 0; k < n; k++)
            values[k] = value_of(&piece, RAMP, times[k]);
    else
        for (int64_t k = 0; k < n; k++)
            values[k] = value_of(&piece, piece.kind, times[k]);
}

/* How many of the times, which do not fall, lie before `end`. */
static int64_t before(double end, int64_t n, const double *times)
{
    int64_t low = 0, high = 1; /* the nearest first, since many pieces hold few */
    while (high < n && times[high] < end) {
        low = high;
        high = 2 * high;
    }
    high = high < n ? high : n;
    while (low < high) {
        const int64_t middle = (low + high) / 2;
        if (times[middle] < end)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

void command_values(const Piece *p, int64_t n, const double *times, double *values)
{
    for (int64_t k = 0; k < n; p++) {
        const int64_t inside = before(p->until, n - k, times + k);
        values_within(*p, inside, times + k, values + k);
        k += inside;
    }
}

void command_values_before(const Piece *p, int64_t n, const double *times, double *values)
{
    for (int64_t k = 0; k < n; p++) {
        const int64_t inside = before(p->until, n - k, times + k);
        values_within(*p, inside, times + k, values + k);
        for (k += inside; k < n && times[k] <= p->until + SAME_TIME; k++)
            values[k] = p->end;
    }
}
