/* SPDX-License-Identifier: BSD-2-Clause */
#include "dense.h"

#include <math.h>

#include "integrator.h"
#include "law.h"
#include "mechanics.h"

/* Of stage s: the coefficient of stage 0, then those of FIRST[s] ... s - 1. */
static const int FIRST[STAGES] = {0, 1, 1, 2, 2, 3, 3, 3, 3, 3, 3, 3, 5, 6, 5, 5};
static const double A[STAGES][12] = {
    {0.0},
    {0.05260015195876773},
    {0.0197250569845379, 0.0591751709536137},
    {0.02958758547680685, 0.08876275643042054},
    {0.2413651341592667, -0.8845494793282861, 0.924834003261792},
    {0.037037037037037035, 0.17082860872947386, 0.12546768756682242},
    {0.037109375, 0.17025221101954405, 0.06021653898045596, -0.017578125},
    {0.03709200011850479, 0.17038392571223998, 0.10726203044637328, -0.015319437748624402,
     0.008273789163814023},
    {0.6241109587160757, -3.3608926294469414, -0.868219346841726, 27.59209969944671,
     20.154067550477894, -43.48988418106996},
    {0.47766253643826434, -2.4881146199716677, -0.590290826836843, 21.230051448181193,
     15.279233632882423, -33.28821096898486, -0.020331201708508627},
    {-0.9371424300859873, 5.186372428844064, 1.0914373489967295, -8.149787010746927,
     -18.52006565999696, 22.739487099350505, 2.4936055526796523, -3.0467644718982196},
    {2.273310147516538, -10.53449546673725, -2.0008720582248625, -17.9589318631188,
     27.94888452941996, -2.8589982771350235, -8.87285693353063, 12.360567175794303,
     0.6433927460157636},
    {0.054293734116568765, 4.450312892752409, 1.8915178993145003, -5.801203960010585,
     0.3111643669578199, -0.1521609496625161, 0.20136540080403034, 0.04471061572777259},
    {0.056167502283047954, 0.25350021021662483, -0.2462390374708025, -0.12419142326381637,
     0.15329179827876568, 0.00820105229563469, 0.007567897660545699, -0.008298},
    {0.03183464816350214, 0.028300909672366776, 0.053541988307438566, -0.05492374857139099, 0.0,
     0.0, -0.00010834732869724932, 0.0003825710908356584, -0.00034046500868740456,
     0.1413124436746325},
    {-0.42889630158379194, -4.697621415361164, 7.683421196062599, 4.06898981839711,
     0.3567271874552811, 0.0, 0.0, 0.0, -0.0013990241651590145, 2.9475147891527724,
     -9.15095847217987},
};
static const double C[STAGES] = {
    0.0, 0.05260015195876773, 0.0789002279381516, 0.1183503419072274, 0.2816496580927726,
    0.3333333333333333, 0.25, 0.3076923076923077, 0.6512820512820513, 0.6, 0.8571428571428571,
    1.0, 1.0, 0.1, 0.2, 0.7777777777777778};
/* Of stage 0, then of stages 5 ... 11: what the solutions of order 5 and 3 differ by. */
static const double E5[8] = {
    0.01312004499419488, -1.2251564463762044, -0.4957589496572502, 1.6643771824549864,
    -0.35032884874997366, 0.3341791187130175, 0.08192320648511571, -0.022355307863886294};
static const double E3[8] = {
    -0.18980075407240762, 4.450312892752409, 1.8915178993145003, -5.801203960010585,
    -0.4226823213237919, -0.1521609496625161, 0.20136540080403034, 0.02265179219836082};
/* Of stage 0, then of stages 5 ... 15: the four highest coefficients of the interpolant. */
static const double HIGHEST[4][12] = {
    {-8.428938276109013, 0.5667149535193777, -3.0689499459498917, 2.38466765651207,
     2.117034582445028, -0.871391583777973, 2.2404374302607883, 0.6315787787694688,
     -0.08899033645133331, 18.148505520854727, -9.194632392478356, -4.436036387594894},
    {10.427508642579134, 242.28349177525817, 165.20045171727028, -374.5467547226902,
     -22.113666853125306, 7.733432668472264, -30.674084731089398, -9.332130526430229,
     15.697238121770845, -31.139403219565178, -9.35292435884448, 35.81684148639408},
    {19.985053242002433, -387.0373087493518, -189.17813819516758, 527.8081592054236,
     -11.57390253995963, 6.8812326946963, -1.0006050966910838, 0.7777137798053443,
     -2.778205752353508, -60.19669523126412, 84.32040550667716, 11.99229113618279},
    {-25.69393346270375, -154.18974869023643, -231.5293791760455, 357.6391179106141,
     93.40532418362432, -37.45832313645163, 104.0996495089623, 29.8402934266605,
     -43.53345659001114, 96.32455395918828, -39.17726167561544, -149.72683625798564},
};

/* m^0.5; the root that a ram at a wall has or, at its speed, has after LEAST_TIME (s), lest it stand
 * there and the clock with it. */
static const double LEAST_ROOT = 1e-6, LEAST_TIME = 1e-6;

/* s; what an error of the clock may be, over the tolerance: the states go at some 1e4 of their
 * scales a second there. And of the root. */
static const double CLOCK_SCALE = 1e-5, ROOT_SCALE = 0.1;

double stickslip_root_of(const Model *m, int surface, const double y[N_ALL])
{
    const double depth = m->mode[surface].side * y[surface * N_STATES + Q] - m->r.travel;
    return depth > 0.0 ? sqrt(depth) : 0.0;
}

int stickslip_clock_of(const Model *m, const double y[N_ALL])
{
    int wall = -1;
    for (int s = 0; s < moving(m); s++) {
        if (m->mode[s].wall != WALL_TOUCH)
            continue;
        if (wall >= 0)
            return -1; /* neither of the two before the other */
        wall = s;
    }
    if (wall < 0)
        return -1;
    const double root = stickslip_root_of(m, wall, y);
    const double inwards = m->mode[wall].side * y[wall * N_STATES + U];
    if (root == 0.0 && inwards <= 0.0)
        return -1; /* about to leave: the clock would run backwards */
    return root + sqrt(fabs(inwards) * LEAST_TIME) > LEAST_ROOT ? wall : -1;
}

/* What kind of step it is; constants wherever a function below takes one. */
typedef struct {
    int general;           /* the rates are those of mechanics.c */
    int n, surfaces;       /* states, and surfaces that they belong to */
    int acting;            /* states of a surface that act on the rates; the others only follow */
    int source, by_wall;
} Variant;

/* The sum of the stages that stage s takes, but for the newest of them, of the states from `low` to
 * before `high`. With constant limits the compiler makes vectors of the loops; the newest are apart,
 * since a processor cannot read as a vector what it has just written one by one. */
STICKSLIP_INLINE void weigh(const int low, const int high, int s, const Stages *g, double sum[N_ALL])
{
    const double *a = A[s];
    for (int j = low; j < high; j++)
        sum[j] = a[0] * g->k[0][j];
    for (int l = FIRST[s]; l < s - 1; l++) {
        const double weight = *++a;
        for (int j = low; j < high; j++)
            sum[j] += weight * g->k[l][j];
    }
}

/* Of the newest stage before s; of stage 0 weigh() has taken care. */
static inline double newest_weight(int s)
{
    return s == 1 ? 0.0 : A[s][s - FIRST[s]];
}

static double weigh_clock(int s, const Stages *g)
{
    const double *a = A[s];
    double sum = a[0] * g->clock[0];
    for (int l = FIRST[s]; l < s; l++)
        sum += *++a * g->clock[l];
    return sum;
}

/* The rates times `per`. By the wall's clock, y[Q] of its surface is the root. */
STICKSLIP_INLINE void rates_at(const Variant kind, const Law *law, int wall, double tau,
                               const double per, double y[N_ALL], double k[N_ALL])
{
    const Model *m = law->m;
    double root = 0.0;
    if (kind.by_wall) {
        double *q = &y[wall * N_STATES + Q];
        root = *q;
        *q = m->mode[wall].side * (m->r.travel + root * fabs(root));
    } else if (law->touch) {
        root = stickslip_law_root(law, y);
    }
    if (!kind.general) {
        stickslip_law_rates(law, kind.source, y, root, tau, per, k);
        return;
    }
    stickslip_state_rates(m, m->mode, y, tau, k);
    for (int j = 0; j < kind.n; j++)
        k[j] *= per;
}

/* The rate of the root by the wall's clock, in the place of that of q. */
static inline void rate_root(const Model *m, int wall, const double y[N_ALL], double k[N_ALL])
{
    k[wall * N_STATES + Q] = 0.5 * m->mode[wall].side * y[wall * N_STATES + U];
}

/* From rates in time to those by the wall's clock. */
STICKSLIP_INLINE void by_clock(const Variant kind, const Model *m, int wall, const Knot *at,
                               double k[N_ALL])
{
    for (int j = 0; j < kind.n; j++)
        k[j] = at->dy[j] * at->root;
    rate_root(m, wall, at->y, k);
}

STICKSLIP_INLINE void stage(const Variant kind, const Law *law, int wall, double h, int s,
                            const Knot *from, double y[N_ALL], Stages *g)
{
    double sum[N_ALL], *k = g->k[s];
    const double *newest = g->k[s - 1];
    const double weight = h * newest_weight(s); /* the rest does not wait for the newest */
    for (int i = 0; i < kind.surfaces; i++) {
        const int low = i * N_STATES;
        weigh(low, low + kind.acting, s, g, sum);
        for (int j = low; j < low + kind.acting; j++)
            y[j] = (from->y[j] + h * sum[j]) + weight * newest[j];
    }
    if (!kind.by_wall) {
        rates_at(kind, law, wall, from->tau + C[s] * h, 1.0, y, k);
        return;
    }
    const int place = wall * N_STATES;
    const double root = (from->root + h * sum[place + Q]) + weight * newest[place + Q];
    y[place + Q] = g->clock[s] = root;
    rates_at(kind, law, wall, from->tau + h * weigh_clock(s, g), root, y, k);
    rate_root(law->m, wall, y, k);
}

/* The larger of the errors over what is allowed, of the solution of order 5 and of that of order 3. */
typedef struct {
    double fifth, third;
} Errors;

STICKSLIP_INLINE void judge(double h, double fifth, double third, double allowed, Errors *worst)
{
    const double per = fabs(h) / allowed;
    fifth = fabs(fifth) * per;
    third = fabs(third) * per;
    if (fifth > worst->fifth || fifth != fifth)
        worst->fifth = fifth; /* so that a NaN stays */
    if (third > worst->third || third != third)
        worst->third = third;
}

STICKSLIP_INLINE double errors_of(const Variant kind, const Model *m, int wall, double h,
                                  const Knot *from, const Stages *g)
{
    Errors worst = {0.0, 0.0};
    double fifth[N_ALL], third[N_ALL];
    for (int i = 0; i < kind.surfaces; i++) {
        const int low = i * N_STATES;
        for (int j = low; j < low + kind.acting; j++) {
            fifth[j] = E5[0] * g->k[0][j];
            third[j] = E3[0] * g->k[0][j];
        }
        for (int l = 1; l < 8; l++)
            for (int j = low; j < low + kind.acting; j++) {
                fifth[j] += E5[l] * g->k[l + 4][j];
                third[j] += E3[l] * g->k[l + 4][j];
            }
        for (int j = 0; j < kind.acting; j++) {
            const int is_root = kind.by_wall && i == wall && j == Q;
            judge(h, fifth[low + j], third[low + j],
                  is_root ? m->r.tolerance * ROOT_SCALE
                          : stickslip_allowed_error(m, j, from->y[low + j]),
                  &worst);
        }
    }
    if (kind.by_wall) {
        double late = E5[0] * g->clock[0], later = E3[0] * g->clock[0];
        for (int l = 1; l < 8; l++) {
            late += E5[l] * g->clock[l + 4];
            later += E3[l] * g->clock[l + 4];
        }
        judge(h, late, later, m->r.tolerance * CLOCK_SCALE, &worst);
    }
    if (worst.fifth == 0.0)
        return 0.0;
    if (!(worst.third < 1e30))
        return worst.third;
    const double ratio = worst.third / worst.fifth;
    return worst.fifth / sqrt(1.0 + 0.01 * ratio * ratio);
}

STICKSLIP_INLINE double step_of(const Variant kind, const Law *law, int wall, double h,
                                const Knot *from, Knot *to, Stages *g)
{
    const Model *m = law->m;
    double y[N_ALL], sum[N_ALL];
    if (kind.surfaces == 1)
        wall = 0; /* a constant for the compiler */
    for (int j = 0; j < kind.n; j++) {
        g->k[0][j] = from->dy[j];
        y[j] = from->y[j];
    }
    const int place = wall * N_STATES;
    if (kind.by_wall) {
        by_clock(kind, m, wall, from, g->k[0]);
        g->clock[0] = from->root;
    }
    for (int s = 1; s < 12; s++)
        stage(kind, law, wall, h, s, from, y, g);
    weigh(0, kind.n, 12, g, sum);
    for (int j = 0; j < kind.n; j++) {
        sum[j] += newest_weight(12) * g->k[11][j];
        to->y[j] = from->y[j] + h * sum[j];
    }
    to->tau = from->tau + h;
    if (kind.by_wall) {
        to->root = from->root + h * sum[place + Q];
        to->y[place + Q] = to->root;
        to->tau = from->tau + h * weigh_clock(12, g);
    }
    rates_at(kind, law, wall, to->tau, 1.0, to->y, to->dy);
    for (int j = 0; j < kind.n; j++)
        g->k[12][j] = to->dy[j];
    if (kind.by_wall) {
        g->clock[12] = to->root;
        by_clock(kind, m, wall, to, g->k[12]);
    }
    return errors_of(kind, m, wall, h, from, g);
}

STICKSLIP_INLINE void interpolant_of(const Variant kind, const Law *law, int wall, double h,
                                     const Knot *from, const Knot *to, Stages *g, Dense *dense)
{
    double y[N_ALL];
    if (kind.surfaces == 1)
        wall = 0;
    for (int j = 0; j < kind.n; j++)
        y[j] = from->y[j];
    for (int s = 13; s < STAGES; s++)
        stage(kind, law, wall, h, s, from, y, g);
    dense->length = h;
    dense->per_length = 1.0 / h;
    dense->wall = kind.by_wall ? wall : -1;
    for (int surface = 0; surface < kind.surfaces; surface++) {
        const int low = surface * N_STATES, high = low + N_ACTING;
        for (int j = low; j < high; j++) {
            const double rise = to->y[j] - from->y[j];
            dense->c[0][j] = from->y[j];
            dense->c[1][j] = rise;
            dense->c[2][j] = h * g->k[0][j] - rise;
            dense->c[3][j] = 2.0 * rise - h * (g->k[12][j] + g->k[0][j]);
        }
        for (int i = 0; i < 4; i++) {
            double sum[N_ALL];
            for (int j = low; j < high; j++)
                sum[j] = HIGHEST[i][0] * g->k[0][j];
            for (int l = 5; l < STAGES; l++) {
                const double weight = HIGHEST[i][l - 4];
                for (int j = low; j < high; j++)
                    sum[j] += weight * g->k[l][j];
            }
            for (int j = low; j < high; j++)
                dense->c[4 + i][j] = h * sum[j];
        }
    }
    if (!kind.by_wall)
        return;
    const int q = wall * N_STATES + Q;
    const double rise = to->root - from->root, later = to->tau - from->tau;
    dense->c[0][q] = from->root;
    dense->c[1][q] = rise;
    dense->c[2][q] = h * g->k[0][q] - rise;
    dense->c[3][q] = 2.0 * rise - h * (g->k[12][q] + g->k[0][q]);
    dense->clock[0] = 0.0;
    dense->clock[1] = later;
    dense->clock[2] = h * g->clock[0] - later;
    dense->clock[3] = 2.0 * later - h * (g->clock[12] + g->clock[0]);
    for (int i = 0; i < 4; i++) {
        double sum = HIGHEST[i][0] * g->clock[0];
        for (int l = 5; l < STAGES; l++)
            sum += HIGHEST[i][l - 4] * g->clock[l];
        dense->clock[4 + i] = h * sum;
    }
}

/* Every kind that there is, each a function of its own for the compiler. */
#define KINDS(GIVE)                                                                                \
    if (law.general && moving(m) > 1)                                                              \
        GIVE(((Variant){1, N_ALL, N_MOVING, N_ACTING, 0, wall >= 0}));                             \
    if (law.general)                                                                               \
        GIVE(((Variant){1, N_STATES, 1, N_ACTING, 0, wall >= 0}));                                 \
    if (m->n.source && wall >= 0)                                                                  \
        GIVE(((Variant){0, N_STATES, 1, N_ACTING, 1, 1}));                                            \
    if (m->n.source)                                                                               \
        GIVE(((Variant){0, N_STATES, 1, N_ACTING, 1, 0}));                                            \
    if (wall >= 0)                                                                                 \
        GIVE(((Variant){0, N_STATES, 1, I_COIL, 0, 1}));                                              \
    GIVE(((Variant){0, N_STATES, 1, I_COIL, 0, 0}));

STICKSLIP_INLINE double stickslip_long_step_any(const Model *m, int wall, double h, const Knot *from,
                                                Knot *to, Stages *stages)
{
    const Law law = stickslip_law(m);
#define GIVE(kind) return step_of(kind, &law, wall, h, from, to, stages)
    KINDS(GIVE)
#undef GIVE
}

STICKSLIP_WIDE(double, stickslip_long_step,
               (const Model *m, int wall, double h, const Knot *from, Knot *to, Stages *stages),
               (m, wall, h, from, to, stages))

STICKSLIP_INLINE void stickslip_interpolant_any(const Model *m, int wall, double h, const Knot *from,
                                                const Knot *to, Stages *stages, Dense *dense)
{
    const Law law = stickslip_law(m);
#define GIVE(kind)                                                                                 \
    do {                                                                                           \
        interpolant_of(kind, &law, wall, h, from, to, stages, dense);                              \
        return;                                                                                    \
    } while (0)
    KINDS(GIVE)
#undef GIVE
}

STICKSLIP_WIDE(void, stickslip_interpolant,
               (const Model *m, int wall, double h, const Knot *from, const Knot *to,
                Stages *stages, Dense *dense),
               (m, wall, h, from, to, stages, dense))

double stickslip_reading_error(const Model *m, const Dense *dense)
{
    static const double SHARE = 5e-4; /* x^4 (1 - x)^3 is at most 0.0084; of that a seventeenth */
    double worst = 0.0;
    for (int s = 0; s < moving(m); s++) {
        for (int j = 0; j < N_ACTING; j++) {
            const int at = s * N_STATES + j;
            const double allowed = s == dense->wall && j == Q
                                       ? m->r.tolerance * ROOT_SCALE
                                       : stickslip_allowed_error(m, j, dense->c[0][at]);
            const double error = SHARE * fabs(dense->c[7][at]) / allowed;
            if (error > worst || error != error)
                worst = error;
        }
    }
    if (dense->wall < 0)
        return worst;
    const double late = SHARE * fabs(dense->clock[7]) / (m->r.tolerance * CLOCK_SCALE);
    return late > worst || late != late ? late : worst;
}

/* For the acting states from place `low` on. y may lie in the same model as the polynomials, but elsewhere. */
STICKSLIP_INLINE void evaluate(const int low, const Dense *restrict dense, double x,
                               double *restrict y)
{
    /* Not after Horner, whose every operation waits for the one before. */
    const double b2 = x * (1.0 - x), b3 = b2 * x, b4 = b2 * b2, b5 = b4 * x, b6 = b4 * b2, b7 = b6 * x;
    for (int j = low; j < low + N_ACTING; j++)
        y[j] = (dense->c[0][j] + dense->c[1][j] * x + (dense->c[2][j] * b2 + dense->c[3][j] * b3)) +
               ((dense->c[4][j] * b4 + dense->c[5][j] * b5) +
                (dense->c[6][j] * b6 + dense->c[7][j] * b7));
}

STICKSLIP_INLINE double stickslip_interpolate_acting_any(const Model *m, const Dense *dense,
                                                         double share, double y[N_ALL])
{
    evaluate(0, dense, share, y);
    if (moving(m) > 1)
        evaluate(N_STATES, dense, share, y);
    if (dense->wall < 0)
        return 0.0;
    double *q = &y[dense->wall * N_STATES + Q];
    const double root = *q;
    *q = m->mode[dense->wall].side * (m->r.travel + root * fabs(root));
    return root;
}

STICKSLIP_WIDE(double, stickslip_interpolate_acting,
               (const Model *m, const Dense *dense, double share, double y[N_ALL]),
               (m, dense, share, y))

void stickslip_interpolate(const Model *m, const Dense *dense, double share, Knot *knot)
{
    knot->root = stickslip_interpolate_acting(m, dense, share, knot->y);
    knot->tau = share * dense->length;
    if (dense->wall >= 0) {
        double d[N_DERIVATIVES];
        stickslip_derivatives(dense->clock, 1, share, d);
        knot->tau = d[0];
    }
}

double stickslip_share_by_clock(const Dense *dense, double time)
{
    /* The clock's rate is the root, and grows or falls: bisection where Newton would leave. Past the
     * end of a touch, where the step has an event, the root is below zero and the clock runs back. */
    double low = 0.0, high = 1.0, x = time / dense->clock[1], d[N_DERIVATIVES];
    if (!(x > 0.0 && x < 1.0))
        x = 0.5;
    for (int i = 0; i < 100; i++) {
        stickslip_derivatives(dense->clock, 1, x, d);
        if (d[0] < time && d[1] > 0.0)
            low = x;
        else
            high = x;
        double next = x - (d[0] - time) / d[1];
        if (!(next > low && next < high))
            next = 0.5 * (low + high);
        const double change = fabs(next - x);
        x = next;
        if (change < 1e-10 || high - low < 1e-15) /* Newton's next would be its square */
            break;
    }
    return x;
}

double stickslip_long_factor(double error)
{
    if (!(error < 1e30))
        return 0.1;
    const double root = sqrt(sqrt(sqrt(error > 1e-30 ? error : 1e-30)));
    const double factor = 0.8 / root; /* nearer to 1 more steps are rejected than saved */
    return factor < 0.1 ? 0.1 : factor > 6.0 ? 6.0 : factor;
}
