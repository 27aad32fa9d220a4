/* What the coupled loop's files share, and share with Python, which has the structures and functions
   from here (cosim/toolchain/libraries.py). SI throughout.

   Order of calls in a run that ngspice leads:

     lead_begin    the segment that begins at t = 0 is set
     for each macro step
         circuit steps, solved against the segment, whose last one ends on `segment.end`
         macro_point: moves the mechanics over the macro step, then sets the next segment
     lead_finish

   Without a circuit the mechanics are led by recorder_follow() alone. */

#ifndef LOOP_H
#define LOOP_H

#include "../../drive/command.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* --- fmu.c: one instance of an FMU, of FMI 2.0 or 3.0 --- */

typedef void (*AnyFunction)(void);

typedef struct Fmu {
    void *instance;
    AnyFunction set_reals, do_step, get_reals, get_integers; /* of its interface */
    /* Those of its version of FMI, bound once; false: `status` and `failed` tell why not. */
    int (*set)(struct Fmu *, const uint32_t *places, int64_t n, const double *values);
    int (*step)(struct Fmu *, double h);
    int (*get)(struct Fmu *, const uint32_t *places, int64_t n, double *values);
    int (*get_whole)(struct Fmu *, const uint32_t *places, int64_t n, int32_t *values);
    int32_t status;     /* of the last call; above 1, a warning, it failed */
    AnyFunction failed; /* which of them failed */
    double time;        /* reached */
    int64_t steps;      /* so far */
    int64_t goes_back;  /* whether a step may be repeated */
} Fmu;

EXPORT void fmu_bind(Fmu *f, int version);

enum { DOUBLES, FLOATS, INT8S, UINT8S, INT16S, UINT16S, INT32S, UINT32S, INT64S, UINT64S, BOOLS, INT_BOOLS };

/* Variables of one type, set or read in one call; all values are numbers on this side. */
typedef struct {
    AnyFunction call;
    const uint32_t *places;
    int64_t n, size; /* variables; values, of which an array has several */
    int64_t kind;    /* of the values, as the FMU has them; see the enum above */
    double *values;
    void *raw;       /* room for them as the FMU has them */
} Group;

/* False if they failed. */
int fmu_set_group(Fmu *f, const Group *group);
int fmu_get_group(Fmu *f, const Group *group);
/* Sets or reads the time derivatives of `n` reals, as `call` does. */
int fmu_slopes(Fmu *f, AnyFunction call, const uint32_t *places, int64_t n, double *slopes);
int fmu_save(Fmu *f, AnyFunction call, void **state);
int fmu_restore(Fmu *f, AnyFunction call, void *state);

/* --- recorder.c: moves the mechanics and writes down what they do --- */

/* ms; so long at most, and one step of the FMU, goes by until Python can look for Ctrl-C, however
   slow the steps are. */
enum { LOOP_PATIENCE = 100 };
int64_t loop_milliseconds(void); /* of a clock that goes on evenly */

/* A quantity over time: linear between its corners, where it may jump, and constant outside. */
typedef struct {
    const double *times, *values;
    int64_t n;
} Schedule;

/* Places among the outputs of a step: V, V/s, V s, s. */
enum { BACK_EMF, SLOPE, FLUX, TIME_TO_IMPACT, EXTREMES };

enum { ROW = 1, FRAME = 2, SETTLED = 4, PART = 8 }; /* what is to be written down at a time */

typedef struct Recorder {
    Fmu *fmu;
    /* Variables by their roles; `places` are value references. */
    const uint32_t *input_places; /* of each input: its value, its slope; then inputs_hold_for */
    int64_t ports;                /* inputs that are led from outside, linear over an interval */
    const Schedule *schedule;     /* of one more input that follows the time alone; or NULL */
    const uint32_t *step_places;  /* as the enum above has them, then pairs of maximum and minimum */
    int64_t step_outputs;
    const uint32_t *real_places, *whole_places; /* of a row: the reals, then the whole numbers */
    int64_t reals, wholes;
    const uint32_t *total_places, *counter_places;
    int64_t totals, counters;
    double *inputs;  /* as set last */
    double *outputs; /* as read at the end of the last interval; the extremes, when they were read last */
    double settle;
    const double *times; /* at which something is to be written down; the last of all is endless */
    const int32_t *what;
    int64_t n_times, next;
    double *rows, *frames, *parts;
    int64_t n_rows, n_frames, n_parts; /* since Python took them away */
    int64_t z_surface, z_part;         /* their places in a row */
    double *totals_at_settle;
    int32_t *counters_at_settle;
    double *extremes;    /* pairs, as the step's outputs have them */
    double began;        /* of the interval under way */
    double holds_until;  /* how long the inputs go on as they were set last; s */
    int64_t inside;      /* whether one is */
    void (*plan)(void);  /* Python takes rows, frames and parts away, and gives the next times */
    int64_t stopped;     /* by Python: it failed there */
} Recorder;

/* Write down what is asked for at time 0; false if it failed. */
EXPORT int recorder_begin(Recorder *r);

/* Advance through `n` intervals that end at `edges`; in each, every port's input goes linearly from
   `start` to `end` (a row of `ports` values for each interval). Not further once `most` steps were
   made or LOOP_PATIENCE is over, perhaps within an interval, and then to be called again with the
   rest. Gives how many intervals were finished, or -1 if something failed. */
EXPORT int64_t recorder_follow(Recorder *r, int64_t n, const double *edges, const double *start,
                               const double *end, int64_t most);

/* One interval of a recorder with one port; false if it failed. */
EXPORT int recorder_advance(Recorder *r, double time, double start, double end);

/* The same; where `value` is not the `end`, the outputs are then calculated anew with it. */
EXPORT int recorder_exchange(Recorder *r, double time, double start, double end, double value);

/* --- lead.c: the callbacks of ngspice, which leads --- */

typedef struct {
    char *name;
    double creal, cimag;
    bool is_scale, is_complex;
} VectorValue; /* ngspice's vecvalues */

typedef struct {
    int count, index;
    VectorValue **vectors;
} VectorValues; /* ngspice's vecvaluesall */

/* What the circuit knows of the mechanics between two macro points. */
typedef struct {
    double origin; /* s; the macro point that it begins at */
    double c[3];   /* back-EMF of one coil about it: V, V/s, V/s² */
    double gain;   /* V/(A s); with it the circuit carries a share of the back-EMF itself */
    double end;    /* s; the next macro point; -inf: each accepted step ends on one */
    double start;  /* A; current of one coil at `origin` */
    double charge; /* A s; integral of that current since then */
} Segment;

/* Places in a row of the log; the saved values follow them. */
enum { LOG_TIME, LOG_EMF, LOG_OWED, LOG_SAVED };

/* Places among the saved values: REQUIRED in cosim/circuit/netlist.py. */
enum { CURRENT, OUTPUT };

/* The edges of a PULSE, which ngspice can lose; see announce(). */
typedef struct {
    double delay, period, corners[4]; /* s; corners since the beginning of a period */
    int64_t n;                        /* of corners */
    double cycle;                     /* of the one that was announced last */
    int64_t corner;
    double previous, announced;       /* s; the last two */
} Pulse;

/* All of a run. */
typedef struct {
    Pulse *all;
    int64_t n;
    AnyFunction announce;             /* ngspice's */
    double duration;                  /* s */
} Pulses;

typedef struct Lead {
    Recorder *recorder;
    void (*macro_point)(struct Lead *); /* see above; Python's takes no notice of the argument */
    Segment segment;
    const double *replay; /* back-EMF, slope and impact after each step, for macro_point_replayed() */
    Pieces drive;
    double gain, v_offset;        /* of the difference amplifier; mean voltage of the pin, V */
    double count;                 /* of coils */
    double after_jump;            /* s; longest step after a jump of the command */
    double fineness;              /* 1: as coarse as the lengths in lead.c; they are divided by it */
    double time_constant;         /* s; of the current in coil and sense resistor */
    double range;                 /* V; from the least to the largest command */
    double answer_step;           /* s; longest step while the current answers a jump */
    double limited_step;          /* s; longest step while the output is at its limit */
    double near_step;             /* s; longest step while the output may come to a limit */
    double restart_step;          /* s; longest step after the last jump */
    double max_step;              /* s; circuit.max_step */
    double output_high, output_low; /* V; limits of the output without current */
    double output;                /* V; at the last accepted point */
    double emf_change;            /* V; that the back-EMF may change in a step at the limits, too */
    double answered;              /* s; when it has done so */
    double time, current, carried; /* at the last accepted point: s; A of one coil; V carried */
    double emf;                    /* V; that the circuit had there */
    double given;                  /* V s; its integral since the start, by the trapezoidal rule */
    double owed;                   /* V s; flux of the mechanics less the given, at the macro point */
    double flux_at_start;          /* V s; that of the mechanics */
    double impact;                 /* s; a step ends on it, just after the ram meets a wall; inf: none */
    double jump;                  /* s; the command's next one */
    int64_t at_jump;              /* the macro point lies on one */
    double told;                  /* s; time of the last accepted step that ngspice told of */
    double sent;                  /* s; time of the last values that it sent */
    const int64_t *places;        /* of the saved vectors among those sent; then that of the time */
    int64_t n_saved;
    int64_t swing;                /* which of them tells that the output is at its limit; or -1 */
    int64_t motional;             /* which of them is the share that the circuit carries; or -1 */
    double *log;                  /* rows: see the enum above */
    int64_t n_log, log_rows;      /* filled; places for */
    int64_t logged, attempts;     /* points and attempted steps so far */
    int64_t quiet;                /* attempts since Python was last called */
    int64_t status;
    int64_t stopped;              /* by Python: nothing is to be done any more */
    char source[64];              /* name of the one that nothing feeds */
    Pulses pulses;
    char names[5][64];            /* of the back-EMF, its gain, the command, the DAC and the pin */
    void (*attend)(void);         /* empties the log */
} Lead;

enum { GOOD, FMU_FAILED, NOT_FINITE, UNKNOWN_SOURCE, NO_AGREEMENT };

/* macro_point of the method step-locked, and of a circuit alone whose back-EMF is a table. */
EXPORT void macro_point_step_locked(Lead *c);
EXPORT void macro_point_replayed(Lead *c);

EXPORT void lead_begin(Lead *c);
EXPORT void lead_finish(Lead *c);

double cut(double step, double time, double end);
void announce(Pulses *pulses, double time);

/* --- ports.c: a circuit and FMUs of the user's own; ngspice leads --- */

enum { FROM_PROBE, FROM_OUTPUT, FROM_DRIVE };
enum { HELD, DIFFERENCE, KNOWN };
enum { MEAN, LINE, END };

/* Where a port comes from: value = scale * what is there + offset. */
typedef struct {
    int64_t kind, place;       /* among the saved values, or the outputs of all FMUs */
    int64_t slope, slope_place; /* how an output goes on: see the enum above; KNOWN: that output */
    double scale, offset;
} Origin;

/* A source of the netlist; between two communication points a line. */
typedef struct {
    char name[64];
    Origin origin;
    double value, rate;        /* at the communication point; in a second */
    double line;               /* the rate before any attempt changed it */
    double through_rate;       /* in a second; what its Throughs had in the last step */
    double plain, correction;  /* the value is their sum */
    double owed;               /* of the FMU's integral, as in Lead */
    double guess, off;         /* of the last attempt: its line at the end, and what it lacked */
    double response;           /* d off / d guess, as last seen */
    double bend;               /* in a second squared; how the FMU left its line in the last step */
    double largest;            /* magnitude of its value so far */
} Source;

/* An input of an FMU. */
typedef struct {
    Origin origin;
    int64_t feed;
    double *input;
    double *slope;             /* of LINE; else NULL */
} Feed;

typedef struct {
    Fmu *fmu;
    const Group *inputs, *outputs;
    int64_t n_inputs, n_outputs;
    Feed *feeds;
    int64_t n_feeds;
    AnyFunction set_slopes, get_slopes;
    const uint32_t *input_slopes, *output_slopes; /* places of the reals whose slopes they are */
    int64_t n_input_slopes, n_output_slopes;
    double *input_rates, *output_rates;
    AnyFunction save, restore;
    void *state;               /* at the communication point, where steps are repeated */
    double *row;               /* its part of the outputs */
    int64_t width;
} Stranger;

/* Where FMUs feed a probe through to a source, the circuit itself carries that share: it adds the
   gain times the probe to the source. */
typedef struct {
    int64_t source, probe, first, last, output; /* places; from the first FMU through to the last */
    double *input;             /* of the first */
    double scale;              /* of both ports */
    double gain, next_gain;    /* as seen at the communication point before, and at this one */
} Through;

/* An output that leads to an FMU which steps before its own does; see step_all(). */
typedef struct {
    int64_t is_one;
    double guess, last_guess;  /* of this attempt and the last one: its value at the end */
    double off, response;      /* what that lacked; d off / d guess, as last seen */
    double largest;            /* magnitude of its value so far */
} Back;

/* An output whose FMU tells its slope, and how far it changes by it; see judge_slopes(). */
typedef struct {
    int64_t place, slope;
    double largest;             /* magnitude of its value so far */
    double change, least, most; /* since it was judged last: its own, and by the slope */
    int64_t wrong;
} Slope;

typedef struct Ports {
    Stranger *fmus;            /* in the order in which they step */
    int64_t n_fmus;
    Source *sources;
    int64_t n_sources;
    double *outputs, *before, *rates; /* now; at the communication point; and their differences */
    double *odd;               /* which of them a step from a restored state has had otherwise */
    Back *backs;               /* for each of them */
    int64_t n_outputs;
    double *now, *last, *start, *charges; /* saved values: sent last; at the last accepted point; at
                                      the communication point, and their integrals since then */
    const int64_t *places;     /* as in Lead */
    int64_t n_saved;
    Pieces drive;
    double jump;               /* s; the drive's next one */
    int64_t driven;            /* whether a port is from it */
    Pulses pulses;
    Through *throughs;
    int64_t n_throughs;
    Slope *slopes;
    int64_t n_slopes;
    int64_t learn;             /* whether their gains are to be looked at */
    int64_t forced;            /* communication point from which a step is taken without agreement */
    double macro_step;         /* s; 0: each accepted step ends on a communication point */
    int64_t fixed;             /* whether an FMU takes no other step than that one */
    double duration, after_jump;
    int64_t ends;              /* whether FMUs take the ends of their inputs; see has_end() */
    double drive_charge;       /* V s; the drive's integral since the communication point */
    double jumped;             /* s; the last jump, of the drive or of an FMU */
    double time, origin, end;  /* s; last accepted point; last and next communication point */
    double told, sent;         /* as in Lead */
    int64_t repeats;           /* whether attempts are repeated until they agree with the FMUs */
    int64_t stepped;           /* the FMUs have made the step of the last attempt */
    int64_t tries;             /* of the step under way */
    int64_t met, met_before;   /* an event in the step under way, which is short enough; the last one */
    double tolerance;          /* of that agreement, relative to the source's largest value */
    const char *const *asked;  /* what ngspice is asked for an attempt's saved values */
    int64_t n_probed;          /* of these, the first ones, lead to FMUs */
    AnyFunction command, ask, plot; /* ngspice's */
    char plot_name[64];
    double *log, *points;      /* rows: time, sources, saved values; time, outputs */
    int64_t n_log, n_points, log_rows;
    int64_t logged, attempts, redone, exchanged, quiet;
    int64_t status, stopped, failed; /* failed: which FMU */
    char source[64];           /* the one that nothing feeds */
    void (*attend)(void);
} Ports;

EXPORT void ports_begin(Ports *c);
EXPORT void ports_finish(Ports *c);
/* How often the vector at this place among those sent has turned back since the run began. */
EXPORT int ports_turns(int place);

extern int loop_sent;
/* Whether ngspice has sent values in the run under way. Before that it may seek the operating point by
   steps of its own in time, from 0 on, which are not the run's. */

/* What ngspice calls while no Lead is under way. */
int ports_source(double *value, double time, const char *node);
int ports_data(const VectorValues *data);
int ports_step(double time, double *delta, double old_delta, int redo, int location);

EXPORT int64_t loop_size(int which); /* bytes of Fmu, Schedule, Recorder, Lead,
                                                 Piece, Group, Source, Feed, Stranger, Pulse, Through,
                                                 Slope, Ports */

#endif
