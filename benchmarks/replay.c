/* Drives an FMU (FMI 3.0) through a file of communication points, for a count of its instructions:
   replay LIBRARY TOKEN FILE. The file holds 64-bit numbers: how many real parameters, whole ones and
   steps there are; the references of the reals, then of the whole ones; those of current, its slope,
   and the back-EMF with its slope; as doubles the real parameters, then the whole ones, then a step's
   length (s), current (A) and slope (A/s), step after step. */

#include <dlfcn.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

typedef void *Instantiate(const char *, const char *, const char *, bool, bool, bool, bool,
                          const uint32_t *, size_t, void *, void *, void *);
typedef int Enter(void *, bool, double, double, bool, double);
typedef int Exit(void *);
typedef int SetReals(void *, const uint32_t *, size_t, const double *, size_t);
typedef int SetIntegers(void *, const uint32_t *, size_t, const int32_t *, size_t);
typedef int GetReals(void *, const uint32_t *, size_t, double *, size_t);
typedef int DoStep(void *, double, double, bool, bool *, bool *, bool *, double *);

static SetReals *set_reals;
static GetReals *get_reals;
static DoStep *do_step;

static void *function(void *library, const char *name)
{
    void *found = dlsym(library, name);
    if (!found)
        exit(3);
    return found;
}

static void *array(FILE *file, size_t n)
{
    void *values = calloc(n + 1, 8);
    if (!values || fread(values, 8, n, file) != n)
        exit(4);
    return values;
}

static uint32_t *references(FILE *file, size_t n)
{
    const int64_t *wide = array(file, n);
    uint32_t *narrow = calloc(n + 1, sizeof *narrow);
    for (size_t k = 0; narrow && k < n; k++)
        narrow[k] = (uint32_t)wide[k];
    return narrow;
}

/* What is counted. */
__attribute__((noinline)) int replay(void *fmu, const uint32_t *places, const double *steps, size_t n)
{
    double time = 0.0, found[2], reached;
    bool unused[3];
    int worst = 0;
    for (size_t k = 0; k < n; k++, steps += 3) {
        worst |= set_reals(fmu, places, 2, steps + 1, 2);
        worst |= do_step(fmu, time, steps[0], true, &unused[0], &unused[1], &unused[2], &reached);
        worst |= get_reals(fmu, places + 2, 2, found, 2);
        time += steps[0];
    }
    return worst;
}

int main(int count, char **arguments)
{
    if (count != 4)
        return 2;
    void *library = dlopen(arguments[1], RTLD_NOW);
    FILE *file = fopen(arguments[3], "rb");
    if (!library || !file)
        return 3;
    const int64_t *n = array(file, 3);
    const size_t reals = (size_t)n[0], integers = (size_t)n[1], steps = (size_t)n[2];
    const uint32_t *real_places = references(file, reals);
    const uint32_t *integer_places = references(file, integers), *places = references(file, 4);
    const double *real_values = array(file, reals), *whole = array(file, integers);
    const double *points = array(file, 3 * steps);
    int32_t *integer_values = calloc(integers + 1, sizeof *integer_values);
    for (size_t k = 0; integer_values && k < integers; k++)
        integer_values[k] = (int32_t)whole[k];

    set_reals = (SetReals *)function(library, "fmi3SetFloat64");
    get_reals = (GetReals *)function(library, "fmi3GetFloat64");
    do_step = (DoStep *)function(library, "fmi3DoStep");
    void *fmu = ((Instantiate *)function(library, "fmi3InstantiateCoSimulation"))(
        "replay", arguments[2], NULL, false, false, false, false, NULL, 0, NULL, NULL, NULL);
    if (!fmu)
        return 5;
    int worst = set_reals(fmu, real_places, reals, real_values, reals);
    worst |= ((SetIntegers *)function(library, "fmi3SetInt32"))(fmu, integer_places, integers,
                                                                integer_values, integers);
    worst |= ((Enter *)function(library, "fmi3EnterInitializationMode"))(fmu, false, 0, 0, false, 0);
    worst |= ((Exit *)function(library, "fmi3ExitInitializationMode"))(fmu);
    return worst | replay(fmu, places, points, steps) ? 6 : 0;
}
