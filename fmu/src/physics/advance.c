/* Integration from event to event. */
#include <math.h>
#include <stdio.h>

#include "advance.h"
#include "events.h"
#include "integrator.h"
#include "mechanics.h"

static const double STEP_MIN = 1e-14;          /* s; below this a step is an instant */
static const int MAX_EVENTS_PER_STEP = 1000000; /* Zeno sequences end by themselves, far below */
static const int MAX_TRIALS_PER_STEP = 2000000;

typedef struct {
    double tau, y[N_ALL], dy[N_ALL];
    EventFunction functions[MAX_EVENT_FUNCTIONS];
    int n;
} Point;

static void evaluate(const Model *m, Point *point)
{
    stickslip_state_rates(m, m->mode, point->y, point->tau, point->dy);
    point->n = stickslip_event_functions(m, point->y, point->tau, point->functions);
}

/* The point that one whole Runge-Kutta step of length h reaches from start. */
static double try_step(const Model *m, const Point *start, double h, Point *end)
{
    double error = stickslip_trial_step(m, start->tau, h, start->y, start->dy, end->y, end->dy);
    end->tau = start->tau + h;
    return error;
}

static void try_with_functions(const Model *m, const Point *start, double h, Point *end)
{
    try_step(m, start, h, end);
    end->n = stickslip_event_functions(m, end->y, end->tau, end->functions);
}

/* Root of function (or, with use_rate, zero of its rate) for step lengths in [low, high], whose
 * ends differ in sign: Newton where it stays inside and helps, else bisection. Each trial is a real
 * step from the start, so that the event lies on the solution and not on an interpolant. */
static double locate(const Model *m, const Point *start, int index, int use_rate, double low,
                     double high, double value_low)
{
    Point end;
    double h = 0.5 * (low + high), before = high - low;
    for (int i = 0; i < 200; i++) {
        try_with_functions(m, start, h, &end);
        const EventFunction *f = &end.functions[index];
        double value = use_rate ? f->rate : f->value;
        if ((value < 0.0) == (value_low < 0.0))
            low = h;
        else
            high = h;
        double width = high - low;
        if (value == 0.0 || width <= 2e-16 * (start->tau + high))
            break;
        double next = 0.5 * (low + high);
        if (!use_rate && f->rate != 0.0) {
            double newton = h - value / f->rate;
            if (newton > low && newton < high && fabs(newton - h) < 0.5 * before)
                next = newton;
            else if (fabs(value / f->rate) <= 1e-16 * (start->tau + high))
                break;
        }
        before = fabs(next - h);
        h = next;
    }
    return h;
}

/* The first event within the trial step from start to end: its step length, or a negative number if
 * there is none. 0 if it is at the very start. */
static double first_event(const Model *m, const Point *start, const Point *end, int *which)
{
    double h = end->tau - start->tau, found = -1.0;
    const Point *stop = end;
    Point nearer;
    for (int i = 0; i < start->n; i++) {
        const EventFunction *a = &start->functions[i], *b = &stop->functions[i];
        double high = -1.0;
        if (b->value < -b->noise) {
            high = h;
        } else if (a->rate < 0.0 && b->rate > 0.0 && a->value > 0.0 &&
                   (a->value + a->rate * h / 3.0 < 0.0 || b->value - b->rate * h / 3.0 < 0.0)) {
            /* Both ends are clear, but the curve may dip below zero between them (grazing). */
            Point dip;
            double lowest = locate(m, start, i, 1, 0.0, h, a->rate);
            try_with_functions(m, start, lowest, &dip);
            if (dip.functions[i].value < -dip.functions[i].noise)
                high = lowest;
        }
        if (high < 0.0)
            continue;
        if (h < STEP_MIN && a->value < 0.0 && a->rate > 0.0)
            continue; /* on its way back, and another event is due within the same instant */
        *which = i;
        if (a->value <= 0.0) {
            if (a->rate < 0.0)
                return 0.0;
            /* It begins on the boundary, leaves it and comes back: halve until it is outside. */
            Point inside;
            double low = high;
            do {
                low *= 0.5;
                if (low < STEP_MIN)
                    return 0.0;
                try_with_functions(m, start, low, &inside);
            } while (inside.functions[i].value <= 0.0);
            found = locate(m, start, i, 0, low, high, 1.0);
        } else {
            found = locate(m, start, i, 0, 0.0, high, 1.0);
        }
        h = found;
        try_with_functions(m, start, h, &nearer);
        stop = &nearer;
    }
    return found;
}

/* Of the first surface. */
static void note_extremes(Model *m, const Point *point)
{
    Reals *r = &m->r;
    double a = point->dy[V], v = point->y[V], z = point->y[Z];
    if (a > r->a_surface_max)
        r->a_surface_max = a;
    if (a < r->a_surface_min)
        r->a_surface_min = a;
    if (v > r->v_surface_max)
        r->v_surface_max = v;
    if (v < r->v_surface_min)
        r->v_surface_min = v;
    if (z > r->z_surface_max)
        r->z_surface_max = z;
    if (z < r->z_surface_min)
        r->z_surface_min = z;
    if (point->y[I_COIL] > r->coil_current_max)
        r->coil_current_max = point->y[I_COIL];
    if (point->y[I_COIL] < r->coil_current_min)
        r->coil_current_min = point->y[I_COIL];
}

/* Times that are counted mode by mode; those of the source are the first one's. */
static void note_time(Model *m, double taken)
{
    const Mode *mode = &m->mode[0];
    if (mode->slip == 0)
        m->r.stick_time += taken;
    if (m->n.independent && m->mode[1].slip == 0)
        m->r.stick_time_2 += taken;
    if (mode->output > 0)
        m->r.output_high_time += taken;
    else if (mode->output < 0)
        m->r.output_low_time += taken;
    else if (mode->limited)
        m->r.current_limit_time += taken;
}

static void take_up(Model *m, const Point *point)
{
    for (int j = 0; j < moving(m) * N_STATES; j++)
        m->y[j] = point->y[j];
}

static void start_from(const Model *m, double tau, Point *point)
{
    for (int j = 0; j < moving(m) * N_STATES; j++)
        point->y[j] = m->y[j];
    point->tau = tau;
    evaluate(m, point);
}

/* The prescribed velocity may have jumped; the part keeps its own. */
static void set_surface(Model *m)
{
    const double jump = m->r.surface_velocity - m->y[V];
    m->y[V] = m->r.surface_velocity;
    if (fabs(jump) > 1e-12 * (1.0 + fabs(m->y[V]))) /* else what the ramp's rounding makes */
        m->y[W] -= jump;
}

int stickslip_advance(Model *m, double h, char *message)
{
    Point now, end;
    int events = 0;

    if (m->n.prescribed)
        set_surface(m);
    stickslip_settle_mode(m, 0.0);
    start_from(m, 0.0, &now);
    m->r.a_surface_max = m->r.a_surface_min = now.dy[V];
    m->r.v_surface_max = m->r.v_surface_min = now.y[V];
    m->r.z_surface_max = m->r.z_surface_min = now.y[Z];
    m->r.coil_current_max = m->r.coil_current_min = now.y[I_COIL];

    for (int trials = 0; now.tau < h; trials++) {
        if (events > MAX_EVENTS_PER_STEP) {
            snprintf(message, MODEL_MESSAGE_SIZE,
                     "more than %d events within one step of %g s: the mechanics chatter",
                     MAX_EVENTS_PER_STEP, h);
            return -1;
        }
        if (trials > MAX_TRIALS_PER_STEP) {
            snprintf(message, MODEL_MESSAGE_SIZE,
                     "more than %d internal steps within one step of %g s: it is too long, or the "
                     "mechanics are too fast",
                     MAX_TRIALS_PER_STEP, h);
            return -1;
        }
        const double left = h - now.tau;
        const int last = m->step > 0.999 * left; /* rather stretch than leave a crumb */
        const double wanted = last ? left : m->step;
        double error = try_step(m, &now, wanted, &end);
        if (!(error <= 1.0) && wanted > STEP_MIN) {
            m->n.internal_rejected++;
            m->step = wanted * stickslip_step_factor(error);
            continue;
        }
        if (!(error < 1e30)) {
            snprintf(message, MODEL_MESSAGE_SIZE,
                     "the mechanics left the range of numbers; the inputs or parameters are too "
                     "large");
            return -1;
        }
        if (last)
            end.tau = h;
        end.n = stickslip_event_functions(m, end.y, end.tau, end.functions);

        int which = -1;
        double found = first_event(m, &now, &end, &which);
        double taken = wanted;
        if (found >= 0.0) {
            taken = found;
            if (found > 0.0)
                try_step(m, &now, found, &end);
            else
                end = now;
        } else {
            double next = wanted * stickslip_step_factor(error);
            if (!last || next > m->step)
                m->step = next;
        }
        note_time(m, taken);
        m->n.internal_steps++;
        note_extremes(m, &end);
        take_up(m, &end);
        if (found >= 0.0) {
            events++;
            stickslip_apply_event(m, now.functions[which].surface, end.tau,
                                  now.functions[which].kind);
            start_from(m, end.tau, &now);
            note_extremes(m, &now);
        } else {
            now = end;
        }
    }
    return 0;
}
