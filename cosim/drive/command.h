/* A command between two of its corners, as cosim/drive/command.py describes it. SI. */

#ifndef COMMAND_H
#define COMMAND_H

#include <stdint.h>

#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

enum { LEVEL, RAMP, SINE };

typedef struct {
    double begin, until; /* s; the piece holds in [begin, until) */
    int64_t kind;
    double offset, amplitude;  /* V */
    double origin, rate, span; /* s, Hz, 1: see command_value() */
    double end;                /* V; left limit of V1 at `until` */
    double jump;               /* s; first discontinuity after `begin`; inf: none */
    double dac;                /* V at the DAC; of a LEVEL only */
    double pin;                /* V at the offset pin */
} Piece;

typedef struct {
    const Piece *pieces; /* in the order of time; one of them holds */
    int64_t count, now;
    void (*refill)(void); /* makes the first piece the one that holds where the run is */
} Pieces;

/* V1 (V) at `t` (s) in [begin, until). With the phase (t - origin) rate it is `offset` for a LEVEL,
   offset + amplitude/2 sin(2π phase) for a SINE, and offset + amplitude (phase / span - 1/2) in a RAMP,
   of which no more than its end is taken. */
EXPORT double command_value(const Piece *p, double t);

/* The piece that holds at `t` (s); the last one where no more are to be had. */
const Piece *piece_at(Pieces *drive, double t);

/* V1 at each of `n` times, which do not fall, from pieces that cover them; or its left limits there,
   times within 1e-12 s after a corner being on it. */
EXPORT void command_values(const Piece *p, int64_t n, const double *times, double *values);
EXPORT void command_values_before(const Piece *p, int64_t n, const double *times, double *values);

#endif
