/* SPDX-License-Identifier: BSD-2-Clause */
/* The coil and the armature of a relay. Its flux linkage is the state, the voltage at the coil's
 * inductance the input and the current the output, so the coil's resistance is the circuit's:
 *
 *     d(flux)/dt = voltage,   current = flux (x + closed_gap)/a,   force of the coil = flux^2/(2 a)
 *     m dv/dt = spring + stiffness (travel - x) - force - d v, and the stops at x = 0 and travel
 *
 * x is the air gap beside the one that stays closed. The contact is closed below contact_gap. */
#include <math.h>
#include <stdio.h>

#include "../thin/model.h"

enum {
    TIME, A, CLOSED_GAP, TRAVEL, MASS, SPRING, STIFFNESS, DAMPING, STOP, STOP_DAMPING, CONTACT_GAP,
    VOLTAGE, CURRENT, CURRENT_RATE, GAP, SPEED, CONTACT
};

static const Variable variables[] = {
    {PARAMETER, "a", "H.m", 1.2e-4, "Inductance times the whole gap", 0},
    {PARAMETER, "closed_gap", "m", 3e-4, "The gap that the closed armature leaves", 0},
    {PARAMETER, "travel", "m", 1e-3, "Of the armature", 0},
    {PARAMETER, "mass", "kg", 3e-3, "Of the armature", 0},
    {PARAMETER, "spring", "N", 0.3, "Force of the spring on the open armature", 0},
    {PARAMETER, "stiffness", "N/m", 200.0, "Of the spring", 0},
    {PARAMETER, "damping", "N.s/m", 0.05, "Of the armature", 0},
    {PARAMETER, "stop", "N/m", 2e5, "Stiffness of the stops", 0},
    {PARAMETER, "stop_damping", "N.s/m", 10.0, "Damping of the stops", 0},
    {PARAMETER, "contact_gap", "m", 1e-4, "Below which the contact is closed", 0},
    {INPUT, "voltage", "V", 0.0, "At the coil's inductance", 0},
    {OUTPUT, "current", "A", 0.0, "Of the coil", CURRENT_RATE},
    {OUTPUT, "current_rate", "A/s", 0.0, "Its time derivative", 0},
    {OUTPUT, "gap", "m", 0.0, "Of the armature, x", 0},
    {OUTPUT, "speed", "m/s", 0.0, "Of the armature, v", 0},
    {OUTPUT, "contact", "1", 0.0, "1 while it is closed, else 0", 0},
};

typedef struct {
    double x, v, flux;
} State;

static State rates(const double *p, State s)
{
    const double low = -s.x, high = s.x - p[TRAVEL]; /* by which the stops are pressed */
    double push = p[SPRING] + p[STIFFNESS] * (p[TRAVEL] - s.x) - p[DAMPING] * s.v;
    push -= s.flux * s.flux / (2.0 * p[A]);
    if (low > 0.0)
        push += fmax(0.0, p[STOP] * low - p[STOP_DAMPING] * s.v);
    if (high > 0.0)
        push -= fmax(0.0, p[STOP] * high + p[STOP_DAMPING] * s.v);
    return (State){s.v, push / p[MASS], p[VOLTAGE]};
}

static State moved(State s, State rate, double h)
{
    return (State){s.x + h * rate.x, s.v + h * rate.v, s.flux + h * rate.flux};
}

static void show(Run *run)
{
    double *v = run->v;
    const State *s = run->state;
    const double gap = s->x + v[CLOSED_GAP];
    v[CURRENT] = s->flux * gap / v[A];
    v[CURRENT_RATE] = (v[VOLTAGE] * gap + s->flux * s->v) / v[A];
    v[GAP] = s->x;
    v[SPEED] = s->v;
    v[CONTACT] = s->x < v[CONTACT_GAP];
}

static int start(Run *run)
{
    State *s = run->state;
    const double *p = run->v;
    if (!(p[A] > 0.0 && p[CLOSED_GAP] > 0.0 && p[TRAVEL] > 0.0 && p[MASS] > 0.0 && p[STOP] > 0.0)) {
        snprintf(run->why, sizeof run->why,
                 "a, closed_gap, travel, mass and stop must be above 0");
        return 0;
    }
    /* At rest on the open stop. */
    s->x = p[TRAVEL] + p[SPRING] / (p[STOP] + p[STIFFNESS]);
    show(run);
    return 1;
}

static int step_by(Run *run, double h)
{
    const double *p = run->v;
    State *s = run->state;
    const double fastest = sqrt(p[STOP] / p[MASS]) + (p[DAMPING] + p[STOP_DAMPING]) / p[MASS];
    const double n = 1.0 + floor(h * fastest / 0.05);
    h /= n;
    for (double k = 0.0; k < n; k++) { /* Runge and Kutta's, of order 4 */
        const State before = *s;
        const State a = rates(p, *s), b = rates(p, moved(*s, a, h / 2.0));
        const State c = rates(p, moved(*s, b, h / 2.0)), d = rates(p, moved(*s, c, h));
        s->x += h / 6.0 * (a.x + 2.0 * b.x + 2.0 * c.x + d.x);
        s->v += h / 6.0 * (a.v + 2.0 * b.v + 2.0 * c.v + d.v);
        s->flux += h * p[VOLTAGE];
        if (s->x == before.x && s->v == before.v && s->flux == before.flux)
            break; /* it rests, so further steps change nothing */
    }
    show(run);
    return 1;
}

static const Model relay = {
    .name = "relay",
    .about = "The coil and the armature of a relay",
    .token = "relay-1",
    .variables = variables,
    .count = sizeof variables / sizeof *variables,
    .state = sizeof(State),
    .step = 1e-5,
    .start = start,
    .step_by = step_by,
};

const Model *model(const char *resources, char why[512])
{
    (void)resources, (void)why;
    return &relay;
}
