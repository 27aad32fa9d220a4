/* The callbacks of ngspice, which leads; for the order of its calls see cosim/circuit/ngspice.py.
   Python makes up for what is rare: it refills the pieces of the command and takes the log away,
   which is also when Ctrl-C acts and progress is told; and it is asked at the macro points of most
   coupling methods. */

#include "loop.h"

#include <ctype.h>
#include <math.h>
#include <stddef.h>
#include <string.h>

/* The lengths of steps and changes below hold for a fineness of 1; finer runs divide all of them by
   it, so that no fixed one makes runs of different tolerances err alike. */

static const double ON_TIME = 1e-13;
/* s; ngspice's own sums of steps reach a time of ours only within rounding */

static const double OPERATING_END = 1e-5 * (1.0 - 1e-15);
/* s; to here, but for rounding, lead the steps (OPTRAN) by which ngspice seeks an operating point that
   it finds in no other way. It cuts a step beyond it to end shortly before, and never comes to it. */

static const double PAST_IMPACT = 1e-9;
/* s; a step that is to end on an impact ends so much later, so that it holds the impact */

static const double CARRIED = 0.2;
/* Share of the flux still owed to the circuit that the next step pays back. With equal steps what is
   owed dies out by 0.77 a step; it still dies out where the steps double. */

static const double AT_LIMIT = 0.5; /* V; |v(swing)| from which on the output is at its limit */

static const double REACH = 0.05;
/* Of the range between its limits: so near to one, the output may reach it where its way is not
   straight. */

static const double EMF_OF_ROOM = 0.1;
/* Most that the back-EMF may change in a step, of what the output has left until its limit: till
   there the amplifier makes up for what the back-EMF is off. */

static const double STEPS_OF_SINE = 200.0;
/* A period's least number: the mechanics take the current as straight within a step. */

static const double SMALL_JUMP = 0.1;
/* In units of the command's range: the first step after a jump grows as that is smaller, till here. */

static const double SETTLED_SHARE = 0.0025; /* of the command's range: an answer that is over */

static const int64_t ATTEND_EVERY = 4096; /* attempted steps; some ten milliseconds */

static const double ONE = 1e-12; /* Of a period: corners nearer than that are one. */

typedef bool Announce(double);

static Lead *run; /* the one under way, or NULL */
int loop_sent;
static int64_t late; /* ms; when Python is to be called again, at the latest */

static int going(const Lead *c)
{
    return c && c->status == GOOD && !c->stopped;
}

/* --- the command --- */

enum { EMF, GAIN, COMMAND, DAC, PIN, UNKNOWN };

static int kind_of(const Lead *c, const char *name)
{
    for (int k = 0; k < UNKNOWN; k++) {
        const char *const known = c->names[k];
        size_t i = 0;
        while (known[i] && tolower((unsigned char)name[i]) == known[i])
            i++;
        if (known[i] == name[i]) /* both at their end */
            return k;
    }
    return UNKNOWN;
}

static double back_emf(const Lead *c, double t)
{
    const Segment *s = &c->segment;
    t -= s->origin;
    return s->c[2] == 0.0 ? s->c[0] + s->c[1] * t : s->c[0] + t * (s->c[1] + t * s->c[2]);
}

static double pin_of(const Lead *c, int source, const Piece *p, double command)
{
    if (source == PIN)
        return p->pin;
    if (source == COMMAND)
        return command;
    return p->kind == LEVEL ? p->dac : c->v_offset - command / c->gain;
}

/* A source that follows the command keeps its left limit until a step has ended on the jump. */
static double held(Lead *c, int source, double t)
{
    if (t <= 0.0)
        return source == COMMAND ? 0.0 : c->v_offset;
    if (t >= c->jump - ON_TIME) {
        const Piece *before = piece_at(&c->drive, nextafter(c->jump, 0.0));
        return pin_of(c, source, before, before->end);
    }
    const Piece *p = piece_at(&c->drive, t);
    return pin_of(c, source, p, command_value(p, t));
}

/* --- the log and the mechanics --- */

/* The row of the log that is filled next. */
static double *row_of(const Lead *c)
{
    return c->log + c->n_log * (LOG_SAVED + c->n_saved);
}

static void write_down(Lead *c, double time, double emf)
{
    double *row = row_of(c);
    row[LOG_TIME] = time;
    row[LOG_EMF] = emf;
    row[LOG_OWED] = c->owed;
    c->n_log++;
    c->logged++;
}

/* V s; how far the flux given to the circuit lags that of the mechanics, at a macro point. */
static double flux_owed(const Lead *c)
{
    return c->recorder->outputs[FLUX] - c->flux_at_start - c->given;
}

static void set_line(Lead *c, double emf, double slope)
{
    c->segment = (Segment){
        .origin = c->time, .c = {emf, slope, 0.0}, .end = -INFINITY, .start = c->current};
}

/* As cosim/coupling/methods/step_locked.py says. */
void macro_point_step_locked(Lead *c)
{
    /* After a step that was cut to next to nothing, a pulse as short as that would be as high. */
    const double h = fmax(c->time - c->segment.origin, c->after_jump);
    if (!recorder_advance(c->recorder, c->time, c->segment.start, c->current)) {
        c->status = FMU_FAILED;
        return;
    }
    const double *found = c->recorder->outputs;
    set_line(c, found[BACK_EMF] + CARRIED * flux_owed(c) / h, found[SLOPE]);
    c->impact = c->time + found[TIME_TO_IMPACT] + PAST_IMPACT;
}

void macro_point_replayed(Lead *c)
{
    set_line(c, c->replay[0], c->replay[1]);
    c->impact = c->replay[2];
    c->replay += 3;
}

/* The coil's current answers a jump of the command with its own time constant. By its truncation
   error ngspice would take a third of that in a step and lose some 0.1 % of the charge. */
static void pass_jump(Lead *c)
{
    const double before = piece_at(&c->drive, nextafter(c->jump, 0.0))->end;
    const Piece *p = piece_at(&c->drive, c->jump);
    const double share = fabs(command_value(p, c->jump) - before) / c->range;
    c->restart_step = c->after_jump / fmax(share, SMALL_JUMP);
    if (share > SETTLED_SHARE)
        c->answered = fmax(c->answered, c->jump + c->time_constant * log(share / SETTLED_SHARE));
    c->jump = p->jump;
}

/* What is left of the answer to a jump falls by e in a time constant; ngspice's rule is of second order,
   so that steps which grow by the cube root of that err alike. */
static double step_of_answer(const Lead *c)
{
    const double gone = log(1.0 / SETTLED_SHARE) - (c->answered - c->time) / c->time_constant;
    return c->answer_step / 1.5 * exp(gone / 3.0);
}

/* Whether the output, which goes on as in the last step, of the length h (s), may reach a limit within
   the longest step. */
static int is_near_limit(Lead *c, double output, double h)
{
    const double rate = h > 0.0 ? (output - c->output) / h : 0.0;
    const double reach = REACH * (c->output_high - c->output_low);
    const double ahead = output + rate * c->max_step;
    c->output = output;
    return fmax(output, ahead) > c->output_high - reach || fmin(output, ahead) < c->output_low + reach;
}

/* The longest next step for what lies behind. ngspice judges its steps by their truncation errors
   alone, which are small where the current is wrong for long. */
static double longest_step(Lead *c, const double *values, double h)
{
    double step = INFINITY;
    if (is_near_limit(c, values[OUTPUT], h))
        step = c->near_step;
    const Piece *p = &c->drive.pieces[c->drive.now];
    if (p->kind == SINE)
        step = fmin(step, 1.0 / (c->fineness * STEPS_OF_SINE * p->rate));
    if (c->at_jump)
        step = fmin(step, c->restart_step);
    if (c->time >= c->impact - ON_TIME)
        step = fmin(step, c->after_jump);
    if (c->time < c->answered)
        step = fmin(step, step_of_answer(c));
    if (c->swing >= 0 && fabs(values[c->swing]) >= AT_LIMIT)
        step = fmin(step, c->limited_step);
    return step;
}

/* A step that may not pass `end`. Ends that rounding alone parts are one: ngspice cuts the step on
   its own sources' edges itself, and between two such ends it would begin again from 1e-18 s. */
double cut(double step, double time, double end)
{
    const double left = end - time;
    return left > ON_TIME && left < step - ON_TIME ? left : step;
}

/* ngspice sets the next edge of a PULSE only if a step was cut to end on this one, to 1e-7 of the width.
   A step that ends there by itself loses all further ones in silence, and so does the rounding of times
   with a narrow one, as a triangle has it. So they are announced here, two ahead. */
void announce(Pulses *pulses, double time)
{
    for (Pulse *p = pulses->all; p < pulses->all + pulses->n; p++)
        while (p->previous <= time && p->announced <= pulses->duration) {
            p->previous = p->announced;
            if (++p->corner == p->n) {
                p->corner = 0;
                p->cycle += 1.0;
            }
            p->announced = p->delay + p->cycle * p->period + p->corners[p->corner];
            if (p->announced > time && p->announced - p->previous > ONE * p->period)
                ((Announce *)pulses->announce)(p->announced);
        }
}

/* The values that were sent last stand where the next row of the log begins to be filled. */
static double accepted(Lead *c, double time, double next_step)
{
    double *row = row_of(c);
    const double *values = row + LOG_SAVED;
    double sum = 0.0;
    for (int64_t k = 0; k < c->n_saved; k++)
        sum += values[k];
    if (!isfinite(sum)) {
        c->told = time;
        c->status = NOT_FINITE;
        return next_step;
    }
    const double current = values[0] / c->count;
    c->carried = c->motional < 0 ? 0.0 : values[c->motional];
    const double emf = back_emf(c, time) + c->carried, h = time - c->time;
    write_down(c, time, emf);
    c->given += 0.5 * (c->emf + emf) * h;
    c->emf = emf;
    announce(&c->pulses, time);
    if (time <= 0.0)
        return c->after_jump;
    c->segment.charge += 0.5 * (c->current + current) * h;
    c->time = time;
    c->current = current;
    c->at_jump = time >= c->jump - ON_TIME;
    if (c->at_jump)
        pass_jump(c);
    next_step = fmin(next_step, longest_step(c, values, h));
    if (time >= c->segment.end - ON_TIME) {
        c->macro_point(c);
        if (!going(c))
            return next_step;
        row[LOG_OWED] = c->owed = flux_owed(c);
    }
    next_step = cut(next_step, time, c->segment.end);
    /* A limit that a passing back-EMF touches is not to be stepped over. */
    const double room = fmin(c->output_high - c->output, c->output - c->output_low);
    const double change = fmax(c->emf_change, EMF_OF_ROOM * room) / c->fineness;
    next_step = fmin(next_step, fmax(change / fabs(c->segment.c[1]), c->answer_step));
    next_step = cut(next_step, time, c->impact);
    next_step = cut(next_step, time, piece_at(&c->drive, time)->until); /* V1 or its slope jumps */
    return cut(next_step, time, c->jump);
}

static void attend(Lead *c)
{
    c->quiet = 0;
    c->attend();
    late = loop_milliseconds() + LOOP_PATIENCE;
}

/* --- what ngspice calls --- */

EXPORT int lead_source(double *voltage, double time, const char *node, int ident, void *user)
{
    (void)ident, (void)user;
    Lead *c = run;
    if (!loop_sent)
        time = 0.0;
    if (!c)
        return ports_source(voltage, time, node);
    if (!going(c)) {
        *voltage = NAN;
        return 0;
    }
    const int source = kind_of(c, node);
    if (source == UNKNOWN) {
        strncpy(c->source, node, sizeof c->source - 1);
        c->status = UNKNOWN_SOURCE;
    }
    *voltage = source == EMF    ? back_emf(c, time)
               : source == GAIN ? c->segment.gain / c->count
                                : held(c, source, time);
    if (!going(c))
        *voltage = NAN;
    return 0;
}

EXPORT int lead_data(VectorValues *data, int n, int ident, void *user)
{
    (void)n, (void)ident, (void)user;
    Lead *c = run;
    loop_sent = 1;
    if (!c)
        return ports_data(data);
    double *values = row_of(c) + LOG_SAVED;
    for (int64_t k = 0; k < c->n_saved; k++)
        values[k] = data->vectors[c->places[k]]->creal;
    c->sent = data->vectors[c->places[c->n_saved]]->creal;
    return 0;
}

EXPORT int lead_step(double time, double *delta, double old_delta, int redo, int ident,
                     int location, void *user)
{
    (void)ident, (void)user;
    Lead *c = run;
    if (!loop_sent) {
        if (time < OPERATING_END)
            *delta = fmin(*delta, OPERATING_END - time);
        return 0;
    }
    if (!c)
        return ports_step(time, delta, old_delta, redo, location);
    if (!going(c))
        return 0;
    if (location == 0) {
        c->told = time;
        *delta = accepted(c, time, *delta);
    } else {
        c->attempts++;
        c->quiet++;
    }
    /* Only before a step's values are sent, or after they were used. */
    if (c->n_log == c->log_rows || c->quiet >= ATTEND_EVERY || loop_milliseconds() >= late)
        attend(c);
    return 0;
}

/* --- what Python calls --- */

void lead_begin(Lead *c)
{
    c->jump = piece_at(&c->drive, 0.0)->jump;
    c->impact = INFINITY;
    c->answer_step = c->time_constant / 28.0 / c->fineness;
    c->limited_step = c->time_constant / 5.0 / c->fineness;
    c->near_step = c->time_constant / c->fineness;
    c->answered = c->time_constant * log(1.0 / SETTLED_SHARE); /* V1 leaves 0 at once */
    late = loop_milliseconds() + LOOP_PATIENCE;
    loop_sent = 0;
    run = c;
}

/* The last point, of which ngspice does not tell; then nothing is led any more. */
void lead_finish(Lead *c)
{
    if (going(c) && c->sent > c->told)
        accepted(c, c->sent, 0.0);
    run = NULL;
}

int64_t loop_size(int which)
{
    const size_t sizes[] = {sizeof(Fmu), sizeof(Schedule), sizeof(Recorder), sizeof(Lead),
                            sizeof(Piece), sizeof(Group),    sizeof(Source),   sizeof(Feed),
                            sizeof(Stranger), sizeof(Pulse), sizeof(Through), sizeof(Slope),
                            sizeof(Ports)};
    return (int64_t)sizes[which];
}
