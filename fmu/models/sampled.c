/* SPDX-License-Identifier: BSD-2-Clause */
/* A sampled controller: every `period` it reads a sensor, and `delay` later it puts out
 *
 *     out = middle + gain (target - sensor), within [least, most]
 *
 * The target is `target` until `change`, then `target_2`. */
#include <math.h>
#include <stdio.h>

#include "../thin/model.h"

enum { TIME, PERIOD, DELAY, GAIN, MIDDLE, LEAST, MOST, TARGET, CHANGE, TARGET_2, SENSOR, OUT, AIM };

static const Variable variables[] = {
    {PARAMETER, "period", "s", 0.05, "Between two readings of the sensor", 0},
    {PARAMETER, "delay", "s", 0.01, "From a reading to what follows of it; below the period", 0},
    {PARAMETER, "gain", "1", 100.0, "Of the output over the sensor", 0},
    {PARAMETER, "middle", "1", 0.4, "Output without an error", 0},
    {PARAMETER, "least", "1", 0.0, "Least output", 0},
    {PARAMETER, "most", "1", 1.0, "Greatest output", 0},
    {PARAMETER, "target", "1", 0.0, "What the sensor should show at first", 0},
    {PARAMETER, "change", "s", 1e9, "When that changes", 0},
    {PARAMETER, "target_2", "1", 0.0, "What it should show from then on", 0},
    {INPUT, "sensor", "1", 0.0, "What is measured", 0},
    {OUTPUT, "out", "1", 0.0, "What is put out", 0},
    {OUTPUT, "aim", "1", 0.0, "The target now", 0},
};

typedef struct {
    double next, due, read; /* next reading; when the last one takes effect, and what it gives */
} State;

static const double ON_TIME = 1e-9; /* of a period */

static int start(Run *run)
{
    State *s = run->state;
    if (!(run->v[PERIOD] > 0.0 && run->v[DELAY] >= 0.0 && run->v[DELAY] < run->v[PERIOD])) {
        snprintf(run->why, sizeof run->why, "period must be above delay, and delay at least 0");
        return 0;
    }
    s->next = run->v[PERIOD];
    s->due = INFINITY;
    run->v[OUT] = run->v[MIDDLE];
    run->v[AIM] = run->v[CHANGE] > 0.0 ? run->v[TARGET] : run->v[TARGET_2];
    return 1;
}

static int step_by(Run *run, double h)
{
    State *s = run->state;
    double *v = run->v;
    const double end = run->time + h + ON_TIME * v[PERIOD];
    v[AIM] = end >= v[CHANGE] ? v[TARGET_2] : v[TARGET];
    while (fmin(s->due, s->next) <= end) {
        if (s->due <= s->next) {
            v[OUT] = s->read;
            s->due = INFINITY;
        } else {
            s->read = fmax(v[LEAST], fmin(v[MOST], v[MIDDLE] + v[GAIN] * (v[AIM] - v[SENSOR])));
            s->due = s->next + v[DELAY];
            s->next += v[PERIOD];
        }
    }
    return 1;
}

static const Model sampled = {
    .name = "sampled",
    .about = "A controller that reads its sensor at times and answers after a while",
    .token = "sampled-1",
    .variables = variables,
    .count = sizeof variables / sizeof *variables,
    .state = sizeof(State),
    .step = 1e-3,
    .start = start,
    .step_by = step_by,
};

const Model *model(const char *resources, char why[512])
{
    (void)resources, (void)why;
    return &sampled;
}
