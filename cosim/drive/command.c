#include "command.h"

#include <math.h>

static const double PI = 3.141592653589793;
static const double SAME_TIME = 1e-12; /* s; as in the recorder, which rows are from */

double command_value(const Piece *p, double t)
{
    const double phase = (t - p->origin) * p->rate;
    double shape;
    switch (p->kind) {
    case RISE:
        shape = phase / p->span;
        break;
    case FALL:
        shape = (1.0 - phase) / p->span;
        shape = shape > 0.0 ? shape : 0.0;
        break;
    case SINE:
        return p->offset + 0.5 * p->amplitude * sin(2 * PI * (t - p->origin) * p->rate);
    default:
        return p->offset;
    }
    return p->offset + p->amplitude * ((shape < 1.0 ? shape : 1.0) - 0.5);
}

void command_values(const Piece *p, int64_t n, const double *times, double *values)
{
    for (int64_t k = 0; k < n; k++) {
        while (times[k] >= p->until)
            p++;
        values[k] = command_value(p, times[k]);
    }
}

void command_values_before(const Piece *p, int64_t n, const double *times, double *values)
{
    for (int64_t k = 0; k < n; k++) {
        while (times[k] > p->until + SAME_TIME)
            p++;
        values[k] = times[k] >= p->until ? p->end : command_value(p, times[k]);
    }
}
