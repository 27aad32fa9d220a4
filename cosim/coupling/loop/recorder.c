/* Rows of the waveforms, frames of the camera and the end of settling are communication points of
   their own. The mechanics are told how long their inputs hold beyond them, so that they need not
   end a step of their integration there. */

#define _POSIX_C_SOURCE 199309L /* the clock's */

#include "loop.h"

#include <stdint.h>
#include <time.h>

static const double SAME_TIME = 1e-12; /* s; communication points closer than this are one */

int64_t loop_milliseconds(void)
{
    struct timespec now = {0};
#ifdef CLOCK_MONOTONIC_COARSE /* in a few nanoseconds; steps are a thousand */
    clock_gettime(CLOCK_MONOTONIC_COARSE, &now);
#else
    timespec_get(&now, TIME_UTC);
#endif
    return (int64_t)now.tv_sec * 1000 + now.tv_nsec / 1000000;
}

/* The value at `t` on the straight that ends at the corner with the index `after`. */
static double between(const Schedule *s, int64_t after, double t)
{
    if (after == 0 || after == s->n)
        return s->values[after == 0 ? 0 : after - 1];
    const double start = s->times[after - 1], end = s->times[after];
    double share = (t - start) / (end - start);
    share = share < 0.0 ? 0.0 : share > 1.0 ? 1.0 : share;
    return (1.0 - share) * s->values[after - 1] + share * s->values[after];
}

/* How many corners lie before `t`, or at it too. */
static int64_t corners(const Schedule *s, double t, int with_it)
{
    int64_t low = 0, high = s->n;
    while (low < high) {
        const int64_t middle = (low + high) / 2;
        if (s->times[middle] < t || (with_it && s->times[middle] == t))
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

/* Take in the extremes since the inputs were set last: before they are set again. */
static void widen(Recorder *r, const double *found)
{
    /* The end of settling may be a corner within rounding. */
    if (r->fmu->time <= r->settle + SAME_TIME)
        return;
    double *most = r->extremes, *least = r->extremes + 1;
    for (int64_t k = 0; k < r->step_outputs - EXTREMES; k += 2) {
        most[k] = found[k] > most[k] ? found[k] : most[k];
        least[k] = found[k + 1] < least[k] ? found[k + 1] : least[k];
    }
}

/* Of an input, per second, the most that the FMU takes: over 1e-18 s an error of ngspice is steeper. */
#define STEEPEST 1e15

/* The inputs of the interval under way from the time reached on: they go linearly from `start`, or
 * what the schedule has, until the interval's or the schedule's next corner. */
static int set_inputs(Recorder *r, double edge, const double *start, const double *end)
{
    Fmu *f = r->fmu;
    const double reached = f->time - r->began;
    if (reached > SAME_TIME) {
        const int64_t extremes = r->step_outputs - EXTREMES;
        if (!f->get(f, r->step_places + EXTREMES, extremes, r->outputs + EXTREMES))
            return 0;
        widen(r, r->outputs + EXTREMES);
    }
    double *input = r->inputs;
    r->holds_until = edge;
    for (int64_t k = 0; k < r->ports; k++) {
        double slope = (end[k] - start[k]) / (edge - r->began);
        slope = slope > STEEPEST ? STEEPEST : slope < -STEEPEST ? -STEEPEST : slope;
        *input++ = start[k] + slope * reached;
        *input++ = slope;
    }
    if (r->schedule) {
        const Schedule *s = r->schedule;
        const int64_t after = corners(s, f->time + SAME_TIME, 1);
        const double value = between(s, after, f->time);
        if (after < s->n && s->times[after] < edge)
            r->holds_until = s->times[after];
        const double last = between(s, corners(s, r->holds_until - SAME_TIME, 0), r->holds_until);
        *input++ = value;
        *input++ = (last - value) / (r->holds_until - f->time);
    }
    *input++ = r->holds_until - f->time;
    return f->set(f, r->input_places, input - r->inputs, r->inputs);
}

/* Advance to `time`, within an interval whose inputs go linearly from `start` to `end`. */
static int step_within(Recorder *r, double time, double edge, const double *start,
                       const double *end)
{
    Fmu *f = r->fmu;
    if (f->time >= r->holds_until - SAME_TIME && !set_inputs(r, edge, start, end))
        return 0;
    if (!f->step(f, time - f->time))
        return 0;
    f->time = time;
    f->steps++;
    if (time < edge) /* who leads looks at the interval's end alone */
        return 1;
    if (!f->get(f, r->step_places, r->step_outputs, r->outputs))
        return 0;
    widen(r, r->outputs + EXTREMES);
    return 1;
}

/* Write down what the agenda has for this time. */
static int visit(Recorder *r)
{
    Fmu *f = r->fmu;
    const int32_t what = r->what[r->next++];
    if (what & SETTLED) {
        if (!f->get(f, r->total_places, r->totals, r->totals_at_settle) ||
            !f->get_whole(f, r->counter_places, r->counters, r->counters_at_settle))
            return 0;
        r->holds_until = f->time; /* the inputs are to be set again, so that extremes begin here */
    }
    if (what & (ROW | FRAME | PART)) {
        /* The row's place holds the sample of a frame too; the array has one row to spare. */
        double *row = r->rows + r->n_rows * (r->reals + r->wholes);
        int32_t whole[2];
        if (!f->get(f, r->real_places, r->reals, row) ||
            !f->get_whole(f, r->whole_places, r->wholes, whole))
            return 0;
        for (int64_t k = 0; k < r->wholes; k++)
            row[r->reals + k] = whole[k];
        if (what & FRAME)
            r->frames[r->n_frames++] = row[r->z_surface];
        if (what & PART)
            r->parts[r->n_parts++] = row[r->z_part];
        if (what & ROW)
            r->n_rows++;
    }
    if (r->next == r->n_times) {
        r->plan();
        return !r->stopped;
    }
    return 1;
}

int recorder_begin(Recorder *r)
{
    return visit(r);
}

/* To ask the clock costs as much as a tenth of a row. */
static int is_late(const Fmu *f, int64_t late)
{
    return f->steps % 16 == 0 && loop_milliseconds() >= late;
}

/* As recorder_follow(); until `stop` steps of the FMU, or `late` (ms). */
static int64_t follow(Recorder *r, int64_t n, const double *edges, const double *start,
                      const double *end, int64_t stop, int64_t late)
{
    Fmu *f = r->fmu;
    for (int64_t k = 0; k < n; k++, start += r->ports, end += r->ports) {
        if (!r->inside)
            r->began = f->time;
        r->inside = 1;
        while (r->times[r->next] < edges[k] - SAME_TIME) {
            if (f->steps >= stop || is_late(f, late))
                return k;
            if (!step_within(r, r->times[r->next], edges[k], start, end) ||
                !visit(r))
                return -1;
        }
        if (!step_within(r, edges[k], edges[k], start, end))
            return -1;
        r->inside = 0;
        while (r->times[r->next] <= edges[k] + SAME_TIME)
            if (!visit(r))
                return -1;
        if (f->steps >= stop || is_late(f, late))
            return k + 1;
    }
    return n;
}

int64_t recorder_follow(Recorder *r, int64_t n, const double *edges, const double *start,
                        const double *end, int64_t most)
{
    return follow(r, n, edges, start, end, r->fmu->steps + most,
                  loop_milliseconds() + LOOP_PATIENCE);
}

int recorder_advance(Recorder *r, double time, double start, double end)
{
    return follow(r, 1, &time, &start, &end, INT64_MAX, INT64_MAX) == 1;
}

int recorder_exchange(Recorder *r, double time, double start, double end, double value)
{
    if (!recorder_advance(r, time, start, end))
        return 0;
    if (end == value)
        return 1;
    Fmu *f = r->fmu;
    r->inputs[0] = value;
    r->inputs[1] = 0.0;
    return f->set(f, r->input_places, 2, r->inputs) &&
           f->get(f, r->step_places, r->step_outputs, r->outputs);
}
