/* SPDX-License-Identifier: BSD-2-Clause */
#include "spice.h"

#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void *opened(void)
{
    static const char *const names[] = {"libngspice.so.0", "libngspice.so",
                                        "libngspice.dylib", "/opt/homebrew/lib/libngspice.dylib",
                                        "/usr/local/lib/libngspice.dylib"};
    const char *named = getenv("NGSPICE_LIBRARY_PATH");
    if (named && *named)
        return dlopen(named, RTLD_NOW | RTLD_LOCAL);
    void *library = NULL;
    for (size_t k = 0; !library && k < sizeof names / sizeof *names; k++)
        library = dlopen(names[k], RTLD_NOW | RTLD_LOCAL);
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
    void *library = spice->library = opened();
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
