/* SPDX-License-Identifier: BSD-2-Clause */
/* Prints the XML files of the FMU from the table of variables. Runs at build time; not a part of
 * the FMU.
 *
 *     describe 2 SOURCE...         modelDescription.xml, FMI 2.0
 *     describe 3                   modelDescription.xml, FMI 3.0
 *     describe build 2 SOURCE...   buildDescription.xml, FMI 2.0 (from 2.0.4 on) or 3.0 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "../physics/model.h"
#include "references.h"

#define PLACE(name) (offsetof(Reals, name) / sizeof(double))

static void escaped(const char *text)
{
    for (; *text; text++) {
        switch (*text) {
        case '&':
            fputs("&amp;", stdout);
            break;
        case '<':
            fputs("&lt;", stdout);
            break;
        case '>':
            fputs("&gt;", stdout);
            break;
        case '"':
            fputs("&quot;", stdout);
            break;
        default:
            putchar(*text);
        }
    }
}

static void attribute(const char *name, const char *text)
{
    printf(" %s=\"", name);
    escaped(text);
    putchar('"');
}

/* The shortest text that reads back as the same number. */
static void number(const char *name, double value)
{
    char text[32];
    for (int digits = 15; digits <= 17; digits++) {
        snprintf(text, sizeof text, "%.*g", digits, value);
        if (strtod(text, NULL) == value)
            break;
    }
    attribute(name, text);
}

/* ---- units ---- */

enum { KG, M, S, A, N_BASES };
static const char *const BASE_NAMES[N_BASES] = {"kg", "m", "s", "A"};

static const struct {
    const char *symbol;
    int exponents[N_BASES];
} SYMBOLS[] = {{"kg", {1, 0, 0, 0}}, {"m", {0, 1, 0, 0}},  {"s", {0, 0, 1, 0}},
               {"A", {0, 0, 0, 1}},  {"N", {1, 1, -2, 0}}, {"J", {1, 2, -2, 0}},
               {"V", {1, 2, -3, -1}}, {"Ohm", {1, 2, -3, -2}},
               {"H", {1, 2, -2, -2}}};

/* A unit is factors such as N, m1.5 or 1, joined by . or /. */
static void parse_unit(const char *unit, double exponents[N_BASES])
{
    double sign = 1.0;
    memset(exponents, 0, N_BASES * sizeof *exponents);
    const char *at = unit;
    if (*at == '1') {
        if (!at[1])
            return;
        sign = at[1] == '/' ? -1.0 : 1.0;
        at += 2;
    }
    for (;;) {
        const size_t length = strcspn(at, "./0123456789");
        size_t i = 0, n = sizeof SYMBOLS / sizeof *SYMBOLS;
        while (i < n && (strlen(SYMBOLS[i].symbol) != length ||
                         strncmp(SYMBOLS[i].symbol, at, length) != 0))
            i++;
        if (i == n) {
            fprintf(stderr, "describe: cannot read the unit %s\n", unit);
            exit(1);
        }
        at += length;
        double power = 1.0;
        if (*at >= '0' && *at <= '9') {
            char *end;
            power = strtod(at, &end);
            at = end;
        }
        for (int base = 0; base < N_BASES; base++)
            exponents[base] += sign * power * SYMBOLS[i].exponents[base];
        if (!*at)
            return;
        sign = *at++ == '/' ? -1.0 : 1.0;
    }
}

static void unit_definition(const char *unit)
{
    double exponents[N_BASES];
    int whole = 1;
    parse_unit(unit, exponents);
    for (int base = 0; base < N_BASES; base++)
        whole = whole && exponents[base] == floor(exponents[base]);
    printf("    <Unit");
    attribute("name", unit);
    if (!whole) { /* FMI knows whole exponents only */
        puts("/>");
        return;
    }
    printf("><BaseUnit");
    for (int base = 0; base < N_BASES; base++)
        if (exponents[base] != 0.0)
            printf(" %s=\"%d\"", BASE_NAMES[base], (int)exponents[base]);
    puts("/></Unit>");
}

static int used_before(size_t place)
{
    for (size_t i = 0; i < place; i++)
        if (strcmp(stickslip_real_info[i].unit, stickslip_real_info[place].unit) == 0)
            return 1;
    return 0;
}

static void unit_definitions(void)
{
    puts("  <UnitDefinitions>");
    for (size_t i = 0; i < N_REALS; i++)
        if (!used_before(i))
            unit_definition(stickslip_real_info[i].unit);
    puts("  </UnitDefinitions>");
}

/* ---- variables ---- */

/* FMI 2.0 counts variables from 1 in the order of the file, where time is the first. */
static unsigned real_key(int version, size_t place)
{
    return version == 2 ? (unsigned)place + 2 : (unsigned)place + REFERENCE_REALS;
}

static void common_attributes(unsigned reference, const VariableInfo *info, int real)
{
    static const char *const CAUSALITIES[] = {
        [KIND_PARAMETER] = "parameter", [KIND_TUNABLE] = "parameter", [KIND_INPUT] = "input",
        [KIND_OUTPUT] = "output"};
    attribute("name", info->name);
    printf(" valueReference=\"%u\"", reference);
    attribute("description", info->text);
    attribute("causality", CAUSALITIES[info->kind]);
    attribute("variability", info->kind == KIND_PARAMETER ? "fixed"
                             : info->kind == KIND_TUNABLE ? "tunable"
                             : real                       ? "continuous"
                                                          : "discrete");
    if (info->kind != KIND_INPUT)
        attribute("initial", info->kind == KIND_OUTPUT ? "calculated" : "exact");
}

static void type_attributes(int version, const VariableInfo *info, int real)
{
    if (real)
        attribute("unit", info->unit);
    if (real && info == &stickslip_real_info[PLACE(back_emf_slope)])
        printf(" derivative=\"%u\"", real_key(version, PLACE(back_emf)));
    if (info->kind == KIND_OUTPUT)
        return;
    number("min", info->min);
    number("max", info->max);
    number("start", info->start);
}

static void variable(int version, unsigned reference, const VariableInfo *info, int real)
{
    if (version == 2) {
        printf("    <ScalarVariable");
        common_attributes(reference, info, real);
        printf("><%s", real ? "Real" : "Integer");
        type_attributes(version, info, real);
        puts("/></ScalarVariable>");
    } else {
        printf("    <%s", real ? "Float64" : "Int32");
        common_attributes(reference, info, real);
        type_attributes(version, info, real);
        puts("/>");
    }
}

static void variables(int version)
{
    puts("  <ModelVariables>");
    if (version == 2)
        printf("    <ScalarVariable name=\"time\" valueReference=\"%d\" causality=\"independent\" "
               "variability=\"continuous\"><Real unit=\"s\"/></ScalarVariable>\n",
               REFERENCE_TIME);
    else
        printf("    <Float64 name=\"time\" valueReference=\"%d\" causality=\"independent\" "
               "variability=\"continuous\" unit=\"s\"/>\n",
               REFERENCE_TIME);
    for (size_t i = 0; i < N_REALS; i++)
        variable(version, REFERENCE_REALS + (unsigned)i, &stickslip_real_info[i], 1);
    for (size_t i = 0; i < N_INTEGERS; i++)
        variable(version, REFERENCE_INTEGERS + (unsigned)i, &stickslip_integer_info[i], 0);
    puts("  </ModelVariables>");
}

/* ---- structure ---- */

/* Outputs that follow currents, normal force and a prescribed acceleration at once; all others, but
 * for the coil voltages, wait for the next step. */
static int has_feedthrough(size_t place)
{
    switch (place) {
    case PLACE(a_surface):
    case PLACE(a_ram):
    case PLACE(a_part):
    case PLACE(back_emf_slope):
    case PLACE(friction_force):
    case PLACE(plate_force):
    case PLACE(wall_force):
    case PLACE(time_to_impact):
    case PLACE(a_surface_2):
    case PLACE(friction_force_2):
        return 1;
    }
    return 0;
}

static unsigned integer_key(int version, size_t place)
{
    return version == 2 ? (unsigned)(N_REALS + place) + 2 : (unsigned)place + REFERENCE_INTEGERS;
}

static void unknowns(int version, const char *element, int with_dependencies)
{
    const char *key = version == 2 ? "index" : "valueReference";
    for (size_t i = 0; i < N_REALS; i++) {
        if (stickslip_real_info[i].kind != KIND_OUTPUT)
            continue;
        printf("    <%s %s=\"%u\"", element, key, real_key(version, i));
        if (with_dependencies && has_feedthrough(i))
            printf(" dependencies=\"%u %u %u %u\" "
                   "dependenciesKind=\"dependent dependent dependent dependent\"",
                   real_key(version, PLACE(current)), real_key(version, PLACE(normal_force)),
                   real_key(version, PLACE(current_2)),
                   real_key(version, PLACE(surface_acceleration)));
        else if (with_dependencies && i == PLACE(coil_voltage))
            printf(" dependencies=\"%u\" dependenciesKind=\"dependent\"",
                   real_key(version, PLACE(command_slope)));
        else if (with_dependencies && i == PLACE(coil_voltage_2))
            printf(" dependencies=\"%u\" dependenciesKind=\"dependent\"",
                   real_key(version, PLACE(command_2_slope)));
        else if (with_dependencies)
            printf(" dependencies=\"\" dependenciesKind=\"\"");
        puts("/>");
    }
    for (size_t i = 0; i < N_INTEGERS; i++)
        if (stickslip_integer_info[i].kind == KIND_OUTPUT)
            printf("    <%s %s=\"%u\"%s/>\n", element, key, integer_key(version, i),
                   with_dependencies ? " dependencies=\"\" dependenciesKind=\"\"" : "");
}

static void structure(int version)
{
    puts("  <ModelStructure>");
    if (version == 2) {
        puts("  <Outputs>");
        unknowns(version, "Unknown", 1);
        puts("  </Outputs>\n  <InitialUnknowns>");
        unknowns(version, "Unknown", 0);
        puts("  </InitialUnknowns>");
    } else {
        unknowns(version, "Output", 1);
        unknowns(version, "InitialUnknown", 0);
    }
    puts("  </ModelStructure>");
}

/* ---- the files ---- */

#define HEAD "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"
#define ABILITIES                                                                                  \
    "canHandleVariableCommunicationStepSize=\"true\" maxOutputDerivativeOrder=\"0\" "              \
    "canBeInstantiatedOnlyOncePerProcess=\"false\" needsExecutionTool=\"false\""

static void source_files(char **names, int n, const char *element)
{
    for (int i = 0; i < n; i++) {
        printf("      <%s", element);
        attribute("name", names[i]);
        puts("/>");
    }
}

static void model_description(int version, char **sources, int n_sources)
{
    printf(HEAD "<fmiModelDescription fmiVersion=\"%s\" modelName=\"stickslip\" %s=\"%s\"",
           version == 2 ? "2.0" : "3.0", version == 2 ? "guid" : "instantiationToken", TOKEN_TEXT);
    attribute("description", "A part on a vibrating surface: ram, surface and part, with walls and "
                             "set-valued friction");
    attribute("license", "BSD-2-Clause");
    attribute("variableNamingConvention", "flat");
    if (version == 2) {
        puts(">\n  <CoSimulation modelIdentifier=\"stickslip\" " ABILITIES "\n"
             "      canInterpolateInputs=\"true\" canNotUseMemoryManagementFunctions=\"true\"\n"
             "      canGetAndSetFMUstate=\"true\" canSerializeFMUstate=\"true\" "
             "providesDirectionalDerivative=\"true\">\n    <SourceFiles>");
        source_files(sources, n_sources, "File");
        puts("    </SourceFiles>\n  </CoSimulation>");
    } else {
        puts(">\n  <CoSimulation modelIdentifier=\"stickslip\" " ABILITIES "\n"
             "      hasEventMode=\"false\" canGetAndSetFMUState=\"true\" "
             "canSerializeFMUState=\"true\" providesDirectionalDerivatives=\"true\"/>");
    }
    unit_definitions();
    puts("  <LogCategories>\n"
         "    <Category name=\"logStatusError\" description=\"Why a call was refused\"/>\n"
         "    <Category name=\"logEvents\" description=\"Steps with impacts or changes between "
         "sticking and slipping\"/>\n"
         "  </LogCategories>");
    printf("  <DefaultExperiment startTime=\"0\" stopTime=\"0.1\" stepSize=\"1e-4\"");
    number("tolerance", stickslip_real_info[PLACE(tolerance)].start);
    puts("/>");
    variables(version);
    structure(version);
    puts("</fmiModelDescription>");
}

static void build_description(const char *version, char **sources, int n_sources)
{
    puts(HEAD "<fmiBuildDescription fmiVersion=\"3.0\">\n"
              "  <BuildConfiguration modelIdentifier=\"stickslip\">\n"
              "    <SourceFileSet language=\"C11\" compiler=\"gcc\" "
              "compilerOptions=\"-O2 -ffp-contract=off\">");
    source_files(sources, n_sources, "SourceFile");
    printf("      <PreprocessorDefinition name=\"FMI%s_OVERRIDE_FUNCTION_PREFIX\" value=\"1\" "
           "optional=\"true\"\n        description=\"For a shared library: functions without the "
           "prefix stickslip_\"/>\n",
           version);
    puts("    </SourceFileSet>\n"
         "    <Library name=\"m\" external=\"true\" description=\"libm, the functions of math.h, "
         "where it is not a part of the C library\"/>\n"
         "  </BuildConfiguration>\n</fmiBuildDescription>");
}

int main(int argc, char **argv)
{
    const char *what = argc > 1 ? argv[1] : "";
    if (strcmp(what, "2") == 0)
        model_description(2, argv + 2, argc - 2);
    else if (strcmp(what, "3") == 0)
        model_description(3, NULL, 0);
    else if (strcmp(what, "build") == 0 && argc > 2)
        build_description(argv[2], argv + 3, argc - 3);
    else {
        fputs("usage: describe 2|3|build 2|build 3 SOURCE...\n", stderr);
        return 2;
    }
    return fflush(stdout) || ferror(stdout) ? 1 : 0;
}
