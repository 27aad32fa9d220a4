/* SPDX-License-Identifier: BSD-2-Clause */
#include "spice.h"

#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Who has loaded ngspice before has initialised it, which can be done once only. */
static void *opened(int *there)
{
    static const char *const names[] = {"libngspice.so.0", "libngspice.so",
                                        "libngspice.dylib", "/opt/homebrew/lib/libngspice.dylib",
                                        "/usr/local/lib/libngspice.dylib"};
    const char *named = getenv("NGSPICE_LIBRARY_PATH");
    const size_t n = named && *named ? 1 : sizeof names / sizeof *names;
    void *library = NULL;
    for (size_t k = 0; !library && k < n; k++) {
        const char *name = named && *named ? named : names[k];
        void *before = dlopen(name, RTLD_NOW | RTLD_NOLOAD);
        if (before) {
            dlclose(before);
            *there = 1;
            return NULL;
        }
        library = dlopen(name, RTLD_NOW | RTLD_LOCAL);
    }
    return library;
}

int spice_find(Spice *spice, char why[512])
{
    const struct {
        const char *name;
        void *into;
    } wanted[] = {{"ngSpice_Init", &spice->init},       {"ngSpice_Init_Sync", &spice->init_sync},
                  {"ngSpice_Circ", &spice->circuit},    {"ngSpice_Command", &spice->command},
                  {"ngSpice_SetBkpt", &spice->breakpoint}, {"ngGet_Vec_Info", &spice->vector}};
    int there = 0;
    void *library = spice->library = opened(&there);
    if (there) {
        snprintf(why, 512, "something else in this process has loaded ngspice, which has one circuit "
                           "in a process");
        return 0;
    }
    if (!library) {
        const char *said = dlerror();
        snprintf(why, 512,
                 "libngspice was not found (%.200s); install it (Debian and Ubuntu: libngspice0, "
                 "macOS: brew install libngspice) or name it in NGSPICE_LIBRARY_PATH",
                 said ? said : "no reason given");
        return 0;
    }
    for (size_t k = 0; k < sizeof wanted / sizeof *wanted; k++) {
        void *found = dlsym(library, wanted[k].name);
        if (!found) {
            snprintf(why, 512, "the library of ngspice lacks %s", wanted[k].name);
            return 0;
        }
        memcpy(wanted[k].into, &found, sizeof found);
    }
    return 1;
}

void spice_leave(Spice *spice)
{
    if (spice->library)
        dlclose(spice->library);
    *spice = (Spice){0};
}
