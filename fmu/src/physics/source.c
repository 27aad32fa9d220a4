/* SPDX-License-Identifier: BSD-2-Clause */
#include "source.h"

#include <math.h>

#include "coil.h"

/* A current that misses its target by less than this part of the current limit has met it. */
static const double MET = 1e-12;

int stickslip_source_events(const Model *m, const double y[N_STATES], int s, double tau,
                            double emf_rate, EventFunction functions[MAX_EVENT_FUNCTIONS], int n)
{
    const Mode *mode = m->mode + s;
    const double limit = limit_of_coil(m), asked = commanded(m, s, tau), slope = commanded_rate(m, s);
    const double amperes = 1e-15 * limit, volts = 1e-14 * (m->r.output_high - m->r.output_low);
#define ADD(k, v, r, e)                                                                            \
    functions[n++] =                                                                               \
        (EventFunction){.kind = k, .surface = s, .value = v, .rate = r, .noise = e}
    if (mode->limited) {
        ADD(EVENT_COMMAND_BACK, mode->limited * asked - limit, mode->limited * slope, amperes);
    } else {
        ADD(EVENT_COMMAND_HIGH, limit - asked, -slope, amperes);
        ADD(EVENT_COMMAND_LOW, limit + asked, slope, amperes);
    }
    const double rate = stickslip_coil_current_rate(m, mode, y, s);
    if (mode->output) {
        ADD(EVENT_CURRENT_MET, mode->output * (target(m, mode, s, tau) - y[I_COIL]),
            mode->output * (target_rate(m, mode, s) - rate), amperes);
    } else {
        const double wanted = needed(m, mode, y, s);
        double growth = loop_resistance(m) * rate + emf_rate;
        if (has_eddy(m))
            growth += m->r.eddy_resistance * (rate - eddy_voltage(m, y) / m->r.eddy_inductance);
        ADD(EVENT_OUTPUT_HIGH, m->r.output_high - wanted, -growth, volts);
        ADD(EVENT_OUTPUT_LOW, wanted - m->r.output_low, growth, volts);
    }
#undef ADD
    return n;
}

void stickslip_source_apply(Model *m, int s, double tau, EventKind kind)
{
    Mode *mode = m->mode + s;
    switch (kind) {
    case EVENT_COMMAND_HIGH:
        mode->limited = 1;
        break;
    case EVENT_COMMAND_LOW:
        mode->limited = -1;
        break;
    case EVENT_COMMAND_BACK:
        mode->limited = 0;
        break;
    case EVENT_CURRENT_MET:
        mode->output = 0;
        break;
    case EVENT_OUTPUT_HIGH:
        mode->output = 1;
        return; /* not settled: on the boundary, rounding could undo the mode just taken */
    case EVENT_OUTPUT_LOW:
        mode->output = -1;
        return;
    default:
        return;
    }
    if (mode->output == 0)
        m->y[s * N_STATES + I_COIL] = target(m, mode, s, tau); /* to the last bit, and not as near as time is */
    stickslip_source_settle_output(m, s, tau);
}

void stickslip_source_settle_command(Model *m, int s, double tau)
{
    if (!m->n.source)
        return;
    const double asked = commanded(m, s, tau);
    m->mode[s].limited = fabs(asked) <= limit_of_coil(m) ? 0 : asked > 0.0 ? 1 : -1;
}

void stickslip_source_settle_output(Model *m, int s, double tau)
{
    if (!m->n.source)
        return;
    Mode *mode = m->mode + s;
    double *y = m->y + s * N_STATES;
    const double gap = target(m, mode, s, tau) - y[I_COIL];
    if (fabs(gap) > MET * limit_of_coil(m)) {
        mode->output = gap > 0.0 ? 1 : -1;
        return;
    }
    y[I_COIL] = target(m, mode, s, tau);
    const double wanted = needed(m, mode, y, s);
    mode->output = wanted > m->r.output_high ? 1 : wanted < m->r.output_low ? -1 : 0;
}

double stickslip_coil_voltage_per_slope(const Model *m, int s)
{
    if (!m->n.source || m->mode[s].output || m->mode[s].limited)
        return 0.0;
    return m->r.inductance / (m->r.sense_resistance * m->n.coil_count);
}

double stickslip_magnetic_energy(const Model *m, const double y[N_STATES])
{
    return 0.5 * (m->r.inductance * y[I_COIL] * y[I_COIL] +
                  m->r.eddy_inductance * y[I_EDDY] * y[I_EDDY]);
}
