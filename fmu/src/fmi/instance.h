/* What the FMI 2.0 and FMI 3.0 layers share: one instance, its call order, its time, its messages.
 *
 * Functions that return int give 1 when the call was carried out and 0 when it was refused; a
 * refused call has changed nothing and has told the importer why. */
#ifndef STICKSLIP_INSTANCE_H
#define STICKSLIP_INSTANCE_H

#include <stddef.h>
#include <stdint.h>

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

Instance *instance_new(const char *function, const char *name, const char *token, const Log *log);
void instance_free(Instance *inst);

/* Reports "function: sentence" as an error. Always 0. */
int instance_refuse(const Instance *inst, const char *function, const char *format, ...);
int instance_allowed(const Instance *inst, const char *function, int phases);
int instance_set_logging(Instance *inst, const char *function, int on, size_t n,
                         const char *const categories[]);

int instance_set_up(Instance *inst, const char *function, int has_tolerance, double tolerance,
                    double start_time, int has_stop_time, double stop_time);
int instance_enter_initialisation(Instance *inst, const char *function);
int instance_exit_initialisation(Instance *inst, const char *function);
int instance_step(Instance *inst, const char *function, double time, double h);
int instance_terminate(Instance *inst, const char *function);
int instance_reset(Instance *inst, const char *function);

int instance_get_reals(Instance *inst, const char *function, const uint32_t vr[], size_t n,
                       double values[]);
int instance_set_reals(Instance *inst, const char *function, const uint32_t vr[], size_t n,
                       const double values[]);
int instance_get_integers(Instance *inst, const char *function, const uint32_t vr[], size_t n,
                          int values[]);
int instance_set_integers(Instance *inst, const char *function, const uint32_t vr[], size_t n,
                          const int values[]);
/* First time derivatives of current and normal_force. */
int instance_set_slopes(Instance *inst, const char *function, const uint32_t vr[], size_t n,
                        const int orders[], const double values[]);
int instance_derivative(Instance *inst, const char *function, const uint32_t unknowns[],
                        size_t n_unknowns, const uint32_t knowns[], size_t n_knowns,
                        const double seed[], double sensitivity[]);

int instance_get_state(Instance *inst, const char *function, void **state);
int instance_set_state(Instance *inst, const char *function, void *state);
int instance_free_state(Instance *inst, const char *function, void **state);
int instance_state_size(Instance *inst, const char *function, void *state, size_t *size);
int instance_serialise(Instance *inst, const char *function, void *state, void *bytes, size_t size);
int instance_deserialise(Instance *inst, const char *function, const void *bytes, size_t size,
                         void **state);

#endif
