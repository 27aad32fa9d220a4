/* Two queues, of what is to be run and of what was, under one lock that is held for a moment. */

#include "threads.h"

#include <stdatomic.h>
#include <stdlib.h>

#ifdef _WIN32
#include <windows.h>

typedef HANDLE Thread;
typedef CRITICAL_SECTION Lock;
typedef CONDITION_VARIABLE News;

#define WORK static DWORD WINAPI
#define RESULT 0

static void set_up(Lock *lock, News *a, News *b)
{
    InitializeCriticalSection(lock);
    InitializeConditionVariable(a);
    InitializeConditionVariable(b);
}

static void tear_down(Lock *lock, News *a, News *b)
{
    (void)a, (void)b;
    DeleteCriticalSection(lock);
}

static void lock_up(Lock *lock) { EnterCriticalSection(lock); }
static void unlock(Lock *lock) { LeaveCriticalSection(lock); }
static void tell_one(News *news) { WakeConditionVariable(news); }
static void tell_all(News *news) { WakeAllConditionVariable(news); }
static void wait_for(News *news, Lock *lock) { SleepConditionVariableCS(news, lock, INFINITE); }

static void wait_until(News *news, Lock *lock, double seconds)
{
    SleepConditionVariableCS(news, lock, (DWORD)(1e3 * seconds));
}

static int start(Thread *thread, DWORD(WINAPI *work)(void *), void *threads)
{
    return (*thread = CreateThread(NULL, 0, work, threads, 0, NULL)) != NULL;
}

static void join(Thread thread)
{
    WaitForSingleObject(thread, INFINITE);
    CloseHandle(thread);
}
#else
#include <pthread.h>
#include <time.h>

typedef pthread_t Thread;
typedef pthread_mutex_t Lock;
typedef pthread_cond_t News;

#define WORK static void *
#define RESULT NULL

static void set_up(Lock *lock, News *a, News *b)
{
    pthread_mutex_init(lock, NULL);
    pthread_cond_init(a, NULL);
    pthread_cond_init(b, NULL);
}

static void tear_down(Lock *lock, News *a, News *b)
{
    pthread_cond_destroy(a);
    pthread_cond_destroy(b);
    pthread_mutex_destroy(lock);
}

static void lock_up(Lock *lock) { pthread_mutex_lock(lock); }
static void unlock(Lock *lock) { pthread_mutex_unlock(lock); }
static void tell_one(News *news) { pthread_cond_signal(news); }
static void tell_all(News *news) { pthread_cond_broadcast(news); }
static void wait_for(News *news, Lock *lock) { pthread_cond_wait(news, lock); }

static void wait_until(News *news, Lock *lock, double seconds)
{
    struct timespec end;
    timespec_get(&end, TIME_UTC);
    const double nanoseconds = (double)end.tv_nsec + 1e9 * seconds;
    end.tv_sec += (time_t)(nanoseconds / 1e9);
    end.tv_nsec = (long)(nanoseconds - 1e9 * (double)(time_t)(nanoseconds / 1e9));
    pthread_cond_timedwait(news, lock, &end);
}

static int start(Thread *thread, void *(*work)(void *), void *threads)
{
    return pthread_create(thread, NULL, work, threads) == 0;
}

static void join(Thread thread) { pthread_join(thread, NULL); }
#endif

typedef struct {
    Job *first, *last;
} Queue;

struct Threads {
    Lock lock;
    News given, back;
    Queue to_run, run;
    int64_t waiting; /* of those to be run */
    atomic_int ended;
    int64_t threads;
    Thread thread[]; /* so many */
};

static void append(Queue *q, Job *job)
{
    job->next = NULL;
    if (q->first)
        q->last->next = job;
    else
        q->first = job;
    q->last = job;
}

static Job *pop(Queue *q)
{
    Job *job = q->first;
    if (job)
        q->first = job->next;
    return job;
}

int64_t following_run(void *task)
{
    Following *job = task;
    Recorder *r = job->recorder;
    Fmu *f = r->fmu;
    const int64_t row = job->done * r->ports;
    const int64_t taken = recorder_follow(r, job->n - job->done, job->edges + job->done,
                                          job->start + row, job->end + row, job->at_once);
    if (taken < 0)
        return FAILED;
    job->done += taken;
    job->at_once = 8 * job->at_once < job->most ? 8 * job->at_once : job->most;
    int32_t steps[2];
    if (!f->get_whole(f, job->internal, 2, steps))
        return FAILED;
    if ((double)steps[0] + (double)steps[1] - (double)f->steps >= job->enough)
        return TO_JUDGE;
    return job->done == job->n ? DONE : UNFINISHED;
}

WORK work(void *threads)
{
    Threads *t = threads;
    lock_up(&t->lock);
    while (!t->ended) {
        Job *job = pop(&t->to_run);
        if (!job) {
            wait_for(&t->given, &t->lock);
            continue;
        }
        t->waiting--;
        unlock(&t->lock);
        do
            job->outcome = job->run(job->task);
        while (job->outcome == UNFINISHED && !t->ended);
        lock_up(&t->lock);
        append(&t->run, job);
        if (t->waiting <= t->threads)
            tell_one(&t->back);
    }
    unlock(&t->lock);
    return RESULT;
}

Threads *threads_start(int64_t threads)
{
    Threads *t = calloc(1, sizeof *t + (size_t)threads * sizeof t->thread[0]);
    if (!t)
        return NULL;
    set_up(&t->lock, &t->given, &t->back);
    while (t->threads < threads && start(&t->thread[t->threads], work, t))
        t->threads++;
    if (t->threads)
        return t;
    threads_end(t);
    return NULL;
}

void threads_give(Threads *t, Job *job)
{
    job->outcome = UNFINISHED;
    lock_up(&t->lock);
    append(&t->to_run, job);
    t->waiting++;
    tell_one(&t->given);
    unlock(&t->lock);
}

Job *threads_take(Threads *t, double patience)
{
    lock_up(&t->lock);
    if (!t->run.first || t->waiting > t->threads)
        wait_until(&t->back, &t->lock, patience);
    Job *jobs = t->run.first;
    t->run.first = NULL;
    unlock(&t->lock);
    return jobs;
}

void threads_end(Threads *t)
{
    lock_up(&t->lock);
    t->ended = 1;
    tell_all(&t->given);
    unlock(&t->lock);
    for (int64_t k = 0; k < t->threads; k++)
        join(t->thread[k]);
    tear_down(&t->lock, &t->given, &t->back);
    free(t);
}

int64_t threads_size(int which)
{
    return (int64_t)(which ? sizeof(Following) : sizeof(Job));
}
