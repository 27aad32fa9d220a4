/* The machine of the live page: the FMU, its command, and rows of what it does. Compiled to WebAssembly
   with the FMU's C; it steps as cosim/coupling/loop/recorder.c does. One machine at a time. SI.

   Functions return 0, or which of the FMU's calls refused: 1 parameters, 2 inputs, 3 a step, 4 reading. */

#include <math.h>

#include "fmi3Functions.h"

/* As src/fmi/token.h and variables.def have them. */
#define TEXT(name) #name
#define TEXT_OF(name) TEXT(name)

static const double SAME_TIME = 1e-12; /* s; times closer than this are one */

enum { MOST_LINES = 4096, MOST_READ = 32, MOST_MARKS = 1024 };

/* V1 between two corners: the first one's phase in the period, V1 there and at the second. */
typedef struct {
    double phase, start, end;
} Line;

typedef struct {
    fmi3ValueReference reals[MOST_READ], wholes[MOST_READ];
    int n_reals, n_wholes;
} Reading;

static struct {
    fmi3Instance fmu;
    double time;
    double origin, frequency; /* of the command: where its period 0 begins */
    Line lines[MOST_LINES];
    double count;               /* of lines a period */
    double number, begin, edge; /* of the line that holds, counted from the origin */
    double holds_until;         /* what the inputs were told */
    int ended;                  /* the next line begins after what is read now */
    int marked;                 /* periods that have begun since they were taken */
    Reading row, totals;
    fmi3ValueReference inputs[3]; /* command, its slope, how long they hold */
} m;

/* Where values come and go, and the totals at the begin of each period. */
static double place[3 * MOST_LINES], marks[MOST_MARKS * MOST_READ];

double *machine_place(void)
{
    return place;
}

double *machine_marks(void)
{
    return marks;
}

/* How many there are since the last call. */
int machine_marked(void)
{
    const int found = m.marked;
    m.marked = 0;
    return found;
}

double machine_time(void)
{
    return m.time;
}

double machine_origin(void)
{
    return m.origin;
}

int machine_new(void)
{
    if (m.fmu)
        fmi3FreeInstance(m.fmu);
    m.fmu = fmi3InstantiateCoSimulation("page", TEXT_OF(FMU_TOKEN), 0, 0, 0, 0, 0, 0, 0, 0, 0, 0);
    return m.fmu ? 0 : 1;
}

int machine_set(fmi3ValueReference what, double value)
{
    return fmi3SetFloat64(m.fmu, &what, 1, &value, 1) ? 2 : 0;
}

int machine_set_whole(fmi3ValueReference what, int value)
{
    return fmi3SetInt32(m.fmu, &what, 1, &value, 1) ? 1 : 0;
}

/* The references are in the place: three inputs; then those of a row or of the totals. */
void machine_inputs(void)
{
    for (int k = 0; k < 3; k++)
        m.inputs[k] = (fmi3ValueReference)place[k];
}

void machine_reads(int totals, int n_reals, int n_wholes)
{
    Reading *r = totals ? &m.totals : &m.row;
    r->n_reals = n_reals;
    r->n_wholes = n_wholes;
    for (int k = 0; k < n_reals; k++)
        r->reals[k] = (fmi3ValueReference)place[k];
    for (int k = 0; k < n_wholes; k++)
        r->wholes[k] = (fmi3ValueReference)place[n_reals + k];
}

static int take(const Reading *r, double *to)
{
    int wholes[MOST_READ];
    if (fmi3GetFloat64(m.fmu, r->reals, r->n_reals, to, r->n_reals) ||
        fmi3GetInt32(m.fmu, r->wholes, r->n_wholes, wholes, r->n_wholes))
        return 4;
    for (int k = 0; k < r->n_wholes; k++)
        to[r->n_reals + k] = wholes[k];
    return 0;
}

/* The totals now, into the place. */
int machine_totals(void)
{
    return take(&m.totals, place);
}

static double corner(double number)
{
    const double period = floor(number / m.count), line = number - period * m.count;
    return m.origin + (period + m.lines[(int)line].phase) / m.frequency;
}

static const Line *line_now(void)
{
    return &m.lines[(int)(m.number - floor(m.number / m.count) * m.count)];
}

static int go_over_to(double number)
{
    m.number = number;
    m.begin = corner(number);
    m.edge = corner(number + 1.0);
    m.ended = 0;
    m.holds_until = m.time;
    if (fmod(number, m.count) != 0.0 || m.time > m.begin + SAME_TIME || m.marked == MOST_MARKS)
        return 0;
    double *mark = marks + m.marked++ * (1 + m.totals.n_reals + m.totals.n_wholes);
    mark[0] = m.time;
    return take(&m.totals, mark + 1);
}

/* Another command from now on, of `count` lines a period in the place, at a phase of its period, or
   where `phase` is below 0 at the one that has been reached. */
int machine_turn(double frequency, int count, double phase)
{
    const double reached = (m.time - m.origin) * m.frequency;
    const double share = phase < 0.0 ? reached - floor(reached) : phase;
    m.frequency = frequency;
    m.origin = m.time - share / frequency;
    m.count = count;
    for (int k = 0; k < count; k++)
        m.lines[k] = (Line){place[3 * k], place[3 * k + 1], place[3 * k + 2]};
    double number = floor((m.time - m.origin) * frequency) * count - 1.0;
    while (corner(number + 1.0) <= m.time)
        number += 1.0;
    return go_over_to(number);
}

int machine_begin(void)
{
    m.time = m.origin = m.frequency = 0.0;
    m.marked = 0;
    return fmi3EnterInitializationMode(m.fmu, 0, 0, 0, 0, 0) || fmi3ExitInitializationMode(m.fmu);
}

/* The inputs are set again in the next step, as at the end of settling in a run. */
void machine_settle(void)
{
    m.holds_until = m.time;
}

static int step(double to)
{
    const double h = to - m.time;
    fmi3Boolean event, terminate, early;
    double last;
    if (h <= 0.0)
        return 0;
    if (m.time >= m.holds_until - SAME_TIME) {
        const Line *l = line_now();
        const double slope = (l->end - l->start) / (m.edge - m.begin);
        const double values[] = {l->start + slope * (m.time - m.begin), slope, m.edge - m.time};
        if (fmi3SetFloat64(m.fmu, m.inputs, 3, values, 3))
            return 2;
        m.holds_until = m.edge;
    }
    if (fmi3DoStep(m.fmu, m.time, h, 1, &event, &terminate, &early, &last))
        return 3;
    m.time = to;
    return 0;
}

/* On to a time; the place then begins with the command there, at a jump that before it. */
int machine_go(double to)
{
    int refused = m.ended ? go_over_to(m.number + 1.0) : 0;
    while (!refused && m.edge < to - SAME_TIME) {
        refused = step(m.edge);
        if (!refused)
            refused = go_over_to(m.number + 1.0);
    }
    if (refused)
        return refused;
    const Line *l = line_now();
    m.ended = m.edge <= to + SAME_TIME;
    place[0] = m.ended ? l->end : l->start + (l->end - l->start) * (to - m.begin) / (m.edge - m.begin);
    return step(m.ended ? m.edge : to);
}

/* The same, and behind the command what a row reads. */
int machine_row(double to)
{
    const int refused = machine_go(to);
    return refused ? refused : take(&m.row, place + 1);
}
