/* SPDX-License-Identifier: BSD-2-Clause */
/* A jaw that a motor presses on a part through a gear and a spring:
 *
 *     m dv/dt = a i - F - d v,   F = k x + c v while the spring is pressed, never below 0
 *
 * x is the way by which the gear's end has pressed the spring, v = dx/dt; m holds the rotor's inertia
 * over the gear's lead squared; a is the motor's constant over that lead, N/A and V s/m. */
#include <math.h>
#include <stdio.h>

#include "../thin/model.h"

enum { TIME, CONSTANT, MASS, STIFFNESS, DAMPING, FRICTION, FORCE_0, CURRENT, FORCE, FORCE_RATE, EMF };

static const Variable variables[] = {
    {PARAMETER, "constant", "N/A", 2.0, "Force of the motor behind the gear, for its current", 0},
    {PARAMETER, "mass", "kg", 0.05, "Of jaw, gear and rotor as the spring feels them", 0},
    {PARAMETER, "stiffness", "N/m", 2000.0, "Of the spring", 0},
    {PARAMETER, "damping", "N.s/m", 2.0, "Of the spring", 0},
    {PARAMETER, "friction", "N.s/m", 5.0, "Of the gear", 0},
    {PARAMETER, "initial_force", "N", 0.5, "By which the spring is pressed at the start", 0},
    {INPUT, "current", "A", 0.0, "Of the motor", 0},
    {OUTPUT, "normal_force", "N", 0.0, "Of the jaw on the part", FORCE_RATE},
    {OUTPUT, "normal_force_rate", "N/s", 0.0, "Its time derivative", 0},
    {OUTPUT, "back_emf", "V", 0.0, "Of the motor", 0},
};

typedef struct {
    double x, v;
} State;

static double force(const double *p, State s)
{
    return fmax(0.0, p[STIFFNESS] * s.x + p[DAMPING] * s.v);
}

static State rates(const double *p, State s)
{
    const double push = p[CONSTANT] * p[CURRENT] - force(p, s) - p[FRICTION] * s.v;
    return (State){s.v, push / p[MASS]};
}

static State moved(State s, State rate, double h)
{
    return (State){s.x + h * rate.x, s.v + h * rate.v};
}

static void show(Run *run)
{
    const State *s = run->state, rate = rates(run->v, *s);
    run->v[FORCE] = force(run->v, *s);
    run->v[FORCE_RATE] =
        run->v[FORCE] > 0.0 ? run->v[STIFFNESS] * rate.x + run->v[DAMPING] * rate.v : 0.0;
    run->v[EMF] = run->v[CONSTANT] * s->v;
}

static int start(Run *run)
{
    State *s = run->state;
    if (!(run->v[MASS] > 0.0) || !(run->v[STIFFNESS] > 0.0)) {
        snprintf(run->why, sizeof run->why, "mass and stiffness must be above 0");
        return 0;
    }
    s->x = run->v[FORCE_0] / run->v[STIFFNESS];
    show(run);
    return 1;
}

static int step_by(Run *run, double h)
{
    const double *p = run->v;
    State *s = run->state;
    const double fastest = sqrt(p[STIFFNESS] / p[MASS]) + (p[DAMPING] + p[FRICTION]) / p[MASS];
    const double n = 1.0 + floor(h * fastest / 0.05);
    h /= n;
    for (double k = 0.0; k < n; k++) { /* Runge and Kutta's, of order 4 */
        const State before = *s;
        const State a = rates(p, *s), b = rates(p, moved(*s, a, h / 2.0));
        const State c = rates(p, moved(*s, b, h / 2.0)), d = rates(p, moved(*s, c, h));
        s->x += h / 6.0 * (a.x + 2.0 * b.x + 2.0 * c.x + d.x);
        s->v += h / 6.0 * (a.v + 2.0 * b.v + 2.0 * c.v + d.v);
        if (s->x == before.x && s->v == before.v)
            break; /* it rests, so further steps change nothing */
    }
    show(run);
    return 1;
}

static const Model jaw = {
    .name = "jaw",
    .about = "A jaw that a motor presses on a part through a gear and a spring",
    .token = "jaw-1",
    .variables = variables,
    .count = sizeof variables / sizeof *variables,
    .state = sizeof(State),
    .step = 1e-4,
    .start = start,
    .step_by = step_by,
};

const Model *model(const char *resources, char why[512])
{
    (void)resources, (void)why;
    return &jaw;
}
