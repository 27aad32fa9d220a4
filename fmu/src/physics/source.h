/* SPDX-License-Identifier: BSD-2-Clause */
/* The current source that drives the coils, reduced to its limits.
 *
 * The coils' total current follows command / sense_resistance, at most current_limit, as long as the
 * output voltage that this takes lies between output_low and output_high. Else the output stays at
 * that limit and the coil's inductance decides, until the current meets its target again. For one
 * coil i of n in parallel:
 *
 *     output = n R_s i + v_coil,   v_coil = R_c i + L di/dt + R_2 (i - i_2) + e,
 *     L_2 di_2/dt = R_2 (i - i_2)
 *
 * Only mode.output, mode.limited and the states I_COIL ... E_COPPER belong to it. Each surface s that
 * moves by itself has a source; mode and y are those of s alone. */
#ifndef STICKSLIP_SOURCE_H
#define STICKSLIP_SOURCE_H

#include "coil.h"
#include "event.h"
#include "internal.h"

/* What every evaluation of the rates takes. */

static inline int has_eddy(const Model *m)
{
    return m->r.eddy_inductance > 0.0;
}

static inline double loop_resistance(const Model *m)
{
    return m->r.coil_resistance + m->n.coil_count * m->r.sense_resistance;
}

static inline double limit_of_coil(const Model *m)
{
    return m->r.current_limit / m->n.coil_count;
}

static inline double command_slope(const Model *m, int s)
{
    return s ? m->r.command_2_slope : m->r.command_slope;
}

static inline double commanded(const Model *m, int s, double tau)
{
    return ((s ? m->r.command_2 : m->r.command) + command_slope(m, s) * tau) /
           (m->r.sense_resistance * m->n.coil_count);
}

static inline double commanded_rate(const Model *m, int s)
{
    return command_slope(m, s) / (m->r.sense_resistance * m->n.coil_count);
}

static inline double target(const Model *m, const Mode *mode, int s, double tau)
{
    return mode->limited ? mode->limited * limit_of_coil(m) : commanded(m, s, tau);
}

static inline double target_rate(const Model *m, const Mode *mode, int s)
{
    return mode->limited ? 0.0 : commanded_rate(m, s);
}

static inline double eddy_voltage(const Model *m, const double y[N_STATES])
{
    return has_eddy(m) ? m->r.eddy_resistance * (y[I_COIL] - y[I_EDDY]) : 0.0;
}

/* Output voltage less that of the inductance, V. */
static inline double output_at_rest(const Model *m, const double y[N_STATES])
{
    return loop_resistance(m) * y[I_COIL] + eddy_voltage(m, y) +
           force_factor_at(m, y[Q]) * y[U];
}

/* Output voltage that it takes to follow the target, V. */
static inline double needed(const Model *m, const Mode *mode, const double y[N_STATES], int s)
{
    return output_at_rest(m, y) + m->r.inductance * target_rate(m, mode, s);
}

static inline double output_limit(const Model *m, int side)
{
    return side > 0 ? m->r.output_high : m->r.output_low;
}

/* Current of one coil, A, and its rate, A/s; with a source or as given. */
static inline double stickslip_coil_current(const Model *m, const double y[N_STATES], int s, double tau)
{
    if (m->n.source)
        return y[I_COIL];
    return s ? m->r.current_2 + m->r.current_2_slope * tau : m->r.current + m->r.current_slope * tau;
}

static inline double stickslip_coil_current_rate(const Model *m, const Mode *mode, const double y[N_STATES],
                                   int s)
{
    if (!m->n.source)
        return s ? m->r.current_2_slope : m->r.current_slope;
    if (mode->output == 0)
        return target_rate(m, mode, s);
    return (output_limit(m, mode->output) - output_at_rest(m, y)) / m->r.inductance;
}

/* Across the coils, V. */
static inline double stickslip_coil_voltage(const Model *m, const Mode *mode, const double y[N_STATES], int s)
{
    const double output =
        mode->output ? output_limit(m, mode->output) : needed(m, mode, y, s);
    return output - m->n.coil_count * m->r.sense_resistance * y[I_COIL];
}

/* Rates of I_COIL, I_EDDY, E_OUTPUT and E_COPPER. */
static inline void stickslip_source_rates(const Model *m, const Mode *mode, const double y[N_STATES], int s,
                            double dy[N_STATES])
{
    dy[I_COIL] = dy[I_EDDY] = dy[E_OUTPUT] = dy[E_COPPER] = 0.0;
    if (!m->n.source)
        return;
    const double i = y[I_COIL], eddy = eddy_voltage(m, y);
    const double output =
        mode->output ? output_limit(m, mode->output) : needed(m, mode, y, s);
    dy[I_COIL] = stickslip_coil_current_rate(m, mode, y, s);
    if (has_eddy(m))
        dy[I_EDDY] = eddy / m->r.eddy_inductance;
    dy[E_OUTPUT] = output * i;
    dy[E_COPPER] = loop_resistance(m) * i * i + eddy * (i - y[I_EDDY]);
}

STICKSLIP_INTERNAL_BEGIN

/* Appends the events of the present mode from place n on; returns the new number. emf_rate is the
 * slope of the back-EMF, V/s. */
int stickslip_source_events(const Model *m, const double y[N_STATES], int s, double tau,
                            double emf_rate, EventFunction functions[MAX_EVENT_FUNCTIONS], int n);
void stickslip_source_apply(Model *m, int s, double tau, EventKind kind);

/* Make the mode agree with the command, which may have jumped, and with everything else. */
void stickslip_source_settle_command(Model *m, int s, double tau);
void stickslip_source_settle_output(Model *m, int s, double tau);

/* d(coil_voltage)/d(command_slope) in the present mode, s. */
double stickslip_coil_voltage_per_slope(const Model *m, int s);
double stickslip_magnetic_energy(const Model *m, const double y[N_STATES]);

STICKSLIP_INTERNAL_END

#endif
