/* SPDX-License-Identifier: BSD-2-Clause */
/* What the FMU's resources say: `ports.txt`, a line for each variable, and `deck.cir`.
 *
 * A line is words between tabs:
 *     name / about / token / step      word
 *     parameter / input / output       name, unit, start, description, word
 *     pulse                            word
 * The last word is ngspice's: the name in a line `.param name=…` of the deck, of an external source,
 * of a vector, of a source with PULSE. Each input is followed by its slope in the table. */
#ifndef NETLIST_PORTS_H
#define NETLIST_PORTS_H

#include "../thin/model.h"

typedef struct {
    char *text;           /* in which all words lie */
    Model model;
    Variable *variables;
    const char **words;   /* ngspice's, by value reference; NULL for slopes */
    const char **pulses;
    int n_pulses;
} Ports;

int ports_read(Ports *, const char *resources, char why[512]);
void ports_free(Ports *);
/* A file of the resources; NULL with a sentence in `why`. */
char *ports_file(const char *resources, const char *name, char why[512]);

#endif
