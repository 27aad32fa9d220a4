/* Drives the FMU's two interfaces with much random and some senseless input. Built together with
 * the FMU's sources under the sanitizers; complains through them or by a failed check. The argument
 * is the seed of what is random. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"
#include "fmi3Functions.h"
#include "fmi/instance.h"
#include "fmi/references.h"
#include "physics/model.h"

#define CHECK(condition)                                                                           \
    do {                                                                                           \
        if (!(condition)) {                                                                        \
            fprintf(stderr, "%s:%d: not so: %s\n", __FILE__, __LINE__, #condition);                \
            exit(1);                                                                               \
        }                                                                                          \
    } while (0)

#define PLACE(name) ((unsigned)(REFERENCE_REALS + offsetof(Reals, name) / sizeof(double)))
#define INT_PLACE(name) ((unsigned)(REFERENCE_INTEGERS + offsetof(Integers, name) / sizeof(int)))

static unsigned long long seed; /* not 0 */
static int refusals, messages;
static long calls;

static unsigned long long draw(void)
{
    seed ^= seed << 13;
    seed ^= seed >> 7;
    return seed ^= seed << 17;
}

static double uniform(double low, double high)
{
    return low + (high - low) * ((double)(draw() >> 11) / 9007199254740992.0);
}

static double senseless(void)
{
    static const double VALUES[] = {NAN, INFINITY, -INFINITY, 0.0, -0.0, 1e308, -1e308, 5e-324};
    return VALUES[draw() % 8];
}

static void logger2(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status,
                    fmi2String category, fmi2String message, ...)
{
    (void)environment;
    CHECK(strcmp(name, "a%s#1#") == 0);
    CHECK(category && message && strlen(message) > 10);
    messages += status == fmi2Error;
}

static void logger3(fmi3InstanceEnvironment environment, fmi3Status status, fmi3String category,
                    fmi3String message)
{
    (void)environment;
    CHECK(category && message && strlen(message) > 10);
    messages += status == fmi3Error;
}

static const fmi2CallbackFunctions CALLBACKS = {logger2, NULL, NULL, NULL, NULL};

static fmi2Component new2(const char *token)
{
    return fmi2Instantiate("a%s#1#", fmi2CoSimulation, token, NULL, &CALLBACKS, 0, draw() % 2);
}

static fmi3Instance new3(const char *token)
{
    return fmi3InstantiateCoSimulation("a", token, NULL, 0, draw() % 2, 0, 0, NULL, 0, NULL,
                                       logger3, NULL);
}

/* A call succeeds or is refused with a message and leaves the state as it was. */
static int attempt(fmi2Component c, int (*call)(fmi2Component c))
{
    static fmi2Byte before[4096], after[4096];
    fmi2FMUstate state = NULL;
    size_t size;
    CHECK(fmi2GetFMUstate(c, &state) == fmi2OK);
    CHECK(fmi2SerializedFMUstateSize(c, state, &size) == fmi2OK && size <= sizeof before);
    CHECK(fmi2SerializeFMUstate(c, state, before, size) == fmi2OK);
    const int told = messages, done = call(c);
    if (!done) {
        CHECK(fmi2GetFMUstate(c, &state) == fmi2OK);
        CHECK(fmi2SerializeFMUstate(c, state, after, size) == fmi2OK);
        CHECK(memcmp(before, after, size) == 0);
        CHECK(messages > told);
        refusals++;
    }
    CHECK(fmi2FreeFMUstate(c, &state) == fmi2OK && state == NULL);
    return done;
}

static int set_anything(fmi2Component c)
{
    fmi2ValueReference vr[3];
    double values[3];
    int integers[3];
    for (int i = 0; i < 3; i++) {
        vr[i] = draw() % 8 ? (unsigned)(draw() % (N_REALS + 3)) : (unsigned)draw();
        values[i] = draw() % 4 ? uniform(-2.0, 2.0) : senseless();
        integers[i] = (int)(draw() % 4) - 1;
    }
    if (draw() % 4)
        return fmi2SetReal(c, vr, draw() % 4, values) == fmi2OK;
    for (int i = 0; i < 3; i++)
        vr[i] = REFERENCE_INTEGERS + (unsigned)(draw() % (N_INTEGERS + 2)) - 1;
    return fmi2SetInteger(c, vr, draw() % 4, integers) == fmi2OK;
}

static int get_anything(fmi2Component c)
{
    fmi2ValueReference vr = (unsigned)(draw() % (N_REALS + 2));
    double value;
    return fmi2GetReal(c, &vr, 1, &value) == fmi2OK;
}

static int differentiate(fmi2Component c)
{
    fmi2ValueReference unknowns[] = {(unsigned)(draw() % (N_REALS + 2)),
                                     (unsigned)(draw() % (N_REALS + 2))};
    fmi2ValueReference knowns[] = {PLACE(current) + (unsigned)(draw() % 9), PLACE(normal_force)};
    double given[] = {uniform(-1, 1), draw() % 8 ? 1.0 : senseless()}, found[2];
    return fmi2GetDirectionalDerivative(c, unknowns, 2, knowns, 2, given, found) == fmi2OK;
}

static int restore_damaged(fmi2Component c)
{
    fmi2Byte bytes[4096];
    fmi2FMUstate state = NULL, again = NULL;
    size_t size;
    CHECK(fmi2GetFMUstate(c, &state) == fmi2OK);
    CHECK(fmi2SerializedFMUstateSize(c, state, &size) == fmi2OK);
    CHECK(fmi2SerializeFMUstate(c, state, bytes, size - 1) == fmi2Error);
    CHECK(fmi2SerializeFMUstate(c, state, bytes, size) == fmi2OK);
    CHECK(fmi2FreeFMUstate(c, &state) == fmi2OK);
    const size_t at = draw() % size;
    bytes[at] = (fmi2Byte)(bytes[at] ^ (1 << draw() % 8));
    return fmi2DeSerializeFMUstate(c, bytes, draw() % 4 ? size : draw() % size, &again) == fmi2OK;
}

/* FNV-1a, as fmi/state.c has it. */
static uint64_t sum_of(const fmi2Byte *bytes, size_t n)
{
    uint64_t sum = 0xcbf29ce484222325;
    for (size_t i = 0; i < n; i++)
        sum = (sum ^ (unsigned char)bytes[i]) * 0x100000001b3;
    return sum;
}

static double wild(void)
{
    const double sign = draw() % 2 ? 1.0 : -1.0;
    uint64_t bits = draw();
    double any;
    memcpy(&any, &bits, sizeof any);
    switch (draw() % 4) {
    case 0:
        return senseless();
    case 1:
        return any;
    default:
        return sign * pow(10.0, uniform(-20.0, 20.0));
    }
}

/* Where the parts of a state lie that decide how it goes on. */
#define PART(part) {offsetof(State, part), sizeof(((State *)0)->part)}
static const struct {
    size_t at, size;
} PARTS[] = {PART(model.r),     PART(model.n),    PART(model.mode), PART(model.y),
             PART(model.step),  PART(model.touch_step), PART(model.steady_for),
             PART(model.ahead), PART(model.ahead.dense), PART(model),
             {offsetof(State, time), sizeof(State) - offsetof(State, time)}};

static int wild_states, taken_states;

/* A state with wild values and a right checksum is refused, or goes on and comes back: the steps
 * end, and after a reset the instance is as good as new. */
static void restore_wild(fmi2Component other, fmi2Component c)
{
    static fmi2Byte bytes[4096];
    const size_t sum_at = 2 * sizeof(uint64_t);
    fmi2FMUstate state = NULL, again = NULL;
    size_t size;
    CHECK(fmi2GetFMUstate(other, &state) == fmi2OK);
    CHECK(fmi2SerializedFMUstateSize(other, state, &size) == fmi2OK && size <= sizeof bytes);
    CHECK(fmi2SerializeFMUstate(other, state, bytes, size) == fmi2OK);
    CHECK(fmi2FreeFMUstate(other, &state) == fmi2OK);
    fmi2Byte *const own = bytes + size - sizeof(State);
    for (int n = 1 + (int)(draw() % 3); n > 0; n--) {
        const size_t part = draw() % (sizeof PARTS / sizeof *PARTS);
        fmi2Byte *const at = own + PARTS[part].at;
        const int whole = (int)(draw() % 9) - 4;
        const double value = wild();
        if (draw() % 2)
            memcpy(at + draw() % (PARTS[part].size / sizeof whole) * sizeof whole, &whole,
                   sizeof whole);
        else
            memcpy(at + draw() % (PARTS[part].size / sizeof value) * sizeof value, &value,
                   sizeof value);
    }
    const uint64_t sum = sum_of(own, sizeof(State));
    memcpy(bytes + sum_at, &sum, sizeof sum);
    wild_states++;
    calls += 4;
    if (fmi2DeSerializeFMUstate(c, bytes, size, &again) == fmi2OK) {
        taken_states++;
        CHECK(fmi2SetFMUstate(c, again) == fmi2OK);
        CHECK(fmi2FreeFMUstate(c, &again) == fmi2OK);
        for (int i = 0; i < 3; i++) {
            const fmi2ValueReference time_vr = REFERENCE_TIME;
            fmi2ValueReference vr = (unsigned)(draw() % (N_REALS + 2));
            double time, value;
            CHECK(fmi2GetReal(c, &time_vr, 1, &time) == fmi2OK);
            fmi2DoStep(c, time, pow(10.0, uniform(-6.0, -3.0)), 1);
            fmi2GetReal(c, &vr, 1, &value);
            calls += 3;
        }
    }
    double value = 0.0;
    const fmi2ValueReference vr = PLACE(z_part);
    CHECK(fmi2Reset(c) == fmi2OK);
    CHECK(fmi2SetupExperiment(c, 0, 0.0, 0.0, 0, 0.0) == fmi2OK);
    CHECK(fmi2EnterInitializationMode(c) == fmi2OK);
    CHECK(fmi2ExitInitializationMode(c) == fmi2OK);
    CHECK(fmi2DoStep(c, 0.0, 1e-4, 1) == fmi2OK && fmi2GetReal(c, &vr, 1, &value) == fmi2OK);
    static double known;
    CHECK(known == 0.0 || value == known);
    known = value;
    calls += 6;
}

static int call_out_of_turn(fmi2Component c)
{
    const double h = senseless(), endless = 1e300;
    switch (draw() % 6) {
    case 0:
        return fmi2DoStep(c, senseless(), h < endless ? h : NAN, 1) == fmi2OK;
    case 1:
        return fmi2SetupExperiment(c, 1, senseless(), senseless(), 1, senseless()) == fmi2OK;
    case 2:
        return fmi2GetReal(c, NULL, 3, NULL) == fmi2OK;
    case 3:
        return fmi2CancelStep(c) == fmi2OK;
    case 4:
        return fmi2SetFMUstate(c, NULL) == fmi2OK;
    default:
        return fmi2GetRealOutputDerivatives(c, NULL, 0, NULL, NULL) == fmi2OK;
    }
}

static int (*const CALLS[])(fmi2Component) = {set_anything, get_anything, differentiate,
                                              restore_damaged, call_out_of_turn};

static void abuse(fmi2Component c, int n)
{
    for (int i = 0; i < n; i++)
        attempt(c, CALLS[draw() % 5]);
}

/* Parameters near their defaults, so that the steps stay cheap. */
static void choose_parameters(fmi2Component c3, fmi2Component c2)
{
    for (unsigned i = 0; i < N_REALS; i++) {
        const fmi2ValueReference vr = REFERENCE_REALS + i;
        const double value = stickslip_real_info[i].start * uniform(0.7, 1.3);
        if (stickslip_real_info[i].kind != KIND_PARAMETER ||
            strncmp(stickslip_real_info[i].name, "mu_", 3) == 0)
            continue;
        CHECK(fmi2SetReal(c2, &vr, 1, &value) == fmi2OK);
        CHECK(fmi3SetFloat64(c3, &vr, 1, &value, 1) == fmi3OK);
    }
    const fmi2ValueReference choices[] = {INT_PLACE(contact), INT_PLACE(source),
                                          INT_PLACE(coil_count), INT_PLACE(independent),
                                          INT_PLACE(n_surfaces)};
    const int two = (int)(draw() % 2);
    const int chosen[] = {1 + (int)(draw() % 2), (int)(draw() % 2), 1 + (int)(draw() % 3), two,
                          1 + two};
    CHECK(fmi2SetInteger(c2, choices, 5, chosen) == fmi2OK);
    CHECK(fmi3SetInt32(c3, choices, 5, chosen, 5) == fmi3OK);
}

static void compare(fmi2Component c2, fmi3Instance c3)
{
    calls += 2 * N_REALS;
    for (unsigned i = 0; i < N_REALS; i++) {
        const fmi2ValueReference vr = REFERENCE_REALS + i;
        double a, b;
        CHECK(fmi2GetReal(c2, &vr, 1, &a) == fmi2OK);
        CHECK(fmi3GetFloat64(c3, &vr, 1, &b, 1) == fmi3OK);
        CHECK(a == b && isfinite(a));
    }
}

static void simulate(int steps)
{
    fmi2Component c2 = new2(TOKEN_TEXT);
    fmi3Instance c3 = new3(TOKEN_TEXT);
    fmi2Component target = new2(TOKEN_TEXT); /* of wild states */
    CHECK(c2 && c3 && target);
    abuse(c2, 200);
    CHECK(fmi2Reset(c2) == fmi2OK);
    choose_parameters(c3, c2);
    CHECK(fmi2SetupExperiment(c2, 0, 0.0, 0.0, 0, 0.0) == fmi2OK);
    CHECK(fmi2EnterInitializationMode(c2) == fmi2OK);
    CHECK(fmi2ExitInitializationMode(c2) == fmi2OK);
    CHECK(fmi3EnterInitializationMode(c3, 0, 0.0, 0.0, 0, 0.0) == fmi3OK);
    CHECK(fmi3ExitInitializationMode(c3) == fmi3OK);

    const fmi2ValueReference inputs[] = {PLACE(current), PLACE(current_slope),
                                         PLACE(normal_force), PLACE(normal_force_slope),
                                         PLACE(command), PLACE(command_slope),
                                         PLACE(current_2), PLACE(current_2_slope),
                                         PLACE(command_2), PLACE(command_2_slope),
                                         PLACE(inputs_hold_for)};
    double time = 0.0, held = 0.0; /* for so long the inputs are said to go on */
    for (int i = 0; i < steps; i++) {
        const int renewed = held == 0.0 || uniform(0.0, 1.0) < 0.4;
        const double h = renewed ? pow(10.0, uniform(-6.0, -3.0)) : held * uniform(0.1, 1.0);
        double values[] = {uniform(-1.5, 1.5), uniform(-1.0, 1.0) / h, uniform(0.1, 1.0),
                           uniform(-0.01, 0.01) / h, uniform(-15.0, 15.0), uniform(-9.0, 9.0) / h,
                           uniform(-1.5, 1.5), uniform(-1.0, 1.0) / h, uniform(-15.0, 15.0),
                           uniform(-9.0, 9.0) / h, uniform(-2.0, 6.0) * h};
        double last;
        fmi3Boolean event, terminate, early;
        fmi2FMUstate before = NULL;
        CHECK(fmi2GetFMUstate(c2, &before) == fmi2OK);
        abuse(c2, 2);
        CHECK(fmi2SetFMUstate(c2, before) == fmi2OK);
        CHECK(fmi2FreeFMUstate(c2, &before) == fmi2OK);
        if (values[10] < 0.0)
            values[10] = 0.0;
        if (renewed) {
            held = values[10];
            CHECK(fmi2SetReal(c2, inputs, 11, values) == fmi2OK);
            CHECK(fmi3SetFloat64(c3, inputs, 11, values, 11) == fmi3OK);
        }
        CHECK(fmi2DoStep(c2, time, h, 1) == fmi2OK);
        CHECK(fmi3DoStep(c3, time, h, 1, &event, &terminate, &early, &last) == fmi3OK);
        CHECK(!event && !terminate && !early && last == time + h);
        if (i % 25 == 0)
            restore_wild(c2, target);
        time = last;
        held = held > h ? held - h : 0.0;
        compare(c2, c3);
    }
    CHECK(fmi2Terminate(c2) == fmi2OK);
    abuse(c2, 20);
    fmi2FreeInstance(target);
    fmi2FreeInstance(c2);
    fmi3FreeInstance(c3);
}

int main(int count, char **arguments)
{
    CHECK(count == 2);
    seed = strtoull(arguments[1], NULL, 10);
    CHECK(seed);
    for (int i = 0; i < 1000; i++) {
        fmi2FreeInstance(new2(TOKEN_TEXT));
        fmi3FreeInstance(new3(TOKEN_TEXT));
        CHECK(!new2(i % 2 ? "other" : NULL));
        CHECK(!new3("%n%s%x"));
    }
    CHECK(!fmi2Instantiate("", fmi2CoSimulation, TOKEN_TEXT, NULL, NULL, 0, 0));
    CHECK(!fmi2Instantiate("a%s#1#", fmi2ModelExchange, TOKEN_TEXT, NULL, &CALLBACKS, 0, 0));
    CHECK(!fmi3InstantiateModelExchange("a", TOKEN_TEXT, NULL, 0, 0, NULL, logger3));
    CHECK(fmi2DoStep(NULL, 0.0, 1.0, 1) == fmi2Error && fmi3GetFloat64(NULL, NULL, 0, NULL, 0));
    fmi2FreeInstance(NULL);
    fmi3FreeInstance(NULL);
    for (int i = 0; i < 20; i++)
        simulate(100);
    CHECK(refusals > 1000 && taken_states > 5 && wild_states > taken_states + 5);
    printf("%d refusals of more than %ld calls\n", refusals, calls);
    return 0;
}
