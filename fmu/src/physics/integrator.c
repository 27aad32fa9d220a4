/* SPDX-License-Identifier: BSD-2-Clause */
#include "integrator.h"

#include <math.h>

#include "law.h"
#include "mechanics.h"

/* The first n states take part; of those that act on the rates, `acting` for each surface. With
 * constants the compiler makes vectors of the inner loops. */
STICKSLIP_INLINE double step_of(const int n, const int acting, const int source, const Law *law,
                                double tau, double h, const double y0[N_ALL],
                                const double dy0[N_ALL], double y1[N_ALL], double dy1[N_ALL])
{
    static const double A[6][6] = {
        {1.0 / 5.0},
        {3.0 / 40.0, 9.0 / 40.0},
        {44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0},
        {19372.0 / 6561.0, -25360.0 / 2187.0, 64448.0 / 6561.0, -212.0 / 729.0},
        {9017.0 / 3168.0, -355.0 / 33.0, 46732.0 / 5247.0, 49.0 / 176.0, -5103.0 / 18656.0},
        {35.0 / 384.0, 0.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0}};
    static const double C[6] = {1.0 / 5.0, 3.0 / 10.0, 4.0 / 5.0, 8.0 / 9.0, 1.0, 1.0};
    static const double E[7] = {71.0 / 57600.0,     0.0,           -71.0 / 16695.0, 71.0 / 1920.0,
                                -17253.0 / 339200.0, 22.0 / 525.0, -1.0 / 40.0};
    const Model *m = law->m;
    double k[7][N_ALL];

    for (int j = 0; j < n; j++)
        k[0][j] = dy0[j];
    for (int s = 0; s < 6; s++) {
        const int taken = s == 5 ? n : acting; /* the others only follow */
        double sum[N_ALL] = {0.0};
        for (int l = 0; l <= s; l++) {
            const double a = A[s][l];
            for (int j = 0; j < taken; j++)
                sum[j] += a * k[l][j];
        }
        for (int j = 0; j < taken; j++)
            y1[j] = y0[j] + h * sum[j];
        if (law->general)
            stickslip_state_rates(m, m->mode, y1, tau + C[s] * h, k[s + 1]);
        else
            stickslip_law_rates(law, source, y1, law->touch ? stickslip_law_root(law, y1) : 0.0,
                                tau + C[s] * h, 1.0, k[s + 1]);
    }
    for (int j = 0; j < n; j++)
        dy1[j] = k[6][j];

    double worst = 0.0, sum[N_ALL] = {0.0};
    for (int s = 0; s < 7; s++)
        for (int j = 0; j < acting; j++)
            sum[j] += E[s] * k[s][j];
    for (int j = 0; j < acting; j++) {
        if (j % N_STATES >= N_ACTING)
            continue;
        const double error =
            fabs(h * sum[j]) / stickslip_allowed_error(m, j % N_STATES, y0[j]);
        if (error > worst || error != error)
            worst = error; /* so that a NaN stays */
    }
    return worst;
}

STICKSLIP_INLINE double stickslip_trial_step_any(const Model *m, double tau, double h,
                                                 const double y0[N_ALL], const double dy0[N_ALL],
                                                 double y1[N_ALL], double dy1[N_ALL])
{
    const Law law = stickslip_law(m);
    if (moving(m) > 1)
        return step_of(N_ALL, N_ALL, 0, &law, tau, h, y0, dy0, y1, dy1);
    if (law.general)
        return step_of(N_STATES, N_ACTING, 0, &law, tau, h, y0, dy0, y1, dy1);
    if (m->n.source)
        return step_of(N_STATES, N_ACTING, 1, &law, tau, h, y0, dy0, y1, dy1);
    return step_of(N_STATES, I_COIL, 0, &law, tau, h, y0, dy0, y1, dy1);
}

STICKSLIP_WIDE(double, stickslip_trial_step,
               (const Model *m, double tau, double h, const double y0[N_ALL],
                const double dy0[N_ALL], double y1[N_ALL], double dy1[N_ALL]),
               (m, tau, h, y0, dy0, y1, dy1))

double stickslip_step_factor(double error)
{
    /* The fifth root belongs here. Square roots are exact on every platform where pow is not, and
     * the fourth root below 1 and the eighth above err on the safe side. */
    if (!(error < 1e30))
        return 0.1;
    double root = sqrt(sqrt(error > 1e-30 ? error : 1e-30));
    double factor = 0.9 / (error > 1.0 ? root : sqrt(root));
    return factor < 0.1 ? 0.1 : factor > 8.0 ? 8.0 : factor;
}
