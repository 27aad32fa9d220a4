/* A circuit of the user's own, joined to FMUs of others, of which nothing but their ports is known.
   ngspice leads; for the order of its calls see cosim/circuit/ngspice.py.

   Between two communication points each source goes on along a line. At a communication point all
   FMUs step there, one after another, with what came in since the last one: an FMU is told of a
   probe what the circuit has computed, and of another FMU what that has computed if it has stepped
   already, else a line. So an explicit exchange is sequential, circuit first. Where steps are
   repeated, each attempt of ngspice is a step of the FMUs too, from their saved state, and the next
   attempt has other values at its end until both agree. What an FMU feeds through the circuit itself
   carries then, in a source beside the one that the FMU feeds, so that both agree at once. */

#include "loop.h"

#include <ctype.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double ON_TIME = 1e-13; /* s; as in lead.c */

static const double SHORT = 1e-3;
/* Of after_jump: a difference over less time tells of rounding, so the one before it stays. */

static const int64_t ATTEND_EVERY = 4096; /* as in lead.c */

static const double HALF = 0.49, LAST = 1e-3;
/* ngspice cuts a repeated step if another one as long would end beyond the run's end, from where the
   first one ended. So steps shrink before it; of after_jump: the last one, which is not repeated. */

static const int64_t MOST_TRIES = 25; /* of one step with one length */

static const double EVENT = 3e-3, EVENT_WITHIN = 1e-9;
/* Of a source's largest value: by how much it leaves its line at an event of an FMU; s: the length
   of a step within which the event then lies. */

static const double BENT = 8.0, TELLING = 0.01;
/* Of how much it left its line in the last step, for the length of this one: so much is no event, since
   motion may bend; and of EVENT: what tells so. */

static const double GROWTH = 0.07;
/* Of the time since the last jump: the longest step. By its truncation error ngspice would double its
   steps, and lose of what answers the jump, however fast that is. */

static const double CARRIED = 0.2; /* as in lead.c */

static const double NUDGE = 1e-6; /* of an input, or of 1 if that is more */

static const int64_t CHECKED = 20;
/* After so many communication points states are seen to be restored at ever fewer of them. */

static const double OTHER = 0.1, ROUNDING = 1e-9;
/* Of a step's change and of the value: by how much an output of the same step is another one. And of
   a step's length: by how much one that ngspice has taken is another than was asked for. */

static const double NOISE = 1e-3, AT_REST = 1e-12, FAR = 0.3;
/* Of an output's largest value: a change that tells of its slope, as what rings faster than the steps
   does not, a ram in its wall, say; in the output's unit: what rounding makes of what is at rest; of
   a change: how far from it a slope is wrong. */

enum { WRONG = 12, RIGHT = 4 }; /* so many wrong changes tell; so many of them a right one outweighs */

typedef int Command(const char *);
typedef char *PlotName(void);
typedef struct {
    char *name;
    int type;
    short flags;
    double *real;
    void *complex;
    int length;
} VectorInfo; /* ngspice's vector_info */
typedef VectorInfo *Ask(const char *);

static Ports *run; /* the one under way, or NULL */
static int64_t late;

static int going(const Ports *c)
{
    return c && c->status == GOOD && !c->stopped;
}

/* --- the drive --- */

static double drive_before(Ports *c, double t)
{
    if (t <= 0.0)
        return 0.0;
    const Piece *p = piece_at(&c->drive, nextafter(t, 0.0));
    return t >= p->until - ON_TIME ? p->end : command_value(p, t);
}

static double drive_after(Ports *c, double t)
{
    return command_value(piece_at(&c->drive, t), t);
}

/* Until a step has ended on the jump, the drive keeps its left limit. */
static double drive_now(Ports *c, double t)
{
    return t <= 0.0 || t >= c->jump - ON_TIME ? drive_before(c, fmin(t, c->jump)) : drive_after(c, t);
}

/* --- the sources --- */

static double line_of(Ports *c, const Source *s, double t)
{
    if (s->origin.kind == FROM_DRIVE)
        return s->origin.scale * drive_now(c, t) + s->origin.offset;
    return s->value + s->rate * (t - c->origin);
}

/* What the circuit itself adds to a source for these values of the probes. */
static double carried(const Ports *c, const Source *s, const double *probes)
{
    double sum = 0.0;
    for (const Through *t = c->throughs; t < c->throughs + c->n_throughs; t++)
        if (c->sources + t->source == s)
            sum += t->gain * probes[t->probe];
    return sum;
}

/* In a second, over the last step, of `h` (s). Where gains change along the step, their mean tells it. */
static double carried_rate(const Ports *c, const Source *s, double h)
{
    double sum = 0.0;
    for (const Through *t = c->throughs; t < c->throughs + c->n_throughs; t++)
        if (c->sources + t->source == s)
            sum += 0.5 * (t->gain + t->next_gain) * (c->now[t->probe] - c->start[t->probe]);
    return sum / h;
}

/* With what the circuit adds, at the time of the values that it has computed last. */
static double source_value(Ports *c, const Source *s, double t)
{
    return line_of(c, s, t) + carried(c, s, c->now) - carried(c, s, c->start);
}

/* Whether a difference over so long tells of a slope. One event after another tells that the slope
   is wrong. */
static int is_telling(const Ports *c, double h)
{
    return h > SHORT * c->after_jump && (!c->met || c->met_before);
}

/* Some FMUs tell no slope before their first step. */
static double rate_of(const Ports *c, const Origin *from)
{
    const double known = from->slope == KNOWN ? c->before[from->slope_place] : NAN;
    return from->slope == HELD ? 0.0 : isfinite(known) ? known : c->rates[from->place];
}

/* ngspice integrates a source by the trapezoidal rule. Where the FMU tells the slope, the integral of
   a cubic through both ends is nearer to its own, and what is owed is paid back as in lead.c. */
static double correction(Ports *c, Source *s, double value, double rate, double end)
{
    const double h = c->time - c->origin;
    if (s->origin.slope != KNOWN || h <= 0.0)
        return 0.0;
    const double given = 0.5 * h * (s->value + end);
    s->owed += 0.5 * h * (s->plain + value) - h * h / 12.0 * (rate - s->line) - given;
    return CARRIED * s->owed / fmax(h, c->after_jump);
}

/* The lines from the last accepted point on; until now they have led from `origin` to it. */
static void set_lines(Ports *c)
{
    const double h = c->time - c->origin;
    for (Source *s = c->sources; s < c->sources + c->n_sources; s++) {
        if (s->origin.kind != FROM_OUTPUT)
            continue;
        const double value = s->origin.scale * c->outputs[s->origin.place] + s->origin.offset;
        if (is_telling(c, h))
            s->through_rate = carried_rate(c, s, h);
        const double rate = s->origin.scale * rate_of(c, &s->origin) - s->through_rate;
        s->correction = correction(c, s, value, rate, source_value(c, s, c->time));
        s->plain = value;
        s->value = value + s->correction;
        s->rate = s->line = rate;
        s->largest = fmax(s->largest, fabs(s->value));
    }
}

/* --- the FMUs --- */

static int fmu_failed(Ports *c, const Stranger *s)
{
    c->status = FMU_FAILED;
    c->failed = s - c->fmus;
    return 0;
}

/* V s; of the drive since the last accepted point. */
static double drive_integral(Ports *c, double time)
{
    return 0.5 * (time - c->time) * (drive_after(c, c->time) + drive_before(c, time));
}

/* An input from the communication point to `time`, which lies `h` (s) later. */
static void feed(Ports *c, const Feed *f, double time, double h)
{
    const int64_t k = f->origin.place;
    double start, end, mean;
    if (f->origin.kind == FROM_PROBE) {
        start = c->start[k];
        end = c->now[k];
        mean = (c->charges[k] + 0.5 * (time - c->time) * (c->last[k] + c->now[k])) / h;
    } else if (f->origin.kind == FROM_OUTPUT) {
        start = c->before[k];
        end = c->outputs[k];
        mean = f->origin.slope == HELD && !c->repeats ? start : 0.5 * (start + end);
    } else {
        start = drive_after(c, c->origin);
        end = drive_before(c, time);
        mean = (c->drive_charge + drive_integral(c, time)) / h;
    }
    const double value = f->feed == MEAN ? mean : f->feed == END ? end : start;
    *f->input = f->origin.scale * value + f->origin.offset;
    if (f->slope)
        *f->slope = f->origin.scale * (end - start) / h;
}

static int get_outputs(Stranger *s)
{
    for (int64_t k = 0; k < s->n_outputs; k++)
        if (!fmu_get_group(s->fmu, &s->outputs[k]))
            return 0;
    return !s->n_output_slopes || fmu_slopes(s->fmu, s->get_slopes, s->output_slopes,
                                             s->n_output_slopes, s->output_rates);
}

static int set_inputs(Stranger *s)
{
    for (int64_t k = 0; k < s->n_inputs; k++)
        if (!fmu_set_group(s->fmu, &s->inputs[k]))
            return 0;
    return !s->n_input_slopes || fmu_slopes(s->fmu, s->set_slopes, s->input_slopes,
                                            s->n_input_slopes, s->input_rates);
}

/* What is fed through does not lag where an FMU takes the end of a step for a mean over it. Where steps
   are not repeated, that end is known of the drive and of FMUs that have stepped already; the circuit
   learns of the answer a step late, and in an algebraic loop what comes back would grow. */
static int has_end(const Ports *c, const Feed *f)
{
    const int known = f->origin.kind == FROM_DRIVE ||
                      (f->origin.kind == FROM_OUTPUT && !c->backs[f->origin.place].is_one);
    return c->repeats || (c->ends && known && f->feed != END);
}

static int has_ends(const Ports *c, const Stranger *s)
{
    for (const Feed *f = s->feeds; f < s->feeds + s->n_feeds; f++)
        if (has_end(c, f))
            return 1;
    return 0;
}

/* Gives the inputs of an FMU the values that they have at the end of a step. */
static void take_ends(Ports *c, Stranger *s, double time)
{
    for (const Feed *f = s->feeds; f < s->feeds + s->n_feeds; f++) {
        const int64_t k = f->origin.place;
        if (!has_end(c, f))
            continue;
        if (f->origin.kind == FROM_PROBE)
            *f->input = f->origin.scale * c->now[k] + f->origin.offset;
        if (f->origin.kind == FROM_OUTPUT)
            *f->input = f->origin.scale * c->outputs[k] + f->origin.offset;
        if (f->origin.kind == FROM_DRIVE)
            *f->input = f->origin.scale * drive_before(c, time) + f->origin.offset;
    }
}

/* What it then puts out. */
static int refresh(Ports *c, Stranger *s, double time)
{
    take_ends(c, s, time);
    return set_inputs(s) && get_outputs(s);
}

/* Where steps are repeated, what the FMUs put out at the start. */
static int refresh_all(Ports *c)
{
    for (Stranger *s = c->fmus; c->repeats && s < c->fmus + c->n_fmus; s++)
        if (!refresh(c, s, 0.0))
            return fmu_failed(c, s);
    return 1;
}

static int restore_all(Ports *c)
{
    for (Stranger *s = c->fmus; s < c->fmus + c->n_fmus; s++)
        if (!fmu_restore(s->fmu, s->restore, s->state))
            return fmu_failed(c, s);
    return 1;
}

/* One after another, what comes back from a later one being known. */
static int step_once(Ports *c, double time)
{
    const double h = time - c->origin;
    /* An FMU with steps of its own may refuse one that rounding has made longer or shorter. */
    const double whole = fabs(h - c->macro_step) <= ROUNDING * h ? c->macro_step : h;
    for (Stranger *s = c->fmus; s < c->fmus + c->n_fmus; s++) {
        for (const Feed *f = s->feeds; f < s->feeds + s->n_feeds; f++)
            feed(c, f, time, h);
        s->fmu->time = c->origin;
        if (!set_inputs(s) || !s->fmu->step(s->fmu, whole) || !get_outputs(s) ||
            (has_ends(c, s) && !refresh(c, s, time)))
            return fmu_failed(c, s);
        s->fmu->time = time;
    }
    return 1;
}

/* How far off a value comes per change of what was taken for it, by the secant: `more` was added, it
   was off by `before` and is by `off`. A change within the tolerance, or as small beside `off`, is
   rounding: what followed it is another value's doing. */
static double response(double known, double more, double off, double before, double within,
                       double tolerance)
{
    if (fabs(more) > fmax(within, tolerance * fabs(off)))
        return (off - before) / more;
    return fabs(off) > within ? -1.0 : known;
}

/* Whether what has come back is what was taken for it; else what to take next, by the secant. */
static int comes_back(Ports *c, int tries)
{
    int agree = 1;
    for (int64_t k = 0; k < c->n_outputs; k++) {
        Back *const b = &c->backs[k];
        if (!b->is_one)
            continue;
        const double off = c->outputs[k] - b->guess, more = b->guess - b->last_guess;
        const double within = c->tolerance * fmax(b->largest, fabs(b->guess));
        const double told = response(b->response, more, off, b->off, within, c->tolerance);
        if (!isfinite(off)) /* which ends the run */
            return 1;
        if (tries == 0)
            b->response = -1.0;
        else if (isfinite(told) && fabs(told) > 1e-3)
            b->response = told;
        b->off = off;
        b->last_guess = b->guess;
        agree &= fabs(off) <= within;
    }
    for (Back *b = c->backs; b < c->backs + c->n_outputs; b++) {
        if (b->is_one && agree)
            b->largest = fmax(b->largest, fabs(b->guess));
        else if (b->is_one)
            b->guess -= b->off / b->response;
    }
    return agree;
}

/* All FMUs from the communication point to `time`. What an FMU takes from one that steps after it goes
   on along its line; where steps are repeated, they are until it does what was taken. */
static int step_all(Ports *c, double time)
{
    for (Stranger *s = c->fmus; s < c->fmus + c->n_fmus; s++)
        for (const Feed *f = s->feeds; f < s->feeds + s->n_feeds; f++)
            if (f->origin.kind == FROM_OUTPUT)
                c->backs[f->origin.place].guess =
                    c->before[f->origin.place] + (time - c->origin) * rate_of(c, &f->origin);
    for (int tries = 0; tries <= MOST_TRIES; tries++) {
        for (int64_t k = 0; k < c->n_outputs; k++)
            if (c->backs[k].is_one)
                c->outputs[k] = c->backs[k].guess;
        if ((tries > 0 && !restore_all(c)) || !step_once(c, time))
            return 0;
        if (!c->repeats || comes_back(c, tries)) {
            for (Stranger *s = c->fmus; s < c->fmus + c->n_fmus; s++)
                s->fmu->steps++;
            return 1;
        }
    }
    c->status = NO_AGREEMENT;
    return 0;
}

/* The step once more from the saved states: what is other now was not restored. */
static int step_again(Ports *c, double time)
{
    double *const first = c->odd + c->n_outputs;
    memcpy(first, c->outputs, (size_t)c->n_outputs * sizeof *first);
    if (!restore_all(c) || !step_all(c, time))
        return 0;
    for (Stranger *s = c->fmus; s < c->fmus + c->n_fmus; s++)
        s->fmu->steps--;
    for (int64_t k = 0; k < c->n_outputs; k++) {
        const double off = fabs(c->outputs[k] - first[k]), moved = fabs(first[k] - c->before[k]);
        if (off > fmax(OTHER * moved, ROUNDING * fabs(first[k])))
            c->odd[k] = 1.0;
    }
    return 1;
}

static int save_all(Ports *c)
{
    for (Stranger *s = c->fmus; c->repeats && s < c->fmus + c->n_fmus; s++)
        if (!fmu_save(s->fmu, s->save, &s->state))
            return fmu_failed(c, s);
    return 1;
}

/* --- communication points --- */

/* Over a step an output changes by a slope between those at both ends; where that is seldom so, what
   the FMU tells is not its slope. Jumps are seldom, too, steps of the FMU's own are many of these, and
   what has no slope at all is held. */
static void judge_slopes(Ports *c, double h)
{
    for (Slope *t = c->slopes; t < c->slopes + c->n_slopes; t++) {
        const double value = c->outputs[t->place];
        const double start = h * c->before[t->slope], end = h * c->outputs[t->slope];
        if (t->wrong >= WRONG || !isfinite(start + end) || (start == 0.0 && end == 0.0))
            continue;
        t->largest = fmax(t->largest, fabs(value));
        t->change += value - c->before[t->place];
        t->least += fmin(start, end);
        t->most += fmax(start, end);
        if (!(fabs(t->change) > fmax(NOISE * t->largest, AT_REST)))
            continue;
        const double off = fmax(t->change - t->most, t->least - t->change);
        t->wrong += off > FAR * fabs(t->change) ? 1 : -RIGHT;
        t->wrong = t->wrong < 0 ? 0 : t->wrong;
        t->change = t->least = t->most = 0.0;
    }
}

static void write_point(Ports *c, double time)
{
    double *row = c->points + c->n_points++ * (1 + c->n_outputs);
    *row++ = time;
    memcpy(row, c->outputs, (size_t)c->n_outputs * sizeof *row);
}

/* How much the FMUs feed through, by what they answer to a nudge, one after another. */
static int learn(Ports *c)
{
    c->learn = 0;
    for (Through *t = c->throughs; t < c->throughs + c->n_throughs; t++) {
        Stranger *const first = &c->fmus[t->first], *const last = &c->fmus[t->last];
        const double given = *t->input, nudge = NUDGE * fmax(fabs(given), 1.0);
        *t->input = given + nudge;
        for (Stranger *s = first; s <= last; s++)
            if (s == first ? !set_inputs(s) || !get_outputs(s) : !refresh(c, s, c->time))
                return fmu_failed(c, s);
        const double gain = t->scale * (c->outputs[t->output] - c->before[t->output]) / nudge;
        t->next_gain = isfinite(gain) ? gain : 0.0;
        *t->input = given;
        memcpy(c->outputs, c->before, (size_t)c->n_outputs * sizeof *c->outputs);
        for (Stranger *s = first; s <= last; s++) {
            if (s > first)
                take_ends(c, s, c->time);
            if (!fmu_restore(s->fmu, s->restore, s->state))
                return fmu_failed(c, s);
        }
    }
    return 1;
}

/* A communication point at the time of the last accepted one: from here on a new one begins. */
static void begin_exchange(Ports *c)
{
    const double time = c->time, h = time - c->origin;
    judge_slopes(c, h);
    if (is_telling(c, h))
        for (int64_t k = 0; k < c->n_outputs; k++)
            c->rates[k] = (c->outputs[k] - c->before[k]) / h;
    memcpy(c->before, c->outputs, (size_t)c->n_outputs * sizeof *c->before);
    if (!save_all(c) || (c->learn && !learn(c)))
        return;
    set_lines(c);
    for (Through *t = c->throughs; t < c->throughs + c->n_throughs; t++)
        t->gain = t->next_gain;
    memcpy(c->start, c->now, (size_t)c->n_saved * sizeof *c->start);
    memset(c->charges, 0, (size_t)c->n_saved * sizeof *c->charges);
    c->drive_charge = 0.0;
    c->origin = time;
    c->met_before = c->met;
    c->met = 0;
    c->end = c->macro_step > 0.0 ? time + c->macro_step : -INFINITY;
    if (c->macro_step > 0.0 && !c->fixed) {
        c->end = fmin(c->end, c->jump);
        if (time < c->duration - ON_TIME)
            c->end = fmin(c->end, c->duration);
    }
    c->exchanged++;
    write_point(c, time);
}

static double *log_row(const Ports *c)
{
    return c->log + c->n_log * (1 + c->n_sources + c->n_saved);
}

/* Of what the circuit and the FMUs are given; no number where one of them is none. */
static double sum_of_read(const Ports *c)
{
    double sum = 0.0;
    for (int64_t k = 0; k < c->n_saved; k++)
        sum += c->now[k];
    for (const Source *s = c->sources; s < c->sources + c->n_sources; s++)
        if (s->origin.kind == FROM_OUTPUT)
            sum += c->outputs[s->origin.place];
    for (const Stranger *s = c->fmus; s < c->fmus + c->n_fmus; s++)
        for (const Feed *f = s->feeds; f < s->feeds + s->n_feeds; f++)
            if (f->origin.kind == FROM_OUTPUT)
                sum += c->outputs[f->origin.place];
    return sum;
}

static double accepted(Ports *c, double time, double next_step)
{
    if (!isfinite(sum_of_read(c))) {
        c->told = time;
        c->status = NOT_FINITE;
        return next_step;
    }
    double *row = log_row(c);
    *row++ = time;
    for (int64_t k = 0; k < c->n_sources; k++)
        *row++ = source_value(c, &c->sources[k], time);
    memcpy(row, c->now, (size_t)c->n_saved * sizeof *row);
    c->n_log++;
    c->logged++;
    c->learn |= c->tries > 0;
    c->tries = 0;
    const int at_jump = c->driven && time >= c->jump - ON_TIME;
    if (at_jump)
        c->jump = piece_at(&c->drive, c->jump)->jump;
    if (time <= 0.0) {
        memcpy(c->last, c->now, (size_t)c->n_saved * sizeof *c->last);
        if (refresh_all(c))
            begin_exchange(c);
    } else {
        /* The last step may be so short that the time stays the same. */
        const int meets = time >= c->end - ON_TIME && time > c->origin;
        if (meets && !c->stepped && !step_all(c, time))
            return next_step;
        c->stepped = 0;
        for (int64_t k = 0; k < c->n_saved; k++)
            c->charges[k] += 0.5 * (time - c->time) * (c->last[k] + c->now[k]);
        if (c->driven)
            c->drive_charge += drive_integral(c, time);
        memcpy(c->last, c->now, (size_t)c->n_saved * sizeof *c->last);
        c->time = time;
        if (meets)
            begin_exchange(c);
    }
    announce(&c->pulses, time);
    if (time <= 0.0 || at_jump)
        c->jumped = time;
    next_step = fmin(next_step, c->after_jump + GROWTH * (time - c->jumped));
    if (c->repeats)
        next_step = fmin(next_step, fmax(HALF * (c->duration - time), LAST * c->after_jump));
    next_step = cut(next_step, time, c->end);
    if (c->driven)
        next_step = cut(cut(next_step, time, piece_at(&c->drive, time)->until), time, c->jump);
    return next_step;
}

/* --- attempts that are repeated --- */

/* Device parameters are asked for in another plot: an asked one becomes a vector of the current plot,
   over which SendData then runs. Where nothing is asked for but what leads to FMUs, ngspice stays in
   that plot, which has no more vectors than the run's own, and what it sends is not looked at. */

static int stays_aside(const Ports *c)
{
    return c->repeats && c->n_saved && c->n_probed == c->n_saved;
}

static void set_plot(Ports *c, const char *name)
{
    char text[160];
    snprintf(text, sizeof text, "setplot %s", name);
    ((Command *)c->command)(text);
}

static void go_aside(Ports *c)
{
    if (c->plot_name[0]) {
        set_plot(c, "const");
        return;
    }
    snprintf(c->plot_name, sizeof c->plot_name, "%s", ((PlotName *)c->plot)());
    set_plot(c, stays_aside(c) ? "new" : "const");
}

static int ask(Ports *c)
{
    char text[160];
    if (!stays_aside(c) || !c->plot_name[0])
        go_aside(c);
    for (int64_t k = 0; k < c->n_probed; k++) {
        /* What was asked for last is still there: SendData needs a vector. */
        snprintf(text, sizeof text, "unlet %s", c->asked[k]);
        ((Command *)c->command)(text);
        snprintf(text, sizeof text, "%s", c->asked[k]);
        const VectorInfo *found = ((Ask *)c->ask)(text);
        if (found && found->real && found->length > 0)
            c->now[k] = *found->real;
        else
            c->status = NOT_FINITE;
    }
    if (!stays_aside(c))
        set_plot(c, c->plot_name);
    return going(c);
}

/* How far an FMU's output ends from where its line from the communication point leads. */
static double off_line(const Ports *c, const Source *s, double h)
{
    const int known = s->origin.slope != DIFFERENCE || c->exchanged > 1;
    return s->origin.kind == FROM_OUTPUT && known ? fabs(s->guess - (s->value + s->line * h)) : 0.0;
}

/* Whether an output does that by an event within a step of `h` (s). */
static int leaves_line(const Ports *c, double h)
{
    for (const Source *s = c->sources; s < c->sources + c->n_sources; s++)
        if (off_line(c, s, h) > EVENT * s->largest + BENT * s->bend * h * h)
            return 1;
    return 0;
}

/* Keeps how the outputs bend, once a step of `h` (s) is done. */
static void keep_bends(Ports *c, double h)
{
    for (Source *s = c->sources; s < c->sources + c->n_sources; s++) {
        const double off = off_line(c, s, h);
        s->bend = !c->met && off > TELLING * EVENT * s->largest ? off / (h * h) : 0.0;
    }
}

/* The step under way once more, with this length, and the sources as before its first attempt. */
static int again_along_lines(Ports *c, double *delta, double length)
{
    for (Source *s = c->sources; s < c->sources + c->n_sources; s++)
        s->rate = s->origin.kind == FROM_OUTPUT ? s->line : s->rate;
    c->tries = 0;
    c->redone++;
    *delta = length;
    return 1;
}

/* Whether the attempt that has converged at `time` is to be repeated. Where an output jumps when the
   circuit reaches a value, and the circuit leaves it when the output jumps, none agrees: then the
   step within which that lies is taken as the lines lead, and the source jumps at its end. */
static int to_repeat(Ports *c, double time, double *delta, double old_delta)
{
    if (c->stepped && !restore_all(c))
        return 0;
    c->stepped = 0;
    /* At its end ngspice may go on in steps that do not change the time. */
    if (time <= c->origin || !ask(c) || time + old_delta > c->duration)
        return 0;
    c->stepped = 1;
    const int looks = c->exchanged <= CHECKED || !(c->exchanged & (c->exchanged - 1));
    if (!step_all(c, time) || (looks && !step_again(c, time)))
        return 0;
    int agree = 1;
    for (Source *s = c->sources; s < c->sources + c->n_sources; s++) {
        if (s->origin.kind != FROM_OUTPUT)
            continue;
        const double used = source_value(c, s, time), line = line_of(c, s, time);
        const double off = s->origin.scale * c->outputs[s->origin.place] + s->origin.offset +
                           s->correction - used;
        s->largest = fmax(s->largest, fabs(used));
        const double within = c->tolerance * s->largest;
        if (fabs(off) > within)
            agree = 0;
        if (c->tries > 0) {
            const double told =
                response(s->response, line - s->guess, off, s->off, within, c->tolerance);
            if (isfinite(told) && told < -1e-3)
                s->response = told;
        }
        s->guess = line;
        s->off = off;
    }
    const double h = time - c->origin;
    const int leaves = c->forced == c->exchanged || (agree && leaves_line(c, h));
    c->met = leaves && h <= EVENT_WITHIN;
    if (leaves && !c->met) /* a shorter step, to find when */
        return again_along_lines(c, delta, 0.5 * h);
    if (c->met)
        c->jumped = time;
    if (agree || c->met) {
        keep_bends(c, h);
        return 0;
    }
    if (++c->tries > MOST_TRIES && h > EVENT_WITHIN) /* perhaps it jumps when the circuit answers */
        return again_along_lines(c, delta, 0.5 * h);
    if (c->tries > MOST_TRIES && c->forced < c->exchanged - 1) {
        c->forced = c->exchanged;
        return again_along_lines(c, delta, old_delta);
    }
    if (c->tries > MOST_TRIES) {
        c->status = NO_AGREEMENT;
        return 0;
    }
    for (Source *s = c->sources; s < c->sources + c->n_sources; s++)
        if (s->origin.kind == FROM_OUTPUT)
            s->rate = (s->guess - s->off / s->response - s->value) / h;
    c->redone++;
    *delta = old_delta;
    return 1;
}

/* --- vectors that swing --- */

enum { WATCHED = 1024 };
static const double SWING = 1e-3; /* of a vector's largest magnitude; less is none */
static struct {
    double turned, most; /* the last extreme; the largest magnitude */
    int down, turns;
} watched[WATCHED];

static void watch(const VectorValues *data)
{
    for (int k = 0; k < data->count && k < WATCHED; k++) {
        const double value = data->vectors[k]->creal;
        const double on = watched[k].down ? watched[k].turned - value : value - watched[k].turned;
        watched[k].most = fmax(watched[k].most, fabs(value));
        if (on < -SWING * watched[k].most) {
            watched[k].down = !watched[k].down;
            watched[k].turns++;
        } else if (on < 0.0) {
            continue;
        }
        watched[k].turned = value;
    }
}

int ports_turns(int place)
{
    return place < WATCHED ? watched[place].turns : 0;
}

/* --- what ngspice calls --- */

static const char GAIN_NAME[] = "vcosim_gain"; /* then a place among the Throughs */

static int is_named(const Source *s, const char *node)
{
    size_t k = 0;
    while (s->name[k] && tolower((unsigned char)node[k]) == s->name[k])
        k++;
    return s->name[k] == node[k]; /* both at their end */
}

int ports_source(double *value, double time, const char *node)
{
    Ports *c = run;
    *value = NAN;
    if (!going(c))
        return 0;
    if (strncmp(node, GAIN_NAME, sizeof GAIN_NAME - 1) == 0) {
        *value = c->throughs[atoi(node + sizeof GAIN_NAME - 1)].gain;
        return 0;
    }
    const Source *s = c->sources;
    while (s < c->sources + c->n_sources && !is_named(s, node))
        s++;
    if (s == c->sources + c->n_sources) {
        snprintf(c->source, sizeof c->source, "%s", node);
        c->status = UNKNOWN_SOURCE;
        return 0;
    }
    *value = line_of(c, s, time) - carried(c, s, c->start);
    if (!going(c))
        *value = NAN;
    return 0;
}

int ports_data(const VectorValues *data)
{
    Ports *c = run;
    if (!c)
        return 0;
    if (stays_aside(c) && c->plot_name[0])
        return 0;
    for (int64_t k = 0; k < c->n_saved; k++)
        c->now[k] = data->vectors[c->places[k]]->creal;
    c->sent = data->vectors[c->places[c->n_saved]]->creal;
    watch(data);
    return 0;
}

int ports_step(double time, double *delta, double old_delta, int redo, int location)
{
    Ports *c = run;
    int again = 0;
    if (!going(c))
        return 0;
    if (location == 0) {
        c->told = time;
        *delta = accepted(c, time, *delta);
    } else {
        c->attempts++;
        c->quiet++;
        if (stays_aside(c) && !redo)
            c->sent = time;
        if (redo) /* ngspice itself repeats it, shorter */
            c->tries = 0;
        else if (c->repeats)
            again = to_repeat(c, time, delta, old_delta);
    }
    if (c->n_log == c->log_rows || c->quiet >= ATTEND_EVERY || loop_milliseconds() >= late) {
        c->quiet = 0;
        c->attend();
        late = loop_milliseconds() + LOOP_PATIENCE;
    }
    return again;
}

/* --- what Python calls --- */

/* At the operating point, too, the circuit carries what is fed through, as seen at the start values of
   the inputs. */
static void carry_from_start(Ports *c)
{
    for (const Stranger *s = c->fmus; s < c->fmus + c->n_fmus; s++)
        for (const Feed *f = s->feeds; f < s->feeds + s->n_feeds; f++)
            if (f->origin.kind == FROM_PROBE && f->origin.scale != 0.0)
                c->now[f->origin.place] = (*f->input - f->origin.offset) / f->origin.scale;
    memcpy(c->start, c->now, (size_t)c->n_saved * sizeof *c->start);
    if (!refresh_all(c))
        return;
    memcpy(c->before, c->outputs, (size_t)c->n_outputs * sizeof *c->before);
    if (save_all(c) && learn(c))
        for (Through *t = c->throughs; t < c->throughs + c->n_throughs; t++)
            t->gain = t->next_gain;
}

void ports_begin(Ports *c)
{
    memset(watched, 0, sizeof watched);
    for (Stranger *s = c->fmus; s < c->fmus + c->n_fmus; s++)
        if (!get_outputs(s))
            fmu_failed(c, s);
    for (Source *s = c->sources; s < c->sources + c->n_sources; s++)
        s->response = -1.0;
    if (going(c) && c->repeats)
        carry_from_start(c);
    memcpy(c->before, c->outputs, (size_t)c->n_outputs * sizeof *c->before);
    set_lines(c);
    c->learn = c->n_throughs > 0;
    c->forced = -1;
    c->jump = c->driven ? piece_at(&c->drive, 0.0)->jump : INFINITY;
    late = loop_milliseconds() + LOOP_PATIENCE;
    loop_sent = 0;
    run = c;
}

void ports_finish(Ports *c)
{
    if (going(c) && c->sent > c->told) {
        if (c->n_log == c->log_rows)
            c->attend();
        c->end = c->macro_step > 0.0 && !c->fixed ? fmin(c->end, c->sent) : c->end;
        accepted(c, c->sent, 0.0);
    }
    run = NULL;
}
