/* The compiled twin of cosim/recorder.py and of the calls of cosim/mechanics.py: the same arithmetic
   in the same order, so the same bits. */

#include "coupled.h"

#include <stdbool.h>
#include <stddef.h>

static const double SAME_TIME = 1e-12; /* s; communication points closer than this are one */

typedef int Set2(void *, const uint32_t *, size_t, const double *);
typedef int Get2(void *, const uint32_t *, size_t, double *);
typedef int GetIntegers2(void *, const uint32_t *, size_t, int32_t *);
typedef int DoStep2(void *, double, double, int);
typedef int Set3(void *, const uint32_t *, size_t, const double *, size_t);
typedef int Get3(void *, const uint32_t *, size_t, double *, size_t);
typedef int GetIntegers3(void *, const uint32_t *, size_t, int32_t *, size_t);
typedef int DoStep3(void *, double, double, bool, bool *, bool *, bool *, double *);

static int good(Fmu *f, int status, AnyFunction called)
{
    f->status = status;
    if (status <= 1)
        return 1;
    f->failed = called;
    return 0;
}

static int set_inputs(Fmu *f, const double *values)
{
    const size_t n = (size_t)f->inputs;
    const int status = f->version == 2
                           ? ((Set2 *)f->set_reals)(f->instance, f->input_places, n, values)
                           : ((Set3 *)f->set_reals)(f->instance, f->input_places, n, values, n);
    return good(f, status, f->set_reals);
}

static int get_reals(Fmu *f, const uint32_t *places, int64_t count, double *values)
{
    const size_t n = (size_t)count;
    const int status = f->version == 2
                           ? ((Get2 *)f->get_reals)(f->instance, places, n, values)
                           : ((Get3 *)f->get_reals)(f->instance, places, n, values, n);
    return good(f, status, f->get_reals);
}

static int get_integers(Fmu *f, const uint32_t *places, int64_t count, int32_t *values)
{
    const size_t n = (size_t)count;
    const int status = f->version == 2
                           ? ((GetIntegers2 *)f->get_integers)(f->instance, places, n, values)
                           : ((GetIntegers3 *)f->get_integers)(f->instance, places, n, values, n);
    return good(f, status, f->get_integers);
}

static int do_step(Fmu *f, double h)
{
    bool unused[3];
    double reached;
    const int status = f->version == 2
                           ? ((DoStep2 *)f->do_step)(f->instance, f->time, h, 1)
                           : ((DoStep3 *)f->do_step)(f->instance, f->time, h, true, &unused[0],
                                                     &unused[1], &unused[2], &reached);
    return good(f, status, f->do_step);
}

/* Advance to `time` with the input's value at the start and its slope. */
static int step_to(Fmu *f, double time, double value, double slope)
{
    const double inputs[2] = {value, slope};
    if (!set_inputs(f, inputs) || !do_step(f, time - f->time) ||
        !get_reals(f, f->step_places, f->step_outputs_count, f->step_outputs))
        return 0;
    f->time = time;
    f->steps++;
    return 1;
}

static int step(Recorder *r, double time, double value, double slope)
{
    if (!step_to(r->fmu, time, value, slope))
        return 0;
    if (time > r->settle) {
        const double *found = r->fmu->step_outputs + 2;
        for (int64_t k = 0; k < r->fmu->step_outputs_count - 2; k += 2) {
            if (found[k] > r->extremes[k])
                r->extremes[k] = found[k];
            if (found[k + 1] < r->extremes[k + 1])
                r->extremes[k + 1] = found[k + 1];
        }
    }
    return 1;
}

/* Write down what the agenda has for this time. */
static int visit(Recorder *r)
{
    Fmu *f = r->fmu;
    const int32_t what = r->what[r->next++];
    if (what & SETTLED && !(get_reals(f, f->total_places, f->totals, r->totals_at_settle) &&
                            get_integers(f, f->counter_places, f->counters, r->counters_at_settle)))
        return 0;
    if (what & (ROW | FRAME)) {
        /* The row's place holds the sample of a frame too; the array has one row to spare. */
        double *row = r->rows + r->n_rows * (f->samples + 1);
        int32_t sticking;
        if (!get_reals(f, f->sample_places, f->samples, row) ||
            !get_integers(f, f->sticking_place, 1, &sticking))
            return 0;
        row[f->samples] = sticking;
        if (what & FRAME)
            r->frames[r->n_frames++] = row[r->z_surface];
        if (what & ROW)
            r->n_rows++;
    }
    if (r->next == r->n_times) {
        r->plan();
        return !r->stopped;
    }
    return 1;
}

/* What the agenda has for time 0. */
EXPORT int recorder_begin(Recorder *r)
{
    return visit(r);
}

EXPORT int64_t recorder_follow(Recorder *r, int64_t n, const double *edges, const double *start,
                               const double *end, int64_t most)
{
    Fmu *f = r->fmu;
    const int64_t stop = f->steps + most;
    for (int64_t k = 0; k < n; k++) {
        if (!r->inside)
            r->began = f->time;
        r->inside = 1;
        const double slope = (end[k] - start[k]) / (edges[k] - r->began);
        while (r->times[r->next] < edges[k] - SAME_TIME) {
            if (f->steps >= stop)
                return k;
            if (!step(r, r->times[r->next], start[k] + slope * (f->time - r->began), slope) ||
                !visit(r))
                return -1;
        }
        if (!step(r, edges[k], start[k] + slope * (f->time - r->began), slope))
            return -1;
        r->inside = 0;
        if (r->times[r->next] <= edges[k] + SAME_TIME && !visit(r))
            return -1;
        if (f->steps >= stop)
            return k + 1;
    }
    return n;
}
