/* SPDX-License-Identifier: BSD-2-Clause */
/* Writes a model's modelDescription.xml. Whoever packs an FMU loads its library and calls this. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"

#include "model.h"

static void text(FILE *to, const char *name, const char *value)
{
    fprintf(to, " %s=\"", name);
    for (; *value; value++) {
        if (strchr("&<>\"", *value))
            fprintf(to, "&#%d;", *value);
        else
            putc(*value, to);
    }
    putc('"', to);
}

/* The shortest text that reads back as the same number. */
static void number(FILE *to, const char *name, double value)
{
    char digits[32];
    for (int n = 15; n <= 17; n++) {
        snprintf(digits, sizeof digits, "%.*g", n, value);
        if (strtod(digits, NULL) == value)
            break;
    }
    text(to, name, digits);
}

static void units(FILE *to, const Model *m)
{
    fputs("  <UnitDefinitions>\n    <Unit name=\"s\"><BaseUnit s=\"1\"/></Unit>\n", to);
    for (int k = 0; k < m->count; k++) {
        const char *unit = m->variables[k].unit;
        int known = strcmp(unit, "s") == 0;
        for (int i = 0; i < k; i++)
            known = known || strcmp(unit, m->variables[i].unit) == 0;
        if (!known) {
            fputs("    <Unit", to);
            text(to, "name", unit);
            fputs("/>\n", to);
        }
    }
    fputs("  </UnitDefinitions>\n", to);
}

static void variable(FILE *to, const Model *m, int k, int version, const int *derivative_of)
{
    static const char *const causality[] = {"parameter", "input", "output"};
    static const char *const rest[] = {" variability=\"fixed\" initial=\"exact\"",
                                       " variability=\"continuous\"",
                                       " variability=\"continuous\" initial=\"calculated\""};
    const Variable *v = &m->variables[k];
    fprintf(to, "    <%s", version == 2 ? "ScalarVariable" : "Float64");
    text(to, "name", v->name);
    fprintf(to, " valueReference=\"%d\"", k + 1);
    text(to, "description", v->about);
    /* FMI 3.0 has start values without initial="exact" for inputs, which have no initial. */
    fprintf(to, " causality=\"%s\"%s", causality[v->kind], rest[v->kind]);
    if (version == 2)
        fputs("><Real", to);
    text(to, "unit", v->unit);
    if (v->kind != OUTPUT)
        number(to, "start", v->start);
    else if (derivative_of[k])
        /* FMI 2.0 counts variables from 1, the time among them; FMI 3.0 has value references. */
        fprintf(to, " derivative=\"%d\"", derivative_of[k] + (version == 2));
    fputs(version == 2 ? "/></ScalarVariable>\n" : "/>\n", to);
}

/* Whether outputs answer at once as all inputs leave their start values, each by another step. */
static char *answers(const Model *m, const char *resources)
{
    char *found = calloc((size_t)m->count + 1, 1);
    if (!m->outputs || m->alone) /* which may start a whole simulator */
        return found;
    Run run = {.stop = INFINITY, .resources = resources, .state = calloc(1, m->state + 1)};
    double *before = calloc((size_t)m->count + 1, sizeof *before);
    run.v = calloc((size_t)m->count + 1, sizeof *run.v);
    for (int k = 0; k < m->count; k++)
        run.v[k + 1] = m->variables[k].start;
    if (!m->start || m->start(&run)) {
        for (int pass = 0; pass < 3; pass++) {
            for (int k = 0; k < m->count; k++)
                if (m->variables[k].kind == INPUT)
                    run.v[k + 1] = m->variables[k].start + (1.0 + k / 7.0) * (pass % 2 ? 1 : -pass);
            m->outputs(&run);
            for (int k = 0; k < m->count; k++) {
                if (pass && m->variables[k].kind == OUTPUT)
                    found[k] |= memcmp(&before[k], &run.v[k + 1], sizeof *before) != 0;
                before[k] = run.v[k + 1];
            }
        }
    }
    if (m->end)
        m->end(&run);
    free(run.v);
    free(run.state);
    free(before);
    return found;
}

/* Outputs that have answered may depend on all inputs at once, and those of a model without `outputs`
 * do on none. What is not known is not said: FMI takes it for all. */
static void depends(FILE *to, const Model *m, int version, int answered)
{
    if (m->outputs && !answered)
        return;
    fputs(" dependencies=\"", to);
    for (int k = 0, n = 0; k < m->count; k++)
        if (answered && m->variables[k].kind == INPUT)
            fprintf(to, "%s%d", n++ ? " " : "", k + (version == 2 ? 2 : 1));
    putc('"', to);
}

static void structure(FILE *to, const Model *m, int version, const char *answered)
{
    const char *const outer[] = {"    <Outputs>\n", "    </Outputs>\n    <InitialUnknowns>\n",
                                 "    </InitialUnknowns>\n"};
    for (int pass = 0; pass < 2; pass++) {
        fputs(version == 2 ? outer[pass] : "", to);
        for (int k = 0; k < m->count; k++) {
            if (m->variables[k].kind != OUTPUT)
                continue;
            if (version == 2)
                fprintf(to, "      <Unknown index=\"%d\"", k + 2);
            else
                fprintf(to, "    <%s valueReference=\"%d\"", pass ? "InitialUnknown" : "Output",
                        k + 1);
            if (pass == 0)
                depends(to, m, version, answered[k]);
            fputs("/>\n", to);
        }
    }
    fputs(version == 2 ? outer[2] : "", to);
}

/* 1, or 0 with a sentence in `why`. */
FMI2_Export int model_describe(int version, const char *resources, const char *path, char why[512])
{
    const Model *m = model(resources, why);
    FILE *to = m ? fopen(path, "w") : NULL;
    if (m && !to) {
        snprintf(why, 512, "%.400s cannot be written", path);
        if (m->close)
            m->close();
    }
    if (!to)
        return 0;
    char *answered = answers(m, resources);
    int *derivative_of = calloc((size_t)m->count, sizeof *derivative_of), slopes = 0;
    for (int k = 0; k < m->count; k++) {
        const Variable *v = &m->variables[k];
        slopes += v->kind == INPUT && v->slope > 0;
        if (v->kind == OUTPUT && v->slope)
            derivative_of[v->slope - 1] = k + 1;
    }
    fputs("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n", to);
    fprintf(to, "<fmiModelDescription fmiVersion=\"%d.0\"", version);
    text(to, "modelName", m->name);
    text(to, version == 2 ? "guid" : "instantiationToken", m->token);
    text(to, "description", m->about);
    fputs(" variableNamingConvention=\"flat\">\n  <CoSimulation", to);
    text(to, "modelIdentifier", m->name);
    fprintf(to, " canHandleVariableCommunicationStepSize=\"true\" canGetAndSet%s=\"%s\"",
            version == 2 ? "FMUstate" : "FMUState", m->alone ? "false" : "true");
    fprintf(to, " canBeInstantiatedOnlyOncePerProcess=\"%s\"", m->alone ? "true" : "false");
    if (version == 2)
        fprintf(to, " canInterpolateInputs=\"%s\"", slopes ? "true" : "false");
    fputs("/>\n", to);
    units(to, m);
    fputs("  <LogCategories>\n    <Category name=\"logStatusError\"/>\n  </LogCategories>\n", to);
    fputs("  <DefaultExperiment startTime=\"0\"", to);
    number(to, "stepSize", m->step);
    fputs("/>\n  <ModelVariables>\n    ", to);
    fputs(version == 2 ? "<ScalarVariable name=\"time\" valueReference=\"0\" "
                         "causality=\"independent\" variability=\"continuous\"><Real unit=\"s\"/>"
                         "</ScalarVariable>\n"
                       : "<Float64 name=\"time\" valueReference=\"0\" causality=\"independent\" "
                         "variability=\"continuous\" unit=\"s\"/>\n",
          to);
    for (int k = 0; k < m->count; k++)
        variable(to, m, k, version, derivative_of);
    fputs("  </ModelVariables>\n  <ModelStructure>\n", to);
    structure(to, m, version, answered);
    fputs("  </ModelStructure>\n</fmiModelDescription>\n", to);
    free(derivative_of);
    free(answered);
    if (m->close)
        m->close();
    return fclose(to) == 0;
}
