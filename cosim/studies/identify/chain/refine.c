#include "refine.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double TURN = 2e-3;     /* step of finite differences, as a share of a number's scale */
static const double WORTHLESS = 1e3; /* largest cost, also of a simulation that overflowed to NaN */

/* Levenberg-Marquardt dampings that the lanes try side by side, relative to the diagonal of the normal
 * matrix (plus 1e-3 of its largest element). */
static const double DAMPINGS[LANES] = {1e-6, 1e-4, 1e-3, 1e-2, 5e-2, 0.2, 1.0, 5.0};

typedef struct {
    Parameters parameters;
    double *out, *residuals; /* as chain_look() has them */
} Bench;

static void free_bench(Bench *b)
{
    free(b->out);
    free(b->residuals);
}

static int make_bench(Bench *b, int64_t samples)
{
    const size_t size = (size_t)samples * N_OUTPUTS * LANES * sizeof(double);
    b->out = malloc(size);
    b->residuals = malloc(size);
    return b->out && b->residuals;
}

/* Weighted residuals of signal k in all lanes, samples times LANES; 0 where nothing was measured. The
 * camera's zero of height is arbitrary, so the mean residual of a height is subtracted. */
static void compare(const Trial *t, int k, const double *out, double *residual)
{
    const double *measured = t->measured[k], factor = sqrt(t->weight[k]);
    double sum[LANES] = {0};
    int64_t known = 0;
    for (int64_t j = 0; j < t->samples; j++) {
        double *r = residual + j * LANES;
        if (isnan(measured[j])) {
            memset(r, 0, LANES * sizeof *r);
            continue;
        }
        known++;
        if (t->differenced[k]) {
            /* From the heights a sample before and after: output k - 1 is the height of velocity k. */
            const double *before = out + ((j - 1) * N_OUTPUTS + k - 1) * LANES;
            const double *after = before + 2 * N_OUTPUTS * LANES;
            for (int l = 0; l < LANES; l++)
                r[l] = factor * ((after[l] - before[l]) * t->rate[j] - measured[j]);
        } else {
            const double *simulated = out + (j * N_OUTPUTS + k) * LANES;
            for (int l = 0; l < LANES; l++)
                r[l] = factor * (simulated[l] - measured[j]);
        }
        for (int l = 0; l < LANES; l++)
            sum[l] += r[l];
    }
    if (k == V_SURFACE || k == V_PART || !known)
        return;
    for (int l = 0; l < LANES; l++)
        sum[l] /= (double)known;
    for (int64_t j = 0; j < t->samples; j++)
        if (!isnan(measured[j]))
            for (int l = 0; l < LANES; l++)
                residual[j * LANES + l] -= sum[l];
}

static int64_t residuals_of(const Trial *t, const double *out, double *residuals)
{
    int64_t n = 0;
    for (int k = 0; k < N_OUTPUTS; k++) {
        if (!t->measured[k] || t->weight[k] == 0.0)
            continue;
        compare(t, k, out, residuals + n * LANES);
        n += t->samples;
    }
    return n;
}

static int64_t look(const Trial *t, Bench *b, double cost[LANES])
{
    chain_run(&t->schedule, b->parameters, b->out);
    const int64_t n = residuals_of(t, b->out, b->residuals);
    double sum[LANES] = {0};
    for (int64_t j = 0; j < n; j++)
        for (int l = 0; l < LANES; l++)
            sum[l] += b->residuals[j * LANES + l] * b->residuals[j * LANES + l];
    for (int l = 0; l < LANES; l++)
        cost[l] = sum[l] < WORTHLESS ? sum[l] : WORTHLESS;
    return n;
}

static void set_own(Bench *b, int l, const double own[N_OWN])
{
    for (int k = 0; k < N_OWN; k++)
        b->parameters[N_RIG + k][l] = own[k];
}

/* Solve A x = y by Cholesky's method: x replaces y, the factor replaces the lower triangle of A. Returns 0
 * where A, of n rows, is not positive definite. */
static int solve(int n, double a[N_OWN][N_OWN], double y[N_OWN])
{
    for (int i = 0; i < n; i++) {
        for (int j = 0; j <= i; j++) {
            double sum = a[i][j];
            for (int k = 0; k < j; k++)
                sum -= a[i][k] * a[j][k];
            if (i > j)
                a[i][j] = sum / a[j][j];
            else if (sum > 0.0)
                a[i][i] = sqrt(sum);
            else
                return 0;
        }
        for (int k = 0; k < i; k++)
            y[i] -= a[i][k] * y[k];
        y[i] /= a[i][i];
    }
    for (int i = n - 1; i >= 0; i--) {
        for (int k = i + 1; k < n; k++)
            y[i] -= a[k][i] * y[k];
        y[i] /= a[i][i];
    }
    return 1;
}

/* One step of Gauss-Newton for the n fitted ones of a trial's own numbers, place[0] to place[n - 1].
 * A first batch simulates them unchanged (lane 0) and each moved by a step (lanes 1 to n, N_OWN < LANES),
 * which gives the finite differences; a second batch tries a damping in each lane. The cheapest numbers of
 * both batches replace `own`, their cost `*best`. */
static void one_round(const Trial *t, Bench *b, double own[N_OWN], double *best)
{
    int place[N_OWN], n = 0;
    double tried[LANES][N_OWN], cost[LANES], turn[N_OWN];
    for (int k = 0; k < N_OWN; k++)
        if (t->scale[k] > 0.0)
            place[n++] = k;
    for (int l = 0; l < LANES; l++)
        memcpy(tried[l], own, sizeof tried[l]);
    for (int i = 0; i < n; i++) {
        const int k = place[i];
        turn[i] = own[k] + TURN * t->scale[k] <= t->high[k] ? TURN : -TURN;
        tried[i + 1][k] += turn[i] * t->scale[k];
    }
    for (int l = 0; l < LANES; l++)
        set_own(b, l, tried[l]);
    const int64_t samples = look(t, b, cost);

    /* Normal equations A x = y; only the lower triangle of A is filled. */
    double a[N_OWN][N_OWN] = {{0}}, y[N_OWN] = {0}, largest = 0.0;
    for (int64_t j = 0; j < samples; j++) {
        const double *r = b->residuals + j * LANES;
        double slope[N_OWN];
        for (int i = 0; i < n; i++)
            slope[i] = (r[i + 1] - r[0]) / turn[i];
        for (int i = 0; i < n; i++) {
            y[i] -= slope[i] * r[0];
            for (int k = 0; k <= i; k++)
                a[i][k] += slope[i] * slope[k];
        }
    }
    *best = cost[0];
    for (int l = 1; l <= n; l++)
        if (cost[l] < *best) {
            *best = cost[l];
            memcpy(own, tried[l], sizeof tried[l]);
        }
    for (int i = 0; i < n; i++)
        largest = a[i][i] > largest ? a[i][i] : largest;
    if (!(largest > 0.0 && largest < 1e300))
        return;

    for (int l = 0; l < LANES; l++) {
        double damped[N_OWN][N_OWN], x[N_OWN];
        memcpy(damped, a, sizeof a);
        memcpy(x, y, sizeof y);
        for (int i = 0; i < n; i++)
            damped[i][i] += DAMPINGS[l] * (a[i][i] + 1e-3 * largest);
        memcpy(tried[l], tried[0], sizeof tried[l]);
        if (solve(n, damped, x))
            for (int i = 0; i < n; i++) {
                const int k = place[i];
                const double moved = tried[l][k] + x[i] * t->scale[k];
                tried[l][k] = moved < t->low[k] ? t->low[k] : moved > t->high[k] ? t->high[k] : moved;
            }
        set_own(b, l, tried[l]);
    }
    look(t, b, cost);
    for (int l = 0; l < LANES; l++)
        if (cost[l] < *best) {
            *best = cost[l];
            memcpy(own, tried[l], sizeof tried[l]);
        }
}

/* By how much (as a share of a period) the simulated surface of lane l lags behind the measured one: the
 * shift, in whole samples up to half a period either way, with the least mean square difference. */
static double lag(const Trial *t, const double *out, int l, double frequency)
{
    const double *measured = t->measured[V_SURFACE];
    const double interval = t->schedule.edges[t->schedule.steps] / (double)(t->samples - 1);
    const int64_t half = (int64_t)(0.5 / (frequency * interval));
    double least = INFINITY;
    int64_t best = 0;
    for (int64_t shift = -half; shift <= half && 2 * half < t->samples; shift++) {
        const int64_t from = shift < 0 ? -shift : 0, to = t->samples - (shift > 0 ? shift : 0);
        double sum = 0.0, n = 0.0;
        for (int64_t j = from; j < to; j++) {
            const double apart =
                out[((j + shift) * N_OUTPUTS + V_SURFACE) * LANES + l] - measured[j];
            if (apart == apart) { /* not NaN */
                sum += apart * apart;
                n += 1.0;
            }
        }
        if (sum < least * n) {
            least = sum / n;
            best = shift;
        }
    }
    return (double)best * interval * frequency;
}

/* Costs of LANES sets of own numbers. Each phase is first advanced by the lag of the surface, if that
 * lowers the cost. */
static void look_around(const Trial *t, Bench *b, double *own, double cost[LANES])
{
    double tried[LANES];
    for (int l = 0; l < LANES; l++)
        set_own(b, l, own + l * N_OWN);
    look(t, b, cost);
    if (!t->measured[V_SURFACE] || t->scale[PHASE - N_RIG] == 0.0)
        return;
    for (int l = 0; l < LANES; l++) {
        double phase = b->parameters[PHASE][l] + lag(t, b->out, l, b->parameters[FREQUENCY][l]);
        b->parameters[PHASE][l] = tried[l] = phase - floor(phase);
    }
    double moved[LANES];
    look(t, b, moved);
    for (int l = 0; l < LANES; l++)
        if (moved[l] < cost[l]) {
            cost[l] = moved[l];
            own[l * N_OWN + PHASE - N_RIG] = tried[l];
        }
}

static void do_job(const Job *job, Bench *b)
{
    for (int k = 0; k < N_RIG; k++)
        for (int l = 0; l < LANES; l++)
            b->parameters[k][l] = job->rig[k];
    if (job->rounds == 0)
        look_around(job->trial, b, job->own, job->cost);
    for (int64_t i = 0; i < job->rounds; i++)
        one_round(job->trial, b, job->own, job->cost);
}

int64_t chain_work(const Job *jobs, int64_t n, atomic_llong *next)
{
    Bench b;
    int64_t samples = 0;
    for (int64_t i = 0; i < n; i++)
        samples = jobs[i].trial->samples > samples ? jobs[i].trial->samples : samples;
    const int made = make_bench(&b, samples);
    for (int64_t i; made && (i = atomic_fetch_add(next, 1)) < n;)
        do_job(jobs + i, &b);
    free_bench(&b);
    return made ? 0 : -1;
}

int64_t chain_look(const Trial *trial, const Parameters parameters, double *out, double *residuals)
{
    chain_run(&trial->schedule, parameters, out);
    return residuals_of(trial, out, residuals);
}

int64_t chain_sizes(int64_t which)
{
    return (int64_t)(which ? sizeof(Job) : sizeof(Trial));
}
