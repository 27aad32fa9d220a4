/* SPDX-License-Identifier: BSD-2-Clause */
#include "model.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "advance.h"
#include "coil.h"
#include "events.h"
#include "forces.h"
#include "mechanics.h"
#include "source.h"

#define PARAMETER(name, unit, start, min, max, text) {#name, unit, text, KIND_PARAMETER, start, min, max},
#define TUNABLE(name, unit, start, min, max, text) {#name, unit, text, KIND_TUNABLE, start, min, max},
#define INPUT(name, unit, start, min, max, text) {#name, unit, text, KIND_INPUT, start, min, max},
#define OUTPUT(name, unit, text) {#name, unit, text, KIND_OUTPUT, 0.0, 0.0, 0.0},
#define INT_PARAMETER(name, start, min, max, text)
#define INT_OUTPUT(name, text)
const VariableInfo stickslip_real_info[N_REALS] = {
#include "variables.def"
};
#undef PARAMETER
#undef TUNABLE
#undef INPUT
#undef OUTPUT
#undef INT_PARAMETER
#undef INT_OUTPUT

#define PARAMETER(name, unit, start, min, max, text)
#define TUNABLE(name, unit, start, min, max, text)
#define INPUT(name, unit, start, min, max, text)
#define OUTPUT(name, unit, text)
#define INT_PARAMETER(name, start, min, max, text) {#name, "1", text, KIND_PARAMETER, start, min, max},
#define INT_OUTPUT(name, text) {#name, "1", text, KIND_OUTPUT, 0.0, 0.0, 0.0},
const VariableInfo stickslip_integer_info[N_INTEGERS] = {
#include "variables.def"
};

_Static_assert(sizeof(Reals) == N_REALS * sizeof(double), "reals must be contiguous");
_Static_assert(sizeof(Integers) == N_INTEGERS * sizeof(int), "integers must be contiguous");

/* Inputs that differ by less, of themselves or of their units, are the same. */
static const double ROUNDING = 1e-13;

static int say(char *message, const char *sentence)
{
    snprintf(message, MODEL_MESSAGE_SIZE, "%s", sentence);
    return -1;
}

void stickslip_model_defaults(Model *m)
{
    memset(m, 0, sizeof *m);
    for (size_t i = 0; i < N_REALS; i++)
        ((double *)&m->r)[i] = stickslip_real_info[i].start;
    for (size_t i = 0; i < N_INTEGERS; i++)
        ((int *)&m->n)[i] = (int)stickslip_integer_info[i].start;
}

static int check(const Model *m, const VariableInfo *info, double value, char *message)
{
    if (info->kind == KIND_OUTPUT || (info->kind == KIND_PARAMETER && m->initialised)) {
        snprintf(message, MODEL_MESSAGE_SIZE, "%s cannot be set: it is %s", info->name,
                 info->kind == KIND_OUTPUT ? "an output" : "fixed after initialisation");
        return -1;
    }
    if (!(value >= info->min && value <= info->max)) {
        snprintf(message, MODEL_MESSAGE_SIZE, "%s = %g %s is outside %g ... %g", info->name, value,
                 info->unit, info->min, info->max);
        return -1;
    }
    return 0;
}

int stickslip_model_check_real(const Model *m, size_t place, double value, char *message)
{
    if (place >= N_REALS)
        return say(message, "no real variable has this value reference");
    return check(m, &stickslip_real_info[place], value, message);
}

int stickslip_model_set_real(Model *m, size_t place, double value, char *message)
{
    if (stickslip_model_check_real(m, place, value, message))
        return -1;
    stickslip_model_put_real(m, place, value);
    return 0;
}

void stickslip_model_put_real(Model *m, size_t place, double value)
{
    double *now = (double *)&m->r + place;
    if (*now == value)
        return;
    /* An importer that leads an input along a straight has other roundings. */
    const double off = fabs(value - *now);
    if (off > ROUNDING * fabs(value) && off > ROUNDING &&
        place != offsetof(Reals, inputs_hold_for) / sizeof(double)) {
        stickslip_turn_back(m);
        m->steady_for = 0.0;
    }
    *now = value;
}

int stickslip_model_set_integer(Model *m, size_t place, int value, char *message)
{
    if (place >= N_INTEGERS)
        return say(message, "no integer variable has this value reference");
    if (check(m, &stickslip_integer_info[place], value, message))
        return -1;
    ((int *)&m->n)[place] = value;
    return 0;
}

/* Force on the ram at rest at q, less its weight. */
static double ram_balance(const Model *m, double q)
{
    const Reals *p = &m->r;
    const double below = -p->travel - q, above = q - p->travel;
    const double force = suspension_at_rest(m, q) - p->ram_mass * p->gravity;
    if (above > 0.0)
        return force - wall_spring(p, above);
    return below > 0.0 ? force + wall_spring(p, below) : force;
}

/* Where the balance falls through zero, which is a stable rest: above at `high`, below at `low`. */
static double rest_between(const Model *m, double low, double high)
{
    for (int i = 0; i < 200 && high > low; i++) {
        double middle = 0.5 * (low + high);
        if (middle == low || middle == high)
            break;
        if (ram_balance(m, middle) > 0.0)
            low = middle;
        else
            high = middle;
    }
    return fabs(ram_balance(m, low)) < fabs(ram_balance(m, high)) ? low : high;
}

/* Where the travel is cut into pieces on each of which the balance only rises or only falls, rising:
 * its ends, the centre, and where the cubic has no stiffness, twice at most. */
static void cut_travel(const Model *m, double at[5])
{
    const double k1 = m->r.suspension_k1, k2 = m->r.suspension_k2, k3 = m->r.suspension_k3;
    const double square = k2 * k2 - 3.0 * k1 * k3, travel = m->r.travel;
    double all[5] = {-travel, 0.0, travel, 0.0, 0.0};
    if (m->n.suspension == CUBIC && square > 0.0) {
        /* Of the two forms of a root that which does not cancel. */
        const double far = k2 < 0.0 ? sqrt(square) - k2 : -sqrt(square) - k2;
        all[3] = k1 / far;
        all[4] = far / (3.0 * k3);
    }
    for (int n = 0; n < 5; n++) {
        const double next = all[n] < -travel ? -travel : all[n] > travel ? travel : all[n];
        int k = n;
        for (; k > 0 && at[k - 1] > next; k--)
            at[k] = at[k - 1];
        at[k] = next;
    }
}

/* At rest, at the place nearest to the centre; at a wall where there is none within the travel. */
static void hang_ram(Model *m)
{
    const double travel = m->r.travel;
    double at[5], nearest = INFINITY;
    cut_travel(m, at);
    for (int k = 0; k < 4; k++) {
        if (!(ram_balance(m, at[k]) > 0.0 && ram_balance(m, at[k + 1]) <= 0.0))
            continue;
        const double rest = rest_between(m, at[k], at[k + 1]);
        nearest = fabs(rest) < fabs(nearest) ? rest : nearest;
    }
    const int above = ram_balance(m, travel) > 0.0, below = ram_balance(m, -travel) < 0.0;
    if (isfinite(nearest) || !(above || below)) { /* a ram that nothing moves is in the middle */
        m->y[Q] = isfinite(nearest) ? nearest : 0.0;
        return;
    }
    m->mode[0].side = below ? -1 : 1;
    m->mode[0].wall = m->n.contact == 1 ? WALL_TOUCH : WALL_REST;
    double low = m->mode[0].side * travel, high = low;
    if (m->mode[0].wall == WALL_REST) {
        m->y[Q] = low;
        return;
    }
    while (ram_balance(m, low) < 0.0)
        low *= 2.0;
    while (ram_balance(m, high) > 0.0)
        high *= 2.0;
    m->y[Q] = rest_between(m, low, high);
}

/* On the ground, which the lifted surface may press into a compliant wall. */
static void stand_ram(Model *m)
{
    const double q = -m->r.initial_lift;
    m->y[Q] = q;
    if (fabs(q) > m->r.travel) {
        m->mode[0].wall = WALL_TOUCH;
        m->mode[0].side = q > 0.0 ? 1 : -1;
    }
}

int stickslip_model_contradiction(const Model *m, char *message)
{
    if (m->r.mu_k > m->r.mu_s) {
        snprintf(message, MODEL_MESSAGE_SIZE, "mu_k = %g is larger than mu_s = %g", m->r.mu_k,
                 m->r.mu_s);
        return -1;
    }
    if (m->n.suspension == REPULSION && !(m->r.suspension_distance >= 1.1 * m->r.travel)) {
        snprintf(message, MODEL_MESSAGE_SIZE,
                 "suspension_distance = %g m must be at least 1.1 times travel = %g m",
                 m->r.suspension_distance, m->r.travel);
        return -1;
    }
    if (m->n.ram_fixed && !m->n.prescribed && m->n.contact == 2 &&
        fabs(m->r.initial_lift) > m->r.travel) {
        snprintf(message, MODEL_MESSAGE_SIZE,
                 "initial_lift = %g m lies beyond a rigid wall: travel = %g m", m->r.initial_lift,
                 m->r.travel);
        return -1;
    }
    if (m->n.prescribed && m->n.source)
        return say(message, "prescribed = 1 leaves the coil out: source must be 0 then");
    if (m->n.independent &&
        (m->n.n_surfaces != 2 || m->n.prescribed || m->n.ram_fixed || m->r.mu_plate > 0.0))
        return say(message, "independent = 1 needs n_surfaces = 2, and prescribed, ram_fixed and "
                            "mu_plate to be 0");
    return 0;
}

int stickslip_model_initialise(Model *m, char *message)
{
    if (stickslip_model_contradiction(m, message))
        return -1;
    memset(m->y, 0, sizeof m->y);
    memset(m->mode, 0, sizeof m->mode); /* the walls free, the part sticking */
    if (m->n.prescribed) {
        m->y[V] = m->r.surface_velocity;
    } else {
        if (!m->n.ram_fixed)
            hang_ram(m);
        else
            stand_ram(m);
        m->y[Z] = stickslip_rest_height(m) + m->r.initial_lift;
    }
    m->mode[1] = m->mode[0];
    memcpy(m->y + N_STATES, m->y, N_STATES * sizeof *m->y);
    if (!isfinite(m->y[Q]))
        return say(message, "the ram has no static equilibrium: the suspension is too weak");
    m->step[0] = m->step[1] = 1e-6;
    m->touch_step = m->steady_for = 0.0;
    memset(&m->ahead, 0, sizeof m->ahead);
    m->energy_at_start = stickslip_energy_stored(m, m->y);
    stickslip_settle_mode(m, 0.0);
    m->r.stick_time = m->r.stick_time_2 = 0.0;
    m->r.output_high_time = m->r.output_low_time = m->r.current_limit_time = 0.0;
    m->r.coil_current_max = m->r.coil_current_min = 0.0;
    m->n.impacts = m->n.stick_slip_events = m->n.internal_steps = m->n.internal_rejected = 0;
    m->initialised = 1;
    stickslip_model_outputs(m);
    m->r.a_surface_max = m->r.a_surface_min = m->r.a_surface;
    m->r.v_surface_max = m->r.v_surface_min = m->r.v_surface;
    m->r.z_surface_max = m->r.z_surface_min = m->r.z_surface;
    m->extremes_over = 1;
    return 0;
}

/* N; so far below 0 the sum of many steps may end that lead to 0. */
static const double NO_FORCE = 1e-9;

static double normal_force_after(const Model *m, double h)
{
    return m->r.normal_force + m->r.normal_force_slope * h;
}

/* The inputs after h. */
static void move_inputs(Model *m, double h)
{
    const double normal = normal_force_after(m, h);
    m->r.current += m->r.current_slope * h;
    m->r.command += m->r.command_slope * h;
    m->r.current_2 += m->r.current_2_slope * h;
    m->r.command_2 += m->r.command_2_slope * h;
    m->r.surface_velocity += m->r.surface_acceleration * h;
    m->r.normal_force = normal > 0.0 ? normal : 0.0;
    m->steady_for += h;
    m->r.inputs_hold_for = m->r.inputs_hold_for > h ? m->r.inputs_hold_for - h : 0.0;
}

static void reach_within(Model *m)
{
    stickslip_model_outputs(m);
    stickslip_reached(m);
}

int stickslip_model_step_within(Model *m, double h)
{
    if (!m->initialised || !(h > 0.0) || normal_force_after(m, h) < -NO_FORCE ||
        !stickslip_advance_within(m, h))
        return 0;
    move_inputs(m, h);
    reach_within(m);
    return 1;
}

int stickslip_model_step(Model *m, double h, char *message)
{
    if (!m->initialised)
        return say(message, "a step before initialisation");
    if (!(h > 0.0) || !isfinite(h))
        return say(message, "the step must be a positive number of seconds");
    if (stickslip_model_contradiction(m, message)) /* of tunable parameters, set one by one */
        return -1;
    if (normal_force_after(m, h) < -NO_FORCE)
        return say(message, "normal_force falls below 0 N within the step; its slope is too steep");
    if (stickslip_advance(m, h, message))
        return -1;
    move_inputs(m, h);
    if (m->ahead.active)
        reach_within(m);
    return 0;
}

static const double NO_IMPACT = 1e9; /* s; as variables.def has it */

static void outputs_of_second(Model *m)
{
    Forces f;
    const double *y = m->y + N_STATES;
    Reals *r = &m->r;
    stickslip_forces(m, m->mode, m->y, 1, 0.0, &f);
    r->z_surface_2 = y[Z];
    r->v_surface_2 = y[V];
    r->a_surface_2 = f.a_surface;
    r->z_ram_2 = y[Z] + y[Q];
    r->v_ram_2 = y[V] + y[U];
    r->back_emf_2 = force_factor_at(m, y[Q]) * y[U];
    r->friction_force_2 = f.friction;
    r->coil_current_2 = y[I_COIL];
    r->coil_voltage_2 = m->n.source ? stickslip_coil_voltage(m, m->mode + 1, y, 1) : 0.0;
    m->n.sticking_2 = m->mode[1].slip == 0;
}

/* Time until q reaches `place` at the velocity u and the acceleration a, all in its direction. */
static double time_to(double gap, double u, double a)
{
    if (gap <= 0.0)
        return u > 0.0 ? 0.0 : NO_IMPACT;
    const double square = u * u + 2.0 * a * gap;
    if (square < 0.0 || (u <= 0.0 && a <= 0.0))
        return NO_IMPACT;
    /* Of the two forms of the root, the one that does not cancel. */
    return u > 0.0 ? 2.0 * gap / (u + sqrt(square)) : (sqrt(square) - u) / a;
}

static double time_to_impact(const Model *m, const double y[N_STATES], double a_q)
{
    if (m->n.prescribed || m->mode[0].wall != WALL_FREE)
        return NO_IMPACT;
    const double above = time_to(m->r.travel - y[Q], y[U], a_q);
    const double below = time_to(m->r.travel + y[Q], -y[U], -a_q);
    return above < below ? above : below;
}

/* The derivative of the same by a_q: the place at that time is the wall's, whatever a_q is. */
static double time_to_impact_slope(const Model *m, const double y[N_STATES], double a_q)
{
    const double t = time_to_impact(m, y, a_q), speed = y[U] + a_q * t;
    return t >= NO_IMPACT || speed == 0.0 ? 0.0 : -0.5 * t * t / speed;
}

/* `plain` as forces_of() has it. */
STICKSLIP_INLINE void outputs_of_first(const int plain, Model *m)
{
    Forces f;
    const double *y = m->y;
    Reals *r = &m->r;
    forces_of(plain, m, m->mode, y, 0, 0.0, &f);
    r->z_surface = y[Z];
    r->v_surface = y[V];
    r->a_surface = f.a_surface;
    r->z_ram = !plain && m->n.ram_fixed && !m->n.prescribed ? stickslip_rest_height(m) : y[Z] + y[Q];
    r->v_ram = y[V] + y[U];
    r->a_ram = f.a_surface + f.a_q;
    r->z_part = y[Z] + y[D];
    r->v_part = y[V] + y[W];
    r->a_part = f.a_surface + f.a_slip;
    r->slip = y[D];
    r->q = y[Q];
    r->q_rate = y[U];
    r->back_emf = force_factor_at(m, y[Q]) * y[U];
    r->friction_force = f.friction;
    r->plate_force = f.plate;
    r->wall_force = f.wall;
    r->coil_current = y[I_COIL];
    r->coil_voltage = m->n.source ? stickslip_coil_voltage(m, m->mode, y, 0) : 0.0;
    m->n.output_clamped = m->mode[0].output;
    m->n.command_limited = m->mode[0].limited;
    m->n.sticking = m->mode[0].slip == 0;
    m->a_q = f.a_q;
    m->coupling_old = m->energies_old = 1;
    m->n.wall_contact = m->mode[0].side;
}

void stickslip_model_outputs(Model *m)
{
    if (is_plain(m)) {
        outputs_of_first(1, m);
        return;
    }
    outputs_of_first(0, m);
    if (m->n.independent)
        outputs_of_second(m);
}

void stickslip_model_coupling(Model *m)
{
    m->coupling_old = 0;
    m->r.back_emf_slope = back_emf_slope(m, m->y, m->a_q);
    m->r.motional_flux = motional_flux(m, m->y[Q]);
    m->r.time_to_impact = time_to_impact(m, m->y, m->a_q);
}

/* Sum of one of the energies over all surfaces that move. */
static double sum_of(const Model *m, const double y[N_ALL], int state)
{
    return m->n.independent ? y[state] + y[N_STATES + state] : y[state];
}

void stickslip_model_energies(Model *m)
{
    Reals *r = &m->r;
    double all[N_ALL];
    stickslip_energies_now(m, all);
    m->energies_old = 0;
    r->energy_in = sum_of(m, all, E_IN);
    r->energy_friction = sum_of(m, all, E_FRICTION);
    r->energy_impact = sum_of(m, all, E_IMPACT);
    r->energy_damping = sum_of(m, all, E_DAMPING);
    r->energy_stored = stickslip_energy_stored(m, all) - m->energy_at_start;
    r->energy_output = sum_of(m, all, E_OUTPUT);
    r->energy_copper = sum_of(m, all, E_COPPER);
    r->energy_magnetic = 0.0;
    for (int s = 0; s < moving(m); s++) {
        const double *y = all + s * N_STATES;
        r->energy_magnetic += stickslip_magnetic_energy(m, y);
        if (m->mode[s].wall == WALL_PARTING)
            r->energy_impact -= stickslip_wall_energy(m, m->mode + s, y);
    }
}

/* By how much an output changes as an input, all others as they are, goes from one value to another. */
static double difference(const Model *m, size_t output, size_t input, double from, double to)
{
    Model a = *m;
    double *inputs[] = {&a.r.current, &a.r.current_2, &a.r.normal_force,
                        &a.r.surface_acceleration};
    const size_t places[] = {offsetof(Reals, current) / sizeof(double),
                             offsetof(Reals, current_2) / sizeof(double),
                             offsetof(Reals, normal_force) / sizeof(double),
                             offsetof(Reals, surface_acceleration) / sizeof(double)};
    Forces here, low, high, low_2 = {0}, high_2 = {0};

    for (int i = 0; i < 4; i++) {
        if (input != places[i])
            continue;
        *inputs[i] = from;
        stickslip_forces(&a, a.mode, a.y, 0, 0.0, &low);
        if (m->n.independent)
            stickslip_forces(&a, a.mode, a.y, 1, 0.0, &low_2);
        *inputs[i] = to;
        stickslip_forces(&a, a.mode, a.y, 0, 0.0, &high);
        if (m->n.independent)
            stickslip_forces(&a, a.mode, a.y, 1, 0.0, &high_2);
        switch (output) {
#define PLACE(name) offsetof(Reals, name) / sizeof(double)
        case PLACE(a_surface):
            return high.a_surface - low.a_surface;
        case PLACE(a_ram):
            return (high.a_surface + high.a_q) - (low.a_surface + low.a_q);
        case PLACE(a_part):
            return (high.a_surface + high.a_slip) - (low.a_surface + low.a_slip);
        case PLACE(back_emf_slope):
            return force_factor_at(m, m->y[Q]) * (high.a_q - low.a_q);
        case PLACE(time_to_impact):
            stickslip_forces(m, m->mode, m->y, 0, 0.0, &here);
            return time_to_impact_slope(m, m->y, here.a_q) * (high.a_q - low.a_q);
        case PLACE(friction_force):
            return high.friction - low.friction;
        case PLACE(plate_force):
            return high.plate - low.plate;
        case PLACE(wall_force):
            return high.wall - low.wall;
        case PLACE(a_surface_2):
            return high_2.a_surface - low_2.a_surface;
        case PLACE(friction_force_2):
            return high_2.friction - low_2.friction;
#undef PLACE
        }
    }
    return 0.0;
}

double stickslip_model_derivative(const Model *m, size_t output, size_t input)
{
    if (output == offsetof(Reals, coil_voltage) / sizeof(double) &&
        input == offsetof(Reals, command_slope) / sizeof(double))
        return stickslip_coil_voltage_per_slope(m, 0);
    if (output == offsetof(Reals, coil_voltage_2) / sizeof(double) &&
        input == offsetof(Reals, command_2_slope) / sizeof(double))
        return m->n.independent ? stickslip_coil_voltage_per_slope(m, 1) : 0.0;
    /* Forces are affine in each input, but for those on a part at rest on surface and plate, which
     * share its weight otherwise from a normal force on. */
    const double carries = m->r.mu_plate > 0.0 && m->r.mu_s > 0.0
                               ? stickslip_part_mass_per_surface(m) * m->r.gravity / m->r.mu_s
                               : 0.0;
    if (input != offsetof(Reals, normal_force) / sizeof(double) || carries == 0.0)
        return difference(m, output, input, 0.0, 1.0);
    return m->r.normal_force < carries
               ? difference(m, output, input, 0.0, carries) / carries
               : difference(m, output, input, carries, 2.0 * carries) / carries;
}
