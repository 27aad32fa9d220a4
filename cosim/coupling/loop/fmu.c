/* FMI 2.0 and FMI 3.0 alike: bound when an instance is made, and not asked about at a call. */

#include "loop.h"

#include <math.h>

typedef int Set2(void *, const uint32_t *, size_t, const double *);
typedef int Get2(void *, const uint32_t *, size_t, double *);
typedef int GetIntegers2(void *, const uint32_t *, size_t, int32_t *);
typedef int DoStep2(void *, double, double, int);
typedef int Set3(void *, const uint32_t *, size_t, const double *, size_t);
typedef int Get3(void *, const uint32_t *, size_t, double *, size_t);
typedef int GetIntegers3(void *, const uint32_t *, size_t, int32_t *, size_t);
typedef int DoStep3(void *, double, double, bool, bool *, bool *, bool *, double *);
typedef int Exchange2(void *, const uint32_t *, size_t, void *);
typedef int Exchange3(void *, const uint32_t *, size_t, void *, size_t);
typedef int Slopes2(void *, const uint32_t *, size_t, const int32_t *, double *);
typedef int Slopes3(void *, const uint32_t *, size_t, const int32_t *, double *, size_t);
typedef int Save(void *, void **);
typedef int Restore(void *, void *);

enum { DISCARDED = 2 }; /* a status of both versions */

static int good(Fmu *f, int status, AnyFunction called)
{
    f->status = status;
    if (status <= 1)
        return 1;
    f->failed = called;
    return 0;
}

static int set2(Fmu *f, const uint32_t *places, int64_t n, const double *values)
{
    return good(f, ((Set2 *)f->set_reals)(f->instance, places, (size_t)n, values), f->set_reals);
}

static int set3(Fmu *f, const uint32_t *places, int64_t n, const double *values)
{
    const size_t count = (size_t)n;
    return good(f, ((Set3 *)f->set_reals)(f->instance, places, count, values, count), f->set_reals);
}

static int get2(Fmu *f, const uint32_t *places, int64_t n, double *values)
{
    return good(f, ((Get2 *)f->get_reals)(f->instance, places, (size_t)n, values), f->get_reals);
}

static int get3(Fmu *f, const uint32_t *places, int64_t n, double *values)
{
    const size_t count = (size_t)n;
    return good(f, ((Get3 *)f->get_reals)(f->instance, places, count, values, count), f->get_reals);
}

static int get_whole2(Fmu *f, const uint32_t *places, int64_t n, int32_t *values)
{
    GetIntegers2 *const get = (GetIntegers2 *)f->get_integers;
    return good(f, get(f->instance, places, (size_t)n, values), f->get_integers);
}

static int get_whole3(Fmu *f, const uint32_t *places, int64_t n, int32_t *values)
{
    GetIntegers3 *const get = (GetIntegers3 *)f->get_integers;
    return good(f, get(f->instance, places, (size_t)n, values, (size_t)n), f->get_integers);
}

static int step2(Fmu *f, double h)
{
    return good(f, ((DoStep2 *)f->do_step)(f->instance, f->time, h, !f->goes_back), f->do_step);
}

static int step3(Fmu *f, double h)
{
    bool event = false, terminate = false, early = false;
    double reached = f->time + h;
    DoStep3 *const step = (DoStep3 *)f->do_step;
    const int status = step(f->instance, f->time, h, !f->goes_back, &event, &terminate, &early, &reached);
    /* One that wants to end, or came back although nobody allowed it, has not made the step. */
    return good(f, status <= 1 && (terminate || early) ? DISCARDED : status, f->do_step);
}

void fmu_bind(Fmu *f, int version)
{
    f->set = version == 2 ? set2 : set3;
    f->step = version == 2 ? step2 : step3;
    f->get = version == 2 ? get2 : get3;
    f->get_whole = version == 2 ? get_whole2 : get_whole3;
}

static int is_version_2(const Fmu *f)
{
    return f->set == set2;
}

static int exchange(Fmu *f, const Group *g)
{
    void *const raw = g->kind == DOUBLES ? (void *)g->values : g->raw;
    const size_t n = (size_t)g->n, size = (size_t)g->size;
    const int status = is_version_2(f)
                           ? ((Exchange2 *)g->call)(f->instance, g->places, n, raw)
                           : ((Exchange3 *)g->call)(f->instance, g->places, n, raw, size);
    return good(f, status, g->call);
}

/* Each type of whole numbers: by its name in the enum, with its least and greatest value. A value
   between two is rounded, and one beyond them is that limit, as in a converter. */
#define WHOLE_TYPES(TYPE)                                                                          \
    TYPE(INT8S, int8_t, INT8_MIN, INT8_MAX)                                                        \
    TYPE(UINT8S, uint8_t, 0, UINT8_MAX)                                                            \
    TYPE(INT16S, int16_t, INT16_MIN, INT16_MAX)                                                    \
    TYPE(UINT16S, uint16_t, 0, UINT16_MAX)                                                         \
    TYPE(INT32S, int32_t, INT32_MIN, INT32_MAX)                                                    \
    TYPE(UINT32S, uint32_t, 0, UINT32_MAX)                                                         \
    TYPE(INT64S, int64_t, INT64_MIN, INT64_MAX)                                                    \
    TYPE(UINT64S, uint64_t, 0, UINT64_MAX)

int fmu_set_group(Fmu *f, const Group *g)
{
#define SET(KIND, TYPE, LEAST, MOST)                                                               \
    if (g->kind == KIND)                                                                           \
        ((TYPE *)g->raw)[k] = whole <= (double)LEAST  ? LEAST                                      \
                              : whole >= (double)MOST ? MOST                                       \
                                                      : (TYPE)whole;
    if (g->kind == DOUBLES)
        return exchange(f, g);
    for (int64_t k = 0; k < g->size; k++) {
        const double whole = nearbyint(g->values[k]);
        WHOLE_TYPES(SET)
        if (g->kind == FLOATS)
            ((float *)g->raw)[k] = (float)g->values[k];
        if (g->kind == BOOLS)
            ((bool *)g->raw)[k] = g->values[k] >= 0.5;
        if (g->kind == INT_BOOLS)
            ((int32_t *)g->raw)[k] = g->values[k] >= 0.5;
    }
    return exchange(f, g);
}

int fmu_get_group(Fmu *f, const Group *g)
{
    if (!exchange(f, g))
        return 0;
#define GET(KIND, TYPE, ...)                                                                       \
    if (g->kind == KIND)                                                                           \
        g->values[k] = (double)((TYPE *)g->raw)[k];
    for (int64_t k = 0; k < g->size; k++) {
        WHOLE_TYPES(GET)
        GET(FLOATS, float, )
        GET(BOOLS, bool, )
        GET(INT_BOOLS, int32_t, )
    }
    return 1;
}

enum { MOST_SLOPES = 64 }; /* in one call */
static const int32_t FIRST_ORDERS[MOST_SLOPES] = {
    1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1,
    1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1};

int fmu_slopes(Fmu *f, AnyFunction call, const uint32_t *places, int64_t n, double *values)
{
    for (int64_t k = 0; k < n; k += MOST_SLOPES) {
        const size_t few = (size_t)(n - k < MOST_SLOPES ? n - k : MOST_SLOPES);
        const int status =
            is_version_2(f)
                ? ((Slopes2 *)call)(f->instance, places + k, few, FIRST_ORDERS, values + k)
                : ((Slopes3 *)call)(f->instance, places + k, few, FIRST_ORDERS, values + k, few);
        if (!good(f, status, call))
            return 0;
    }
    return 1;
}

int fmu_save(Fmu *f, AnyFunction call, void **state)
{
    return good(f, ((Save *)call)(f->instance, state), call);
}

int fmu_restore(Fmu *f, AnyFunction call, void *state)
{
    return good(f, ((Restore *)call)(f->instance, state), call);
}
