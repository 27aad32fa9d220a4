/* FMI 2.0 and FMI 3.0 alike: bound when an instance is made, and not asked about at a call. */

#include "loop.h"

#include <stdbool.h>

typedef int Set2(void *, const uint32_t *, size_t, const double *);
typedef int Get2(void *, const uint32_t *, size_t, double *);
typedef int GetIntegers2(void *, const uint32_t *, size_t, int32_t *);
typedef int DoStep2(void *, double, double, int);
typedef int Set3(void *, const uint32_t *, size_t, const double *, size_t);
typedef int Get3(void *, const uint32_t *, size_t, double *, size_t);
typedef int GetIntegers3(void *, const uint32_t *, size_t, int32_t *, size_t);
typedef int DoStep3(void *, double, double, bool, bool *, bool *, bool *, double *);

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
    return good(f, ((DoStep2 *)f->do_step)(f->instance, f->time, h, 1), f->do_step);
}

static int step3(Fmu *f, double h)
{
    bool event, terminate, early;
    double reached;
    DoStep3 *const step = (DoStep3 *)f->do_step;
    return good(f, step(f->instance, f->time, h, true, &event, &terminate, &early, &reached),
                f->do_step);
}

void fmu_bind(Fmu *f, int version)
{
    f->set = version == 2 ? set2 : set3;
    f->step = version == 2 ? step2 : step3;
    f->get = version == 2 ? get2 : get3;
    f->get_whole = version == 2 ? get_whole2 : get_whole3;
}
