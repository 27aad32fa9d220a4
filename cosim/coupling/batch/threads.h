/* Threads that call compiled functions, such as what leads a recorder, each its own at a time.
   cosim/coupling/batch/threads.py has the structures with the same fields in the same order. SI. */

#ifndef THREADS_H
#define THREADS_H

#include "../loop/loop.h"

enum { DONE, FAILED, TO_JUDGE, UNFINISHED };

/* A call; again and again while it gives UNFINISHED. */
typedef struct Job {
    int64_t (*run)(void *task);
    void *task;
    int64_t outcome;  /* see the enum above */
    struct Job *next; /* in the queue that it stands in */
} Job;

/* Intervals that one recorder, whose FMU is not shared, is to be led through, as recorder_follow()
   takes them. */
typedef struct {
    Recorder *recorder;
    const double *edges, *start, *end;
    int64_t n, done;          /* intervals: all of them, those finished */
    int64_t at_once, most;    /* steps of the next call, which grows up to `most` */
    const uint32_t *internal; /* value references of internal steps, taken and rejected */
    double enough;            /* such beyond the steps asked for, after which it is judged */
} Following;

/* One call of the recorder, between which the threads can be ended. */
EXPORT int64_t following_run(void *task);

typedef struct Threads Threads;

/* `threads` of them, or as many as there are to be had; NULL if there are none. */
EXPORT Threads *threads_start(int64_t threads);

/* Have a job run, which must last until it was taken back or the threads have ended. */
EXPORT void threads_give(Threads *t, Job *job);

/* All jobs that have an outcome, one the `next` of the other; NULL if there are none. Waits until
   few are left to be run, so that the caller seldom wakes, but at most for `patience` seconds. */
EXPORT Job *threads_take(Threads *t, double patience);

/* Stop what runs, at most a call later, and end the threads. */
EXPORT void threads_end(Threads *t);

EXPORT int64_t threads_size(int which); /* bytes of Job, Following */

#endif
