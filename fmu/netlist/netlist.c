/* SPDX-License-Identifier: BSD-2-Clause */
/* A netlist as a model: ngspice runs in its own thread, which waits at each communication point
 * within GetSyncData, so that its last step has ended there.
 *
 * ngspice has one circuit in a process, and no way back in time: so one instance a process, whose
 * state cannot be saved. While the importer's thread works ngspice's waits, and the other way
 * round; `turn` says whose it is. */
#define _POSIX_C_SOURCE 200809L /* setenv */

#include <ctype.h>
#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "ports.h"
#include "spice.h"

static const char MARK[] = "NETLIST_FMU_RUNS_IN_PROCESS"; /* seen by other netlists' libraries, too */

static const double NEAR = 1e-12; /* of the time: nearer ones are one */
static const double BEYOND = 10.0; /* steps by which ngspice's end lies behind the experiment's */
static const double FOREVER = 1e9; /* steps; ngspice's end where the experiment has none */

static const double OPERATING_END = 1e-5 * (1.0 - 1e-15);
/* s; to here, but for rounding, lead the steps (OPTRAN) by which ngspice seeks an operating point that
 * it finds in no other way. It cuts a step beyond it to end shortly before, and never comes to it. */

enum { IMPORTERS, SPICES };

typedef struct {
    double delay, period, corners[4];
    int n, corner;
    double cycle, previous, announced;
} Pulse;

static Ports ports;
static Spice spice;

static struct {
    Run *run;
    pthread_mutex_t lock;
    pthread_cond_t changed;
    pthread_key_t mark; /* of ngspice's thread: its end is known when that is taken away */
    int turn, stopping, ended, gone, given_up;
    int sent; /* whether ngspice has sent values: before that it may seek the operating point */
    int open; /* whether there is an instance */
    double until;
    int *places; /* of each variable among the values sent; -1: not a vector */
    int unknown; /* an output that ngspice does not send, or 0 */
    Pulse *pulses;
    int n_pulses;
    char said[400];
} s = {.lock = PTHREAD_MUTEX_INITIALIZER, .changed = PTHREAD_COND_INITIALIZER};

static int failed(Run *run, const char *what, const char *more)
{
    snprintf(run->why, sizeof run->why, "%s%s", what, more);
    return 0;
}

/* --- what ngspice calls, in its own thread --- */

static int on_text(char *text, int id, void *user)
{
    static const char *const telling[] = {"rror", "too small", "singular", "abort", "can't", "cannot",
                                          "could not", "nknown", "ndefined", "ailed"};
    (void)id, (void)user;
    for (size_t k = 0; k < sizeof telling / sizeof *telling; k++)
        if (strstr(text, telling[k]) && strncmp(text, "stderr Note", 11) != 0) {
            const size_t used = strlen(s.said);
            const char *words = strncmp(text, "std", 3) == 0 ? text + 7 : text;
            if (!strstr(s.said, words))
                snprintf(s.said + used, sizeof s.said - used, "%s%s", used ? "; " : "", words);
            break;
        }
    return 0;
}

static int on_status(char *text, int id, void *user)
{
    (void)text, (void)id, (void)user;
    return 0;
}

/* Wait until it is no longer their turn. */
static void wait_for(int them)
{
    pthread_mutex_lock(&s.lock);
    while (s.turn == them && !s.stopping && !s.ended)
        pthread_cond_wait(&s.changed, &s.lock);
    pthread_mutex_unlock(&s.lock);
}

static void hand_over(int to)
{
    pthread_mutex_lock(&s.lock);
    s.turn = to;
    pthread_cond_broadcast(&s.changed);
    pthread_mutex_unlock(&s.lock);
    wait_for(to);
}

static int on_exit_asked(int status, bool unload, bool quit, int id, void *user)
{
    (void)unload, (void)quit, (void)id, (void)user;
    pthread_mutex_lock(&s.lock);
    s.given_up = s.ended = 1;
    pthread_cond_broadcast(&s.changed);
    pthread_mutex_unlock(&s.lock);
    return status;
}

/* ngspice's thread has left its library, which may be unloaded now. */
static void on_gone(void *mark)
{
    (void)mark;
    pthread_mutex_lock(&s.lock);
    s.ended = s.gone = 1;
    pthread_cond_broadcast(&s.changed);
    pthread_mutex_unlock(&s.lock);
}

static int on_thread(bool ended, int id, void *user)
{
    (void)id, (void)user;
    pthread_mutex_lock(&s.lock);
    s.ended = ended;
    if (!ended) {
        s.gone = 0;
        pthread_setspecific(s.mark, &s);
    }
    pthread_cond_broadcast(&s.changed);
    pthread_mutex_unlock(&s.lock);
    return 0;
}

static int on_vectors(SentVectors *all, int id, void *user)
{
    (void)id, (void)user;
    for (int k = 1; k <= ports.model.count && s.places; k++) {
        s.places[k] = -1;
        if (ports.variables[k - 1].kind != OUTPUT)
            continue;
        for (int i = 0; i < all->count; i++)
            if (strcmp(all->vectors[i]->name, ports.words[k]) == 0)
                s.places[k] = i;
        if (s.places[k] < 0)
            s.unknown = k;
    }
    return 0;
}

static int on_data(SentValues *all, int n, int id, void *user)
{
    (void)n, (void)id, (void)user;
    s.sent = 1;
    for (int k = 1; s.run && k <= ports.model.count; k++)
        if (s.places[k] >= 0)
            s.run->v[k] = all->values[s.places[k]]->real;
    return 0;
}

static int on_source(double *value, double time, char *name, int id, void *user)
{
    (void)id, (void)user;
    *value = NAN;
    for (int k = 1; s.run && k <= ports.model.count; k++) {
        const char *at = name, *word = ports.words[k];
        if (ports.variables[k - 1].kind != INPUT || !word)
            continue;
        while (*word && tolower((unsigned char)*at) == *word)
            at++, word++;
        if (!*word && !*at)
            *value = s.run->v[k] + (s.sent ? s.run->v[k + 1] * fmax(0.0, time - s.run->time) : 0.0);
    }
    return 0;
}

/* A PULSE finds its next edge only if a step was cut to end on this one, and a step that ends there
 * by itself, as after one that the importer has cut, is not. So each is announced, two ahead. */
static void announce(double time)
{
    for (Pulse *p = s.pulses; p < s.pulses + s.n_pulses; p++)
        while (p->previous <= time) {
            p->previous = p->announced;
            p->corner = (p->corner + 1) % p->n;
            p->cycle += p->corner == 0;
            p->announced = p->delay + p->cycle * p->period + p->corners[p->corner];
            if (p->announced > time && p->announced - p->previous > NEAR * p->period)
                spice.breakpoint(p->announced);
        }
}

static int on_sync(double time, double *delta, double last_delta, int redo, int id, int place,
                   void *user)
{
    (void)last_delta, (void)redo, (void)id, (void)user;
    if (!s.sent) {
        if (time < OPERATING_END)
            *delta = fmin(*delta, OPERATING_END - time);
        return 0;
    }
    if (place != 0 || s.stopping)
        return 0;
    if (time >= s.until * (1.0 - NEAR))
        hand_over(IMPORTERS);
    if (s.stopping)
        return 0;
    announce(time);
    if (time + *delta > s.until * (1.0 - NEAR))
        *delta = s.until - time;
    return 0;
}

/* --- what FMI's layer calls, in the importer's thread --- */

static int begin(void)
{
    int number = 0;
    if (!spice_find(&spice, s.run->why))
        return 0;
    spice.init(on_text, on_status, on_exit_asked, on_data, on_vectors, on_thread, NULL);
    spice.init_sync(on_source, on_source, on_sync, &number, NULL);
    return 1;
}

/* The deck's line, with a parameter's value in it; or the analysis with the experiment's end. */
static char *line_of(const Run *run, const char *line)
{
    const size_t room = strlen(line) + 120;
    char *own = malloc(room);
    snprintf(own, room, "%s", line);
    if (strncmp(line, ".tran ", 6) == 0) {
        const double step = ports.model.step;
        const double end = isfinite(run->stop) ? run->stop + BEYOND * step : FOREVER * step;
        snprintf(own, room, ".tran %.17g %.17g 0 %.17g", step, end, step);
    }
    for (int k = 1; k <= ports.model.count; k++) {
        const Variable *v = &ports.variables[k - 1];
        const size_t length = v->kind == PARAMETER ? strlen(ports.words[k]) : 0;
        if (length && run->v[k] != v->start && strncmp(line, ".param ", 7) == 0 &&
            strncmp(line + 7, ports.words[k], length) == 0 && line[7 + length] == '=')
            snprintf(own, room, ".param %s=%.17g", ports.words[k], run->v[k]);
    }
    return own;
}

static int load(Run *run)
{
    char *deck = ports_file(run->resources, "deck.cir", run->why);
    if (!deck)
        return 0;
    size_t n = 1, k = 0, depth = 0;
    for (const char *at = deck; *at; at++)
        n += *at == '\n';
    char **lines = calloc(n + 1, sizeof *lines);
    for (char *line = strtok(deck, "\n"); line; line = strtok(NULL, "\n")) {
        depth += strncmp(line, ".subckt", 7) == 0;
        depth -= depth && strncmp(line, ".ends", 5) == 0;
        lines[k++] = depth ? strcpy(malloc(strlen(line) + 1), line) : line_of(run, line);
    }
    spice.circuit(lines);
    while (k)
        free(lines[--k]);
    free(lines);
    free(deck);
    return 1;
}

static void find_pulses(void)
{
    char text[200];
    s.pulses = calloc((size_t)ports.n_pulses + 1, sizeof *s.pulses);
    s.n_pulses = 0;
    for (int k = 0; k < ports.n_pulses; k++) {
        snprintf(text, sizeof text, "@%s[pulse]", ports.pulses[k]);
        const Vector *found = spice.vector(text);
        if (!found || !found->real || found->length < 7)
            continue;
        const double *v = found->real; /* low, high, delay, rise, fall, width, period */
        const double rise = v[3] > 0 ? v[3] : ports.model.step, fall = v[4] > 0 ? v[4] : ports.model.step;
        const double all[] = {0.0, rise, rise + v[5], rise + v[5] + fall};
        Pulse *p = &s.pulses[s.n_pulses];
        *p = (Pulse){.delay = v[2], .period = v[6], .corner = -1, .cycle = -1.0, .previous = -INFINITY};
        p->announced = -INFINITY;
        while (p->n < 4 && all[p->n] < p->period) {
            p->corners[p->n] = all[p->n];
            p->n++;
        }
        s.n_pulses += p->n > 0 && v[5] > 0;
        snprintf(text, sizeof text, "unlet @%s[pulse]", ports.pulses[k]);
        spice.command(text);
    }
}

static void end(Run *run)
{
    char halt[] = "bg_halt", destroy[] = "destroy all", remove[] = "remcirc";
    (void)run;
    pthread_mutex_lock(&s.lock);
    s.stopping = 1;
    pthread_cond_broadcast(&s.changed);
    pthread_mutex_unlock(&s.lock);
    while (spice.command && !s.ended) /* it waits for a while, which a long step may exceed */
        spice.command(halt);
    pthread_mutex_lock(&s.lock);
    while (!s.gone)
        pthread_cond_wait(&s.changed, &s.lock);
    pthread_mutex_unlock(&s.lock);
    if (spice.command && !s.given_up) {
        spice.command(destroy);
        spice.command(remove);
    }
    spice_leave(&spice);
    s.run = NULL;
    free(s.places);
    free(s.pulses);
    s.places = NULL;
    s.pulses = NULL;
}

static int start(Run *run)
{
    char go[] = "bg_run";
    s.run = run;
    s.turn = SPICES;
    s.stopping = s.unknown = s.given_up = s.sent = 0;
    s.ended = s.gone = 1;
    s.until = 0.0;
    s.said[0] = '\0';
    s.places = calloc((size_t)ports.model.count + 1, sizeof *s.places);
    for (int k = 0; k <= ports.model.count; k++)
        s.places[k] = -1;
    if (!begin() || !load(run))
        return 0;
    if (!s.given_up)
        find_pulses();
    s.ended = s.gone = s.given_up;
    if (s.given_up || spice.command(go) != 0) {
        s.ended = s.gone = 1;
        return failed(run, "ngspice could not begin: ", s.said);
    }
    wait_for(SPICES);
    if (s.unknown)
        return failed(run, "the netlist has no ", ports.variables[s.unknown - 1].name);
    return !s.ended || failed(run, "ngspice could not begin: ", *s.said ? s.said : "no reason given");
}

static int step_by(Run *run, double h)
{
    char text[100];
    s.until = run->time + h;
    hand_over(SPICES);
    if (!s.ended)
        return 1;
    snprintf(text, sizeof text, "ngspice stopped before %.9g s: ", s.until);
    return failed(run, text, *s.said ? s.said : "no reason given");
}

static void leave(void)
{
    unsetenv(MARK);
    pthread_key_delete(s.mark);
    ports_free(&ports);
    s.open = 0;
}

const Model *model(const char *resources, char why[512])
{
    char own[32];
    const char *there = getenv(MARK);
    snprintf(own, sizeof own, "%ld", (long)getpid());
    if (s.open || (there && strcmp(there, own) == 0)) {
        snprintf(why, 512, "there is a netlist's instance in this process already, and ngspice has "
                           "one circuit in a process: give each a process of its own");
        return NULL;
    }
    if (!ports_read(&ports, resources, why))
        return NULL;
    setenv(MARK, own, 1);
    pthread_key_create(&s.mark, on_gone);
    s.open = 1;
    ports.model.alone = 1;
    ports.model.start = start;
    ports.model.step_by = step_by;
    ports.model.end = end;
    ports.model.close = leave;
    return &ports.model;
}
