/* The current source that drives the coils, reduced to its limits.
 *
 * The coils' total current follows command / sense_resistance, at most current_limit, as long as the
 * output voltage that this takes lies between output_low and output_high. Else the output stays at
 * that limit and the coil's inductance decides, until the current meets its target again. For one
 * coil i of n in parallel:
 *
 *     output = n R_s i + v_coil,   v_coil = R_c i + L di/dt + R_2 (i - i_2) + e,
 *     L_2 di_2/dt = R_2 (i - i_2)
 *
 * Only mode.output, mode.limited and the states I_COIL ... E_COPPER belong to it. Each surface s that
 * moves by itself has a source; mode and y are those of s alone. */
#ifndef STICKSLIP_SOURCE_H
#define STICKSLIP_SOURCE_H

#include "event.h"
#include "internal.h"

STICKSLIP_INTERNAL_BEGIN

/* Current of one coil, A, and its rate, A/s; with a source or as given. */
double stickslip_coil_current(const Model *m, const double y[N_STATES], int s, double tau);
double stickslip_coil_current_rate(const Model *m, const Mode *mode, const double y[N_STATES],
                                   int s);

/* Voltage across the coils, V. */
double stickslip_coil_voltage(const Model *m, const Mode *mode, const double y[N_STATES], int s);

/* Rates of I_COIL ... E_COPPER. */
void stickslip_source_rates(const Model *m, const Mode *mode, const double y[N_STATES], int s,
                            double dy[N_STATES]);

/* Appends the events of the present mode from place n on; returns the new number. emf_rate is the
 * slope of the back-EMF, V/s. */
int stickslip_source_events(const Model *m, const double y[N_STATES], int s, double tau,
                            double emf_rate, EventFunction functions[MAX_EVENT_FUNCTIONS], int n);
void stickslip_source_apply(Model *m, int s, double tau, EventKind kind);

/* Make the mode agree with the command, which may have jumped, and with everything else. */
void stickslip_source_settle_command(Model *m, int s, double tau);
void stickslip_source_settle_output(Model *m, int s, double tau);

/* d(coil_voltage)/d(command_slope) in the present mode, s. */
double stickslip_coil_voltage_per_slope(const Model *m, int s);
double stickslip_magnetic_energy(const Model *m, const double y[N_STATES]);

STICKSLIP_INTERNAL_END

#endif
