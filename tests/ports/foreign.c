/* A stranger's FMU for the tests, of FMI 2.0 and of FMI 3.0, no more than an importer needs:
   J dw/dt = u - B w, solved exactly for an input that is held; y = D u, which feeds through;
   an array x of two (FMI 3.0), whose sum is added to u; a switch that turns u off; a whole number
   that counts steps; a ball that falls from drop (m) and leaves the floor with half its speed v (m/s),
   whose impacts lie anywhere within a step. With crash_at it ends its process there, with fail_at its step fails. */

#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { U, OMEGA, J, B, D, ALPHA, Y, CRASH_AT, FAIL_AT, X0, X1, FALLEN, V, DROP, N_REALS };
enum { OFF = 20, STEPS = 21, X = 30, XS = 31 };

typedef void Log2(void *, const char *, int, const char *, const char *, ...);
typedef void Log3(void *, int, const char *, const char *);

typedef struct {
    double r[N_REALS], time;
    int off, steps;
    Log2 *log2;
    Log3 *log3;
} Model;

static double input(const Model *m)
{
    return m->off ? 0.0 : m->r[U] + m->r[X0] + m->r[X1];
}

static double value(const Model *m, uint32_t place)
{
    switch (place) {
    case ALPHA: return (input(m) - m->r[B] * m->r[OMEGA]) / m->r[J];
    case Y: return m->r[D] * m->r[U];
    default: return m->r[place];
    }
}

static int step(Model *m, double time, double h)
{
    if (time + h >= m->r[CRASH_AT])
        abort();
    if (time + h >= m->r[FAIL_AT]) {
        if (m->log2)
            m->log2(NULL, "foreign", 3, "error", "the %s is worn %s", "bearing", "out");
        if (m->log3)
            m->log3(NULL, 3, "error", "the bearing is worn out");
        return 3;
    }
    const double g = 9.81;
    for (double left = h; left > 0.0;) {
        const double v = m->r[V], height = fmax(m->r[DROP] - m->r[FALLEN], 0.0);
        const double hit = (v + sqrt(v * v + 2.0 * g * height)) / g;
        const double part = fmin(hit, left);
        if (fabs(v) < 1e-6 && height == 0.0)
            break; /* it lies there */
        m->r[FALLEN] -= v * part - 0.5 * g * part * part;
        m->r[V] -= g * part;
        if (hit <= left) {
            m->r[FALLEN] = m->r[DROP];
            m->r[V] *= -0.5;
        }
        left -= part;
    }
    const double u = input(m), rest = u / m->r[B];
    m->r[OMEGA] = rest + (m->r[OMEGA] - rest) * exp(-h * m->r[B] / m->r[J]);
    m->time = time + h;
    m->steps++;
    return 0;
}

static Model *make(void)
{
    Model *m = calloc(1, sizeof *m);
    m->r[J] = 2e-4, m->r[B] = 1e-4, m->r[D] = 1.0;
    m->r[DROP] = 0.01;
    m->r[CRASH_AT] = m->r[FAIL_AT] = 1e9;
    return m;
}

/* --- FMI 2.0 --- */

typedef struct {
    Log2 *logger;
} Callbacks2;

void *fmi2Instantiate(const char *a, int b, const char *c, const char *d, const Callbacks2 *calls,
                      int e, int f)
{
    (void)a, (void)b, (void)c, (void)d, (void)e, (void)f;
    Model *m = make();
    m->log2 = calls->logger;
    return m;
}

void fmi2FreeInstance(void *m) { free(m); }
int fmi2SetupExperiment(void *m, int a, double b, double c, int d, double e)
{
    (void)m, (void)a, (void)b, (void)c, (void)d, (void)e;
    return 0;
}
int fmi2EnterInitializationMode(void *m) { return !m; }
int fmi2ExitInitializationMode(void *m) { return !m; }
int fmi2Terminate(void *m) { return !m; }
int fmi2Reset(void *m) { return !m; }

int fmi2SetReal(void *p, const uint32_t *places, size_t n, const double *values)
{
    for (size_t k = 0; k < n; k++)
        ((Model *)p)->r[places[k]] = values[k];
    return 0;
}

int fmi2GetReal(void *p, const uint32_t *places, size_t n, double *values)
{
    for (size_t k = 0; k < n; k++)
        values[k] = value(p, places[k]);
    return 0;
}

int fmi2SetBoolean(void *p, const uint32_t *places, size_t n, const int *values)
{
    (void)places;
    if (n)
        ((Model *)p)->off = values[0];
    return 0;
}

int fmi2GetInteger(void *p, const uint32_t *places, size_t n, int *values)
{
    (void)places;
    if (n)
        values[0] = ((Model *)p)->steps;
    return 0;
}

/* Known from the first step on only. */
int fmi2GetRealOutputDerivatives(void *p, const uint32_t *places, size_t n, const int *orders,
                                 double *values)
{
    (void)orders;
    const Model *m = p;
    for (size_t k = 0; k < n; k++)
        values[k] = m->steps == 0 ? NAN : places[k] == OMEGA ? value(m, ALPHA) : 0.0;
    return 0;
}

int fmi2DoStep(void *m, double time, double h, int a) { return (void)a, step(m, time, h); }

int fmi2GetFMUstate(void *m, void **state)
{
    if (!*state)
        *state = malloc(sizeof(Model));
    memcpy(*state, m, sizeof(Model));
    return 0;
}

int fmi2SetFMUstate(void *m, void *state) { return !memcpy(m, state, sizeof(Model)); }
int fmi2FreeFMUstate(void *m, void **state) { return (void)m, free(*state), *state = NULL, 0; }

/* --- FMI 3.0 --- */

void *fmi3InstantiateCoSimulation(const char *a, const char *b, const char *c, bool d, bool e,
                                  bool f, bool g, const uint32_t *h, size_t i, void *j, Log3 *log,
                                  void *k)
{
    (void)a, (void)b, (void)c, (void)d, (void)e, (void)f, (void)g, (void)h, (void)i, (void)j;
    (void)k;
    Model *m = make();
    m->log3 = log;
    return m;
}

void fmi3FreeInstance(void *m) { free(m); }
int fmi3EnterInitializationMode(void *m, bool a, double b, double c, bool d, double e)
{
    (void)a, (void)b, (void)c, (void)d, (void)e;
    return !m;
}
int fmi3ExitInitializationMode(void *m) { return !m; }
int fmi3Terminate(void *m) { return !m; }
int fmi3Reset(void *m) { return !m; }

int fmi3SetFloat64(void *p, const uint32_t *places, size_t n, const double *values, size_t size)
{
    const double *end = values + size;
    Model *m = p;
    for (size_t k = 0; k < n; k++) {
        if (places[k] == X) {
            m->r[X0] = *values++;
            m->r[X1] = *values++;
        } else {
            m->r[places[k]] = *values++;
        }
    }
    return values == end ? 0 : 3;
}

int fmi3GetFloat64(void *p, const uint32_t *places, size_t n, double *values, size_t size)
{
    const double *end = values + size;
    Model *m = p;
    for (size_t k = 0; k < n; k++) {
        if (places[k] == XS) {
            *values++ = m->r[OMEGA];
            *values++ = -m->r[OMEGA];
        } else {
            *values++ = value(m, places[k]);
        }
    }
    return values == end ? 0 : 3;
}

int fmi3SetBoolean(void *p, const uint32_t *places, size_t n, const bool *values, size_t size)
{
    (void)places, (void)size;
    if (n)
        ((Model *)p)->off = values[0];
    return 0;
}

int fmi3GetInt32(void *p, const uint32_t *places, size_t n, int32_t *values, size_t size)
{
    (void)places, (void)size;
    if (n)
        values[0] = ((Model *)p)->steps;
    return 0;
}

int fmi3DoStep(void *m, double time, double h, bool a, bool *event, bool *terminate, bool *early,
               double *reached)
{
    (void)a;
    *event = *terminate = *early = false;
    *reached = time + h;
    return step(m, time, h);
}

int fmi3GetFMUState(void *m, void **state) { return fmi2GetFMUstate(m, state); }
int fmi3SetFMUState(void *m, void *state) { return fmi2SetFMUstate(m, state); }
int fmi3FreeFMUState(void *m, void **state) { return fmi2FreeFMUstate(m, state); }

/* What an importer may look for and these tests never call. */
#define STUB(NAME) int NAME(void) { return 3; }
STUB(fmi2CancelStep)
STUB(fmi2DeSerializeFMUstate)
STUB(fmi2GetBoolean)
STUB(fmi2GetBooleanStatus)
STUB(fmi2GetDirectionalDerivative)
STUB(fmi2GetIntegerStatus)
STUB(fmi2GetRealStatus)
STUB(fmi2GetStatus)
STUB(fmi2GetString)
STUB(fmi2GetStringStatus)
const char *fmi2GetTypesPlatform(void) { return "2.0"; }
const char *fmi2GetVersion(void) { return "2.0"; }
STUB(fmi2SerializeFMUstate)
STUB(fmi2SerializedFMUstateSize)
STUB(fmi2SetDebugLogging)
STUB(fmi2SetInteger)
STUB(fmi2SetRealInputDerivatives)
STUB(fmi2SetString)
STUB(fmi3ActivateModelPartition)
STUB(fmi3CompletedIntegratorStep)
STUB(fmi3DeserializeFMUState)
STUB(fmi3EnterConfigurationMode)
STUB(fmi3EnterContinuousTimeMode)
STUB(fmi3EnterEventMode)
STUB(fmi3EnterStepMode)
STUB(fmi3EvaluateDiscreteStates)
STUB(fmi3ExitConfigurationMode)
STUB(fmi3GetAdjointDerivative)
STUB(fmi3GetBinary)
STUB(fmi3GetBoolean)
STUB(fmi3GetClock)
STUB(fmi3GetContinuousStateDerivatives)
STUB(fmi3GetContinuousStates)
STUB(fmi3GetDirectionalDerivative)
STUB(fmi3GetEventIndicators)
STUB(fmi3GetFloat32)
STUB(fmi3GetInt16)
STUB(fmi3GetInt64)
STUB(fmi3GetInt8)
STUB(fmi3GetIntervalDecimal)
STUB(fmi3GetIntervalFraction)
STUB(fmi3GetNominalsOfContinuousStates)
STUB(fmi3GetNumberOfContinuousStates)
STUB(fmi3GetNumberOfEventIndicators)
STUB(fmi3GetNumberOfVariableDependencies)
STUB(fmi3GetOutputDerivatives)
STUB(fmi3GetShiftDecimal)
STUB(fmi3GetShiftFraction)
STUB(fmi3GetString)
STUB(fmi3GetUInt16)
STUB(fmi3GetUInt32)
STUB(fmi3GetUInt64)
STUB(fmi3GetUInt8)
STUB(fmi3GetVariableDependencies)
const char *fmi3GetVersion(void) { return "3.0"; }
STUB(fmi3InstantiateModelExchange)
STUB(fmi3InstantiateScheduledExecution)
STUB(fmi3SerializeFMUState)
STUB(fmi3SerializedFMUStateSize)
STUB(fmi3SetBinary)
STUB(fmi3SetClock)
STUB(fmi3SetContinuousStates)
STUB(fmi3SetDebugLogging)
STUB(fmi3SetFloat32)
STUB(fmi3SetInt16)
STUB(fmi3SetInt32)
STUB(fmi3SetInt64)
STUB(fmi3SetInt8)
STUB(fmi3SetIntervalDecimal)
STUB(fmi3SetIntervalFraction)
STUB(fmi3SetShiftDecimal)
STUB(fmi3SetShiftFraction)
STUB(fmi3SetString)
STUB(fmi3SetTime)
STUB(fmi3SetUInt16)
STUB(fmi3SetUInt32)
STUB(fmi3SetUInt64)
STUB(fmi3SetUInt8)
STUB(fmi3UpdateDiscreteStates)
