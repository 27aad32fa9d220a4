/* What the compiled twins of the recorder and of the coupling share with Python (cosim/compiled.py,
   whose structures have the same fields in the same order). SI throughout. */

#ifndef COUPLED_H
#define COUPLED_H

#include <stdint.h>

#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

typedef void (*AnyFunction)(void);

/* One instance of the FMU, through the functions of its interface. */
typedef struct {
    int32_t version; /* of FMI: 2 or 3 */
    int32_t status;  /* of the last call; above 1, a warning, it failed */
    void *instance;
    AnyFunction set_reals, do_step, get_reals, get_integers;
    AnyFunction failed; /* which of them failed */
    const uint32_t *input_places, *step_places, *sample_places, *sticking_place;
    const uint32_t *total_places, *counter_places;
    int64_t inputs, step_outputs_count, samples, totals, counters; /* how many of each */
    double *step_outputs; /* the last step's back-EMF, its slope, and pairs of maximum and minimum */
    double time;          /* reached */
    int64_t steps;        /* so far */
} Fmu;

enum { ROW = 1, FRAME = 2, SETTLED = 4 }; /* what is to be written down at a time */

typedef struct {
    Fmu *fmu;
    double settle;
    const double *times; /* at which something is to be written down; the last of all is endless */
    const int32_t *what;
    int64_t n_times, next;
    double *rows, *frames; /* a row: the samples, then sticking */
    int64_t n_rows, n_frames; /* since Python took them away */
    int64_t z_surface; /* its place among the samples */
    double *totals_at_settle;
    int32_t *counters_at_settle;
    double extremes[8]; /* those that the step's outputs have */
    double began;   /* of the interval under way */
    int64_t inside; /* whether one is */
    void (*plan)(void); /* Python takes rows and frames away, and gives the next times */
    int64_t stopped;    /* by Python: it failed there */
} Recorder;

/* Advance through `n` intervals that end at `edges`, the input going linearly between its two ends;
   not further once `most` steps were made, perhaps within an interval, and then to be called again
   with the rest. Gives how many intervals were finished, or -1 if a call of the FMU failed. */
EXPORT int64_t recorder_follow(Recorder *r, int64_t n, const double *edges, const double *start,
                               const double *end, int64_t most);

#endif
