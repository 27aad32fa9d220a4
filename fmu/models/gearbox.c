/* SPDX-License-Identifier: BSD-2-Clause */
/* A motor's rotor and its load on a stiff gearbox with dry friction, which may hold it at rest:
 *
 *     J dw/dt = torque - load/n - B w - T sgn(w),   |T| whatever is needed at rest
 *
 * w is the rotor's speed, J = rotor + load_inertia/n^2, B = viscous/n^2, T = friction/n. Solved
 * exactly for inputs that are held; the moment of a standstill lies where it lies within a step. */
#include <math.h>
#include <stdio.h>

#include "../thin/model.h"

enum { TIME, ROTOR, LOAD_INERTIA, RATIO, FRICTION, VISCOUS, TORQUE, LOAD, SPEED, ACCELERATION, ANGLE };

static const Variable variables[] = {
    {PARAMETER, "rotor", "kg.m2", 2e-5, "Inertia of the motor's rotor", 0},
    {PARAMETER, "load_inertia", "kg.m2", 2e-2, "Inertia of the load, behind the gear", 0},
    {PARAMETER, "ratio", "1", 20.0, "The motor's speed over the load's", 0},
    {PARAMETER, "friction", "N.m", 0.1, "Dry friction at the load's shaft", 0},
    {PARAMETER, "viscous", "N.m.s", 2e-3, "Friction at the load's shaft that grows with its speed", 0},
    {INPUT, "torque", "N.m", 0.0, "Of the motor on its rotor", 0},
    {INPUT, "load", "N.m", 0.0, "Torque that holds the load back", 0},
    {OUTPUT, "speed", "rad/s", 0.0, "Of the rotor", ACCELERATION},
    {OUTPUT, "acceleration", "rad/s2", 0.0, "Of the rotor, at the end of the step", 0},
    {OUTPUT, "angle", "rad", 0.0, "Of the load's shaft since the start", 0},
};

static int start(Run *run)
{
    const double *v = run->v;
    if (v[ROTOR] + v[LOAD_INERTIA] > 0.0 && v[ROTOR] >= 0.0 && v[LOAD_INERTIA] >= 0.0 &&
        v[RATIO] > 0.0 && v[FRICTION] >= 0.0 && v[VISCOUS] >= 0.0)
        return 1;
    snprintf(run->why, sizeof run->why,
             "the inertias must be above 0, as the ratio; friction and viscous at least 0");
    return 0;
}

/* (x - 1 + exp(-x))/x^2, also for small x. */
static double second(double x)
{
    return x < 1e-4 ? 0.5 - x / 6.0 : (x + expm1(-x)) / (x * x);
}

static int step_by(Run *run, double h)
{
    double *v = run->v;
    const double n = v[RATIO], inertia = v[ROTOR] + v[LOAD_INERTIA] / (n * n);
    const double viscous = v[VISCOUS] / (n * n), friction = v[FRICTION] / n;
    const double drive = v[TORQUE] - v[LOAD] / n;
    double w = v[SPEED], rate = 0.0;
    while (h > 0.0) {
        const double way = w != 0.0 ? w : drive;
        const double net = drive - copysign(friction, way);
        rate = (net - viscous * w) / inertia;
        if (w == 0.0 && net * way <= 0.0) { /* held */
            rate = 0.0;
            break;
        }
        double t = h;
        if (net * w < 0.0) { /* until it stands */
            const double share = -viscous * w / net;
            const double stop = viscous > 0.0 ? log1p(share) * inertia / viscous : -inertia * w / net;
            t = fmin(t, stop);
        }
        const double x = viscous * t / inertia;
        v[ANGLE] += (w * t + rate * t * t * second(x)) / n;
        w = t < h ? 0.0 : w + rate * t * (x > 0.0 ? -expm1(-x) / x : 1.0);
        rate = (net - viscous * w) / inertia;
        h -= t;
    }
    v[SPEED] = w;
    v[ACCELERATION] = rate;
    return 1;
}

static const Model gearbox = {
    .name = "gearbox",
    .about = "A motor's rotor and its load on a stiff gearbox with dry friction",
    .token = "gearbox-1",
    .variables = variables,
    .count = sizeof variables / sizeof *variables,
    .step = 1e-4,
    .start = start,
    .step_by = step_by,
};

const Model *model(const char *resources, char why[512])
{
    (void)resources, (void)why;
    return &gearbox;
}
