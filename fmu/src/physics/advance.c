/* SPDX-License-Identifier: BSD-2-Clause */
/* Integration from event to event. */
#include "advance.h"

#include <math.h>
#include <stdio.h>

#include "curve.h"
#include "events.h"
#include "extremes.h"
#include "integrator.h"
#include "mechanics.h"

/* So much one step may do, that it comes back within seconds: whoever called it cannot stop it. What
 * an importer steps through takes a thousandth of that. An event costs as much as some trials: it is
 * searched for. Zeno sequences end by themselves, far below. */
static const int MAX_TRIALS_PER_STEP = 400000, MAX_EVENTS_PER_STEP = 100000;

/* How much longer a step of order 8 is than one of order 5, about; and from how many of the latter
 * on it is the cheaper one. */
static const double LONGER = 6.0, WORTH = 3.0;

/* s; the first long step by a wall's clock, as long as none is known. */
static const double FIRST_TOUCH = 1e-6;

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
        m->y[j] = point->knot.y[j];
}

/* The point at which the model is. */
static void start_from(const Model *m, double tau, Point *point)
{
    Knot *knot = &point->knot;
    for (int j = 0; j < moving(m) * N_STATES; j++)
        knot->y[j] = m->y[j];
    knot->tau = tau;
    stickslip_state_rates(m, m->mode, knot->y, tau, knot->dy);
    point->at = 0.0;
    stickslip_find_functions(m, point);
}

/* The prescribed velocity may have jumped; the part keeps its own. */
static void set_surface(Model *m)
{
    const double jump = m->r.surface_velocity - m->y[V];
    m->y[V] = m->r.surface_velocity;
    if (fabs(jump) > 1e-12 * (1.0 + fabs(m->y[V]))) /* else what the ramp's rounding makes */
        m->y[W] -= jump;
}

static void note_point(Model *m, const Point *point)
{
    stickslip_note_extremes(m, point->knot.y, point->knot.dy[V]);
}

/* Where the inputs were set since they were begun. */
static void begin_extremes(Model *m, const double y[N_ALL], double acceleration)
{
    if (m->extremes_over)
        stickslip_begin_extremes(m, y, acceleration);
    m->extremes_over = 0;
}

/* ---- a step under way, beyond the communication point ---- */

/* The states at its point `at`, which the clock has reached. */
static void go_on_to(Model *m, double at)
{
    Ahead *ahead = &m->ahead;
    note_time(m, at - ahead->at);
    if (ahead->n_extremes)
        stickslip_note_inner_extremes(m, ahead->at, at);
    stickslip_interpolate_acting(m, &ahead->dense, stickslip_share_at(&ahead->dense, at), m->y);
    ahead->at = at;
}

int stickslip_advance_within(Model *m, double h)
{
    Ahead *ahead = &m->ahead;
    if (!ahead->active || ahead->end - ahead->at <= h + STEP_MIN)
        return 0;
    begin_extremes(m, m->y, ahead->acceleration);
    go_on_to(m, ahead->at + h);
    return 1;
}

void stickslip_reached(Model *m)
{
    m->ahead.acceleration = m->r.a_surface;
    stickslip_note_extremes(m, m->y, m->r.a_surface);
}

void stickslip_energies_now(const Model *m, double y[N_ALL])
{
    const Ahead *ahead = &m->ahead;
    for (int j = 0; j < moving(m) * N_STATES; j++)
        y[j] = m->y[j];
    if (!ahead->active)
        return;
    /* Gauss and Legendre's nodes and weights for eight: exact up to order 15. */
    static const double NODE[] = {0.18343464249564980, 0.52553240991632899, 0.79666647741362674,
                                  0.96028985649753623};
    static const double WEIGHT[] = {0.36268378337836198, 0.31370664587788729, 0.22238103445337447,
                                    0.10122853629037626};
    const double half = 0.5 * stickslip_share_at(&ahead->dense, ahead->at);
    for (int i = 0; i < 8; i++) {
        Knot knot;
        double clock[N_DERIVATIVES] = {0.0, ahead->dense.length};
        const double share = half * (1.0 + (i % 2 ? NODE[i / 2] : -NODE[i / 2]));
        for (int j = 0; j < moving(m) * N_STATES; j++)
            knot.y[j] = 0.0;
        stickslip_interpolate(m, &ahead->dense, share, &knot);
        if (ahead->dense.wall >= 0)
            stickslip_derivatives(ahead->dense.clock, 1, share, clock);
        stickslip_state_rates(m, m->mode, knot.y, knot.tau - ahead->at, knot.dy);
        for (int s = 0; s < moving(m); s++)
            for (int j = s * N_STATES + N_ACTING; j < (s + 1) * N_STATES; j++)
                y[j] += WEIGHT[i / 2] * half * clock[1] * knot.dy[j];
    }
}

void stickslip_turn_back(Model *m)
{
    double y[N_ALL];
    if (!m->ahead.active)
        return;
    stickslip_energies_now(m, y);
    for (int j = 0; j < moving(m) * N_STATES; j++)
        m->y[j] = y[j];
    m->ahead.active = 0;
}

/* It ends within this step: from its end on. */
static void finish_ahead(Model *m, double h, Point *now)
{
    Ahead *ahead = &m->ahead;
    double tau = ahead->end - ahead->at;
    if (fabs(tau - h) <= STEP_MIN)
        tau = h;
    begin_extremes(m, m->y, ahead->acceleration);
    note_time(m, ahead->end - ahead->at);
    stickslip_note_inner_extremes(m, ahead->at, ahead->end);
    ahead->active = 0;
    for (int j = 0; j < moving(m) * N_STATES; j++)
        m->y[j] = ahead->last[j];
    start_from(m, tau, now);
    note_point(m, now);
    if (ahead->ends_with < 0)
        return;
    stickslip_apply_event(m, ahead->surface, tau, (EventKind)ahead->ends_with);
    start_from(m, tau, now);
    note_point(m, now);
}

/* ---- one step ---- */

/* What it ends with. */
typedef struct {
    double taken; /* s */
    int which;    /* of the event functions; -1: none */
} Ending;

/* The length that the error control would take next; its place. */
static double *step_of(Model *m)
{
    int touches = m->mode[0].wall == WALL_TOUCH;
    if (moving(m) > 1)
        touches |= m->mode[1].wall == WALL_TOUCH;
    return &m->step[touches];
}

/* One step of order 5, at most to h. 0 where it was rejected, -1 where there are no numbers. */
static int short_step(Model *m, Point *now, double h, Point *end, Ending *ending)
{
    double *const step = step_of(m);
    const double left = h - now->knot.tau;
    const int last = *step > 0.999 * left; /* rather stretch than leave a crumb */
    const double wanted = last ? left : *step;
    const Knot *from = &now->knot;
    Knot *to = &end->knot;
    const double error =
        stickslip_trial_step(m, from->tau, wanted, from->y, from->dy, to->y, to->dy);
    if (!(error <= 1.0) && wanted > STEP_MIN) {
        *step = wanted * stickslip_step_factor(error);
        return 0;
    }
    if (!(error < 1e30))
        return -1;
    to->tau = last ? h : from->tau + wanted;
    now->at = 0.0;
    end->at = wanted;
    stickslip_find_functions(m, end);
    const Curve curve = {.start = now, .dense = NULL, .wall = -1};
    const double found = stickslip_first_event(m, &curve, end, &ending->which);
    ending->taken = wanted;
    if (found >= 0.0) {
        ending->taken = found;
        if (found > 0.0) {
            stickslip_trial_step(m, from->tau, found, from->y, from->dy, to->y, to->dy);
            to->tau = from->tau + found;
        } else {
            *end = *now;
        }
        return 1;
    }
    ending->which = -1;
    const double next = wanted * stickslip_step_factor(error);
    if (!last || next > *step)
        *step = next;
    return 1;
}

/* The next long step's length by a wall's clock. */
static double touch_step(const Model *m, int wall, const Knot *from)
{
    if (m->touch_step > 0.0)
        return m->touch_step;
    const double speed = fabs(from->y[wall * N_STATES + U]);
    return FIRST_TOUCH / (from->root + 0.5 * sqrt(speed * FIRST_TOUCH));
}

/* One step of order 8, at most to `hold`; m->ahead has what lies within it, if something or the time
 * h does. As short_step. */
static int long_step(Model *m, Point *now, int wall, double h, double hold, Point *end,
                     Ending *ending)
{
    Stages stages;
    double *const step = step_of(m);
    Knot *from = &now->knot, *to = &end->knot;
    Dense *dense = &m->ahead.dense;
    const Curve curve = {.start = now, .dense = dense, .wall = wall};
    const double left = hold - from->tau;
    if (wall >= 0)
        from->root = stickslip_root_of(m, wall, from->y);
    const double own = wall >= 0 ? touch_step(m, wall, from) : LONGER * *step;
    int last = wall < 0 && own > 0.999 * left;
    double wanted = last ? left : own;
    double error = stickslip_long_step(m, wall, wanted, from, to, &stages);
    const int enough = error <= 1.0 || wanted <= STEP_MIN;
    if (enough && wall >= 0 && to->tau > hold) {
        stickslip_interpolant(m, wall, wanted, from, to, &stages, dense);
        wanted *= stickslip_share_at(dense, left);
        last = 1;
        stickslip_long_step(m, wall, wanted, from, to, &stages);
    }
    int eventful = 0, uneven = 0, looked_into = 0;
    if (enough) {
        if (last)
            to->tau = hold;
        now->at = 0.0;
        end->at = wanted;
        stickslip_find_functions(m, end);
        eventful = stickslip_may_have_event(m, &curve, end);
        uneven = stickslip_may_have_extreme(m, wall, from, &stages);
        looked_into = eventful || uneven || to->tau > h;
        if (looked_into) {
            stickslip_interpolant(m, wall, wanted, from, to, &stages, dense);
            const double reading = stickslip_reading_error(m, dense);
            error = error > reading ? error : reading;
        }
    }
    const double next = wanted * stickslip_long_factor(error);
    if (!(error <= 1.0) && wanted > STEP_MIN) {
        if (wall >= 0)
            m->touch_step = next;
        else
            *step = next / LONGER;
        return 0;
    }
    if (!(error < 1e30))
        return -1;
    const double found = eventful ? stickslip_first_event(m, &curve, end, &ending->which) : -1.0;
    ending->taken = to->tau - from->tau;
    if (found > 0.0) {
        ending->taken = stickslip_land(m, &curve, ending->which, found, end);
    } else if (found == 0.0) {
        ending->taken = 0.0;
        *end = *now;
    } else {
        ending->which = -1;
    }
    if (wall >= 0) {
        if (!last || next > m->touch_step)
            m->touch_step = next;
    } else if (ending->which < 0 && (!last || next / LONGER > *step)) {
        *step = next / LONGER;
    }
    m->ahead.at = 0.0;
    m->ahead.end = ending->taken;
    m->ahead.n_extremes = 0;
    if (uneven)
        stickslip_find_extremes(m, from->tau);
    return 1;
}

static int is_too_much(int events, int trials, double tau, double h, char *message)
{
    if (events <= MAX_EVENTS_PER_STEP && trials <= MAX_TRIALS_PER_STEP)
        return 0;
    const int many_events = events > MAX_EVENTS_PER_STEP;
    snprintf(message, MODEL_MESSAGE_SIZE,
             "given up after %d %s, %.3g s into a step of %g s: take shorter steps, a larger tolerance "
             "or slower mechanics (softer walls and springs, less damping, larger masses and "
             "inductances)",
             many_events ? events : trials, many_events ? "events" : "internal steps", tau, h);
    return 1;
}

int stickslip_advance(Model *m, double h, char *message)
{
    Point points[2], *now = &points[0], *end = &points[1];
    /* Inputs that have gone on for a while are taken to go on for as long again. */
    const double said = m->r.inputs_hold_for, seems = h + m->steady_for;
    const double hold = said > seems ? said : seems;
    Ahead *ahead = &m->ahead;
    int events = 0;

    if (ahead->active) {
        finish_ahead(m, h, now);
    } else {
        if (m->n.prescribed)
            set_surface(m);
        stickslip_settle_mode(m, 0.0);
        start_from(m, 0.0, now);
        begin_extremes(m, now->knot.y, now->knot.dy[V]);
        note_point(m, now);
    }

    for (int trials = 0; now->knot.tau < h; trials++) {
        if (is_too_much(events, trials, now->knot.tau, h, message))
            return -1;
        Ending ending;
        const double *const step = step_of(m);
        const int wall = stickslip_clock_of(m, now->knot.y);
        /* At a wall without a clock no high order holds. */
        const int is_long = hold - now->knot.tau > WORTH * *step && (wall >= 0 || step == m->step);
        const int taken = is_long ? long_step(m, now, wall, h, hold, end, &ending)
                                  : short_step(m, now, h, end, &ending);
        if (taken < 0) {
            snprintf(message, MODEL_MESSAGE_SIZE,
                     "the mechanics left the range of numbers; the inputs or parameters are too "
                     "large");
            return -1;
        }
        if (!taken) {
            stickslip_count(&m->n.internal_rejected);
            continue;
        }
        stickslip_count(&m->n.internal_steps);
        const EventFunction *event = ending.which < 0 ? NULL : &now->functions[ending.which];
        if (is_long) {
            if (end->knot.tau > h + STEP_MIN) {
                ahead->active = 1;
                ahead->ends_with = event ? (int)event->kind : -1;
                ahead->surface = event ? event->surface : 0;
                for (int j = 0; j < moving(m) * N_STATES; j++)
                    ahead->last[j] = end->knot.y[j];
                go_on_to(m, h - now->knot.tau);
                return 0;
            }
            if (end->knot.tau > h)
                end->knot.tau = h;
            stickslip_note_inner_extremes(m, 0.0, ahead->end);
        } else {
            stickslip_note_short_extreme(m, &now->knot, &end->knot, ending.taken);
        }
        note_time(m, ending.taken);
        note_point(m, end);
        take_up(m, end);
        if (event) {
            events++;
            stickslip_apply_event(m, event->surface, end->knot.tau, event->kind);
            start_from(m, end->knot.tau, now);
            note_point(m, now);
        } else {
            Point *reached = end;
            end = now;
            now = reached;
        }
    }
    return 0;
}
