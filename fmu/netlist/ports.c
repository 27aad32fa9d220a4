/* SPDX-License-Identifier: BSD-2-Clause */
#include "ports.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

char *ports_file(const char *resources, const char *name, char why[512])
{
    char path[4096];
    const size_t length = strlen(resources);
    const char *slash = length && resources[length - 1] == '/' ? "" : "/";
    snprintf(path, sizeof path, "%s%s%s", resources, slash, name);
    FILE *file = fopen(path, "rb");
    char *text = NULL;
    long size;
    if (file && fseek(file, 0, SEEK_END) == 0 && (size = ftell(file)) >= 0) {
        rewind(file);
        text = calloc(1, (size_t)size + 1);
        if (text && fread(text, 1, (size_t)size, file) != (size_t)size) {
            free(text);
            text = NULL;
        }
    }
    if (file)
        fclose(file);
    if (!text)
        snprintf(why, 512, "%.400s cannot be read", path);
    return text;
}

/* The next word up to `end`, which is cut off. */
static char *word(char **at, const char *end)
{
    char *found = *at;
    *at += strcspn(found, end);
    if (**at)
        *(*at)++ = '\0';
    return found;
}

static void add(Ports *p, Kind kind, char *rest)
{
    Variable *v = &p->variables[p->model.count];
    v->kind = kind;
    v->name = word(&rest, "\t");
    v->unit = word(&rest, "\t");
    v->start = strtod(word(&rest, "\t"), NULL);
    v->about = word(&rest, "\t");
    p->words[++p->model.count] = word(&rest, "\t");
    if (kind == INPUT) {
        v->slope = p->model.count + 1;
        const size_t room = strlen(v->name) + strlen(v->unit) + 10;
        char *names = malloc(room);
        const int n = snprintf(names, room, "%s_slope", v->name) + 1;
        snprintf(names + n, room - (size_t)n, "%s/s", v->unit);
        v[1] = (Variable){INPUT, names, names + n, 0.0, "Its slope; it goes on with it until set", 0};
        p->words[++p->model.count] = NULL;
    }
}

int ports_read(Ports *p, const char *resources, char why[512])
{
    ports_free(p);
    p->text = ports_file(resources, "ports.txt", why);
    if (!p->text)
        return 0;
    size_t lines = 1;
    for (const char *at = p->text; *at; at++)
        lines += *at == '\n';
    p->variables = calloc(2 * lines, sizeof *p->variables);
    p->words = calloc(2 * lines + 1, sizeof *p->words);
    p->pulses = calloc(lines, sizeof *p->pulses);
    p->model = (Model){.name = "netlist", .about = "", .token = "", .variables = p->variables};
    for (char *at = p->text; *at;) {
        char *rest = word(&at, "\n"), *kind = word(&rest, "\t");
        if (strcmp(kind, "name") == 0)
            p->model.name = rest;
        else if (strcmp(kind, "about") == 0)
            p->model.about = rest;
        else if (strcmp(kind, "token") == 0)
            p->model.token = rest;
        else if (strcmp(kind, "step") == 0)
            p->model.step = strtod(rest, NULL);
        else if (strcmp(kind, "pulse") == 0)
            p->pulses[p->n_pulses++] = rest;
        else if (strcmp(kind, "parameter") == 0)
            add(p, PARAMETER, rest);
        else if (strcmp(kind, "input") == 0)
            add(p, INPUT, rest);
        else if (strcmp(kind, "output") == 0)
            add(p, OUTPUT, rest);
    }
    return 1;
}

void ports_free(Ports *p)
{
    for (int k = 0; k < p->model.count; k++)
        if (p->variables[k].slope)
            free((char *)p->variables[k + 1].name);
    free(p->text);
    free(p->variables);
    free(p->words);
    free(p->pulses);
    memset(p, 0, sizeof *p);
}
