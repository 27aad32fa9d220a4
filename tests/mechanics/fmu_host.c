/* A host that steps the FMU through both interfaces and prints what it finds, digit by digit. Linked
 * with the FMU's sources, or, with FMI's overrides of the prefix, with its shared library. */
#include <stdio.h>
#include <stdlib.h>

#define FMI2_FUNCTION_PREFIX stickslip_
#include <fmi2Functions.h>
#define FMI3_FUNCTION_PREFIX stickslip_
#include <fmi3Functions.h>

/* What another FMU, or the host, may call its own. */
int advance(void);
int advance(void)
{
    exit(3);
}
int forces(void);
int forces(void)
{
    exit(3);
}
int model_step(void);
int model_step(void)
{
    exit(3);
}
int REAL_INFO = 0;

static const double H = 2e-4;
enum { STEPS = 500 };

static void logger2(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status,
                    fmi2String category, fmi2String message, ...)
{
    (void)environment, (void)name, (void)status, (void)category;
    fprintf(stderr, "%s\n", message);
}

static void logger3(fmi3InstanceEnvironment environment, fmi3Status status, fmi3String category,
                    fmi3String message)
{
    (void)environment, (void)status, (void)category;
    fprintf(stderr, "%s\n", message);
}

static double current(int step)
{
    return 0.02 * (step % 100) - 1.0;
}

/* host TOKEN, then the value references of current, contact, z_part and z_ram */
int main(int argc, char **argv)
{
    if (argc != 6)
        return 2;
    unsigned vr[4];
    for (int i = 0; i < 4; i++)
        vr[i] = (unsigned)atoi(argv[i + 2]);
    const int rigid = 2;
    int bad = 0;

    const fmi2CallbackFunctions callbacks = {logger2, calloc, free, NULL, NULL};
    fmi2Component c2 =
        fmi2Instantiate("host", fmi2CoSimulation, argv[1], NULL, &callbacks, fmi2False, fmi2False);
    fmi3Instance c3 = fmi3InstantiateCoSimulation("host", argv[1], NULL, fmi3False, fmi3False,
                                                  fmi3False, fmi3False, NULL, 0, NULL, logger3, NULL);
    if (!c2 || !c3)
        return 1;
    bad |= fmi2SetInteger(c2, &vr[1], 1, &rigid) | fmi3SetInt32(c3, &vr[1], 1, &rigid, 1);
    bad |= fmi2SetupExperiment(c2, fmi2False, 0.0, 0.0, fmi2False, 0.0);
    bad |= fmi2EnterInitializationMode(c2);
    bad |= fmi3EnterInitializationMode(c3, fmi3False, 0.0, 0.0, fmi3False, 0.0);
    bad |= fmi2ExitInitializationMode(c2) | fmi3ExitInitializationMode(c3);
    for (int step = 0; step < STEPS; step++) {
        const double i = current(step);
        double found2[2], found3[2], reached;
        fmi3Boolean event, terminate, early;
        bad |= fmi2SetReal(c2, &vr[0], 1, &i) | fmi3SetFloat64(c3, &vr[0], 1, &i, 1);
        bad |= fmi2DoStep(c2, step * H, H, fmi2True);
        bad |= fmi3DoStep(c3, step * H, H, fmi3True, &event, &terminate, &early, &reached);
        bad |= fmi2GetReal(c2, &vr[2], 2, found2) | fmi3GetFloat64(c3, &vr[2], 2, found3, 2);
        printf("%a %a %a %a\n", found2[0], found2[1], found3[0], found3[1]);
    }
    fmi2FreeInstance(c2);
    fmi3FreeInstance(c3);
    return bad;
}
