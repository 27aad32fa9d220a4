/* SPDX-License-Identifier: BSD-2-Clause */
/* The coil in its magnet: force factor and back-EMF of one surface, of its own states. In a header,
 * since they are called in every evaluation of the rates. */
#ifndef STICKSLIP_COIL_H
#define STICKSLIP_COIL_H

#include "state.h"

/* Bl(q) over Bl, for those who wait for it: few operations after one another. */
static inline double force_factor_shape(const Model *m, double q)
{
    return (1.0 + q * m->r.b1) + q * q * m->r.b2;
}

/* N/A */
static inline double force_factor_at(const Model *m, double q)
{
    return m->r.force_factor * (1.0 + q * (m->r.b1 + q * m->r.b2));
}

/* Wb; the integral of the force factor from q = 0 */
static inline double motional_flux(const Model *m, double q)
{
    return m->r.force_factor * q * (1.0 + q * (m->r.b1 / 2.0 + q * m->r.b2 / 3.0));
}

/* N/(A s) */
static inline double force_factor_rate(const Model *m, double q, double u)
{
    return m->r.force_factor * (m->r.b1 + 2.0 * m->r.b2 * q) * u;
}

/* d(back-EMF)/dt, V/s */
static inline double back_emf_slope(const Model *m, const double y[N_STATES], double a_q)
{
    return force_factor_at(m, y[Q]) * a_q + force_factor_rate(m, y[Q], y[U]) * y[U];
}

#endif
