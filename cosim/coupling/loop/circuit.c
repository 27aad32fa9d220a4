/* The compiled twin of cosim/circuit/run.py and cosim/coupling/step_locked.py, as the callbacks of
   ngspice: the same arithmetic in the same order, so the same bits. For the order of the calls see
   cosim/circuit/ngspice.py. Python makes up for what is rare: it refills the pieces of the command
   and takes the log away, which is also when Ctrl-C acts and progress is told. */

#include "coupled.h"

#include <ctype.h>
#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <string.h>

static const double ON_TIME = 1e-13; /* s; as in cosim/circuit/run.py */
static const double PI = 3.141592653589793;

enum { LEVEL, RISE, FALL, SINE };

/* The command between two of its corners. */
typedef struct {
    double begin, until; /* s; it holds in [begin, until) */
    int64_t kind;
    double origin, rate, span, offset, amplitude;
    double dac, pin; /* V at the DAC, for a level only, and at the offset pin */
    double jump;     /* s; the next one after `begin` */
    double command_before, dac_before, pin_before; /* V; left limits there */
} Piece;

enum { GOOD, FMU_FAILED, NOT_FINITE, UNKNOWN_SOURCE };

typedef struct Circuit {
    Recorder *recorder;
    const double *replay; /* back-EMF and slope after each step, instead of the mechanics; or NULL */
    const Piece *pieces; /* in the order of time; one of them holds */
    int64_t n_pieces, piece;
    double gain, v_offset;       /* of the difference amplifier; mean voltage of the pin, V */
    double count;                /* of coils */
    double after_jump;           /* s; longest step after a jump of the command */
    double time, current, emf, slope; /* at the last accepted point; of one coil */
    double jump;                 /* s; the next one */
    double command_before, dac_before, pin_before; /* V; left limits there */
    double told;                 /* s; time of the last accepted step that ngspice told of */
    double sent;                 /* s; time of the last values that it sent */
    const int64_t *places;       /* of the saved vectors among those sent; then that of the time */
    int64_t n_saved;
    double *log;                 /* a row: time, back-EMF, the saved values */
    int64_t n_log, log_rows;     /* filled; places for */
    int64_t logged, attempts;    /* points and attempted steps so far */
    int64_t quiet;               /* attempts since Python was last called */
    int64_t status;
    int64_t stopped;             /* by Python: nothing is to be done any more */
    char source[64];             /* name of the one that nothing feeds */
    void (*refill)(void);        /* makes the first piece the one that holds at `time` */
    void (*attend)(void);        /* empties the log */
} Circuit;

typedef struct {
    char *name;
    double creal, cimag;
    bool is_scale, is_complex;
} VectorValue; /* ngspice's vecvalues */

typedef struct {
    int count, index;
    VectorValue **vectors;
} VectorValues; /* ngspice's vecvaluesall */

typedef int SendData(VectorValues *, int, int, void *);

static const int64_t ATTEND_EVERY = 4096; /* attempted steps; some ten milliseconds */

static Circuit *run;         /* the one under way, or NULL */
static SendData *plain_data; /* whom the data are for when none is */

static int going(const Circuit *c)
{
    return c && c->status == GOOD && !c->stopped;
}

/* --- the command --- */

static double command_of(const Piece *p, double t)
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

static const Piece *piece_at(Circuit *c, double t)
{
    while (t >= c->pieces[c->piece].until) {
        if (c->piece + 1 < c->n_pieces) {
            c->piece++;
            continue;
        }
        const double last = c->pieces[c->piece].until;
        c->refill();
        if (!going(c) || c->pieces[c->n_pieces - 1].until <= last)
            break;
    }
    while (c->piece > 0 && t < c->pieces[c->piece].begin)
        c->piece--;
    return &c->pieces[c->piece];
}

/* Look for the first jump after `t`. */
static void expect_jump(Circuit *c, double t)
{
    const Piece *p = piece_at(c, t);
    c->jump = p->jump;
    c->command_before = p->command_before;
    c->dac_before = p->dac_before;
    c->pin_before = p->pin_before;
}

enum { EMF, COMMAND, DAC, PIN, UNKNOWN };

static int kind_of(const char *name)
{
    static const char *const NAMES[] = {"vemf", "vcommand", "vdac", "voffset"};
    for (int k = 0; k < UNKNOWN; k++) {
        size_t i = 0;
        while (NAMES[k][i] && tolower((unsigned char)name[i]) == NAMES[k][i])
            i++;
        if (NAMES[k][i] == name[i]) /* both at their end */
            return k;
    }
    return UNKNOWN;
}

static double back_emf(const Circuit *c, double t)
{
    return c->emf + c->slope * (t - c->time);
}

/* A source that follows the command keeps its left limit until a step has ended on the jump. */
static double held(Circuit *c, int source, double t)
{
    if (t <= 0.0)
        return source == COMMAND ? 0.0 : c->v_offset;
    if (t >= c->jump - ON_TIME)
        return source == COMMAND ? c->command_before : source == DAC ? c->dac_before : c->pin_before;
    const Piece *p = piece_at(c, t);
    if (source == PIN)
        return p->pin;
    if (source == COMMAND)
        return command_of(p, t);
    return p->kind == LEVEL ? p->dac : c->v_offset - command_of(p, t) / c->gain;
}

/* --- the log and the mechanics --- */

static void write_down(Circuit *c, double time)
{
    c->log[c->n_log * (2 + c->n_saved)] = time;
    c->log[c->n_log * (2 + c->n_saved) + 1] = back_emf(c, time);
    c->n_log++;
    c->logged++;
}

/* The values that were sent last stand where the next row of the log begins to be filled. */
static double accepted(Circuit *c, double time, double next_step)
{
    const double *values = c->log + c->n_log * (2 + c->n_saved) + 2;
    double sum = 0.0;
    for (int64_t k = 0; k < c->n_saved; k++)
        sum += values[k];
    if (!isfinite(sum)) {
        c->told = time;
        c->status = NOT_FINITE;
        return next_step;
    }
    const double current = values[0] / c->count;
    write_down(c, time);
    if (time <= 0.0)
        return c->after_jump;
    const double *outputs;
    if (c->replay) {
        outputs = c->replay;
        c->replay += 2;
    } else if (recorder_follow(c->recorder, 1, &time, &c->current, &current, INT64_MAX / 2) == 1) {
        outputs = c->recorder->fmu->step_outputs;
    } else {
        c->status = FMU_FAILED;
        return next_step;
    }
    c->time = time;
    c->current = current;
    c->emf = outputs[0];
    c->slope = outputs[1];
    double longest = INFINITY;
    if (time >= c->jump - ON_TIME) {
        expect_jump(c, c->jump);
        longest = c->after_jump;
    }
    const double left = c->jump - time;
    next_step = longest < next_step ? longest : next_step;
    return left < next_step ? left : next_step;
}

static void attend(Circuit *c)
{
    c->quiet = 0;
    c->attend();
}

/* --- what ngspice calls --- */

EXPORT int coupled_source(double *voltage, double time, const char *node, int ident, void *user)
{
    (void)ident, (void)user;
    Circuit *c = run;
    if (!going(c)) {
        *voltage = NAN;
        return 0;
    }
    const int source = kind_of(node);
    if (source == UNKNOWN) {
        strncpy(c->source, node, sizeof c->source - 1);
        c->status = UNKNOWN_SOURCE;
    }
    *voltage = source == EMF ? back_emf(c, time) : held(c, source, time);
    if (!going(c))
        *voltage = NAN;
    return 0;
}

EXPORT int coupled_data(VectorValues *data, int n, int ident, void *user)
{
    Circuit *c = run;
    if (!c)
        return plain_data ? plain_data(data, n, ident, user) : 0;
    double *values = c->log + c->n_log * (2 + c->n_saved) + 2;
    for (int64_t k = 0; k < c->n_saved; k++)
        values[k] = data->vectors[c->places[k]]->creal;
    c->sent = data->vectors[c->places[c->n_saved]]->creal;
    return 0;
}

EXPORT int coupled_step(double time, double *delta, double old_delta, int redo, int ident,
                        int location, void *user)
{
    (void)old_delta, (void)redo, (void)ident, (void)user;
    Circuit *c = run;
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
    if (c->n_log == c->log_rows || c->quiet >= ATTEND_EVERY)
        attend(c);
    return 0;
}

/* --- what Python calls --- */

/* The data of runs that are not led from here go to this function. */
EXPORT void coupled_hand_on(SendData *function)
{
    plain_data = function;
}

EXPORT void coupled_lead(Circuit *c)
{
    expect_jump(c, 0.0);
    run = c;
}

/* The last point, of which ngspice does not tell; then nothing is led any more. */
EXPORT void coupled_finish(Circuit *c)
{
    if (going(c) && c->sent > c->told)
        accepted(c, c->sent, 0.0);
    run = NULL;
}

EXPORT int64_t coupled_size(int which)
{
    const size_t sizes[] = {sizeof(Fmu), sizeof(Recorder), sizeof(Circuit), sizeof(Piece)};
    return (int64_t)sizes[which];
}
