/* SPDX-License-Identifier: BSD-2-Clause */
/* What the FMI 2.0 and FMI 3.0 layers share: one instance, its call order, its time, its messages.
 *
 * Functions that return int give 1 when the call was carried out and 0 when it was refused; a
 * refused call has changed nothing and has told the importer why. */
#ifndef STICKSLIP_INSTANCE_H
#define STICKSLIP_INSTANCE_H

#include <stddef.h>
#include <stdint.h>

#include "../physics/internal.h"
#include "../physics/model.h"

typedef enum {
    INSTANTIATED = 1,
    INITIALISING = 2,
    STEPPING = 4,
    TERMINATED = 8,
    ANY_PHASE = INSTANTIATED | INITIALISING | STEPPING | TERMINATED
} Phase;

/* The same numbers in both standards. */
typedef enum { SEVERITY_OK = 0, SEVERITY_ERROR = 3 } Severity;

typedef struct Instance Instance;
typedef void (*AnyFunction)(void);
typedef void (*Sender)(const Instance *inst, Severity severity, const char *category,
                       const char *message);

/* Everything that an FMU state keeps: without pointers, so that its bytes mean the same elsewhere. */
typedef struct {
    Model model;
    double time, stop_time;
    int has_stop_time;
    int tolerance_set; /* by the importer as a parameter, which the experiment's does not override */
    int outputs_stale;
    int phase;
} State;

struct Instance {
    State state;
    Sender send;
    AnyFunction callback; /* the importer's logger, of the type that the layer's sender knows */
    void *environment;
    char *name;
    int log_events;
};

typedef struct {
    Sender send;
    AnyFunction callback;
    void *environment;
    int log_events;
} Log;

STICKSLIP_INTERNAL_BEGIN

Instance *stickslip_new(const char *function, const char *name, const char *token, const Log *log);
void stickslip_free(Instance *inst);

/* Reports "function: sentence" as an error. Always 0. */
int stickslip_refuse(const Instance *inst, const char *function, const char *format, ...);
/* Refuses what the present phase does not allow. */
int stickslip_untimely(const Instance *inst, const char *function);
static inline int stickslip_allowed(const Instance *inst, const char *function, int phases)
{
    return inst && ((inst->state.phase & phases) || stickslip_untimely(inst, function));
}
int stickslip_set_logging(Instance *inst, const char *function, int on, size_t n,
                          const char *const categories[]);

int stickslip_set_up(Instance *inst, const char *function, int has_tolerance, double tolerance,
                     double start_time, int has_stop_time, double stop_time);
int stickslip_enter_initialisation(Instance *inst, const char *function);
int stickslip_exit_initialisation(Instance *inst, const char *function);
int stickslip_step(Instance *inst, const char *function, double time, double h);
int stickslip_terminate(Instance *inst, const char *function);
int stickslip_reset(Instance *inst, const char *function);

int stickslip_get_reals(Instance *inst, const char *function, const uint32_t vr[], size_t n,
                        double values[]);
int stickslip_set_reals(Instance *inst, const char *function, const uint32_t vr[], size_t n,
                        const double values[]);
int stickslip_get_integers(Instance *inst, const char *function, const uint32_t vr[], size_t n,
                           int values[]);
int stickslip_set_integers(Instance *inst, const char *function, const uint32_t vr[], size_t n,
                           const int values[]);
/* First time derivatives of current and normal_force. */
int stickslip_set_slopes(Instance *inst, const char *function, const uint32_t vr[], size_t n,
                         const int orders[], const double values[]);
int stickslip_derivative(Instance *inst, const char *function, const uint32_t unknowns[],
                         size_t n_unknowns, const uint32_t knowns[], size_t n_knowns,
                         const double seed[], double sensitivity[]);

int stickslip_get_state(Instance *inst, const char *function, void **state);
int stickslip_set_state(Instance *inst, const char *function, void *state);
int stickslip_free_state(Instance *inst, const char *function, void **state);
int stickslip_state_size(Instance *inst, const char *function, void *state, size_t *size);
int stickslip_serialise(Instance *inst, const char *function, void *state, void *bytes,
                        size_t size);
int stickslip_deserialise(Instance *inst, const char *function, const void *bytes, size_t size,
                          void **state);

STICKSLIP_INTERNAL_END

#endif
