/* SPDX-License-Identifier: BSD-2-Clause */
/* The solution between two points: where something happens on it. */
#ifndef STICKSLIP_CURVE_H
#define STICKSLIP_CURVE_H

#include "dense.h"
#include "event.h"

STICKSLIP_INTERNAL_BEGIN

/* s; a step is of an instant below this. */
#define STEP_MIN 1e-14

/* `at` is where on its curve the point lies: seconds after the curve's start or, by a wall's clock,
 * what that shows. */
typedef struct {
    Knot knot;
    double at;
    EventFunction functions[MAX_EVENT_FUNCTIONS];
    int n;
} Point;

/* Of a long step its interpolant; else (dense NULL) each point is the end of a short step from the
 * start. By the clock of the given wall, or (-1) by the time. */
typedef struct {
    const Point *start;
    const Dense *dense;
    int wall;
} Curve;

void stickslip_find_functions(const Model *m, Point *point);

/* Could an event lie within a long step until the given point? Not where all functions are further
 * from zero, at either end, than they would go at that end's rate in half the step: a dip in between
 * that is a parabola goes half as far. */
int stickslip_may_have_event(const Model *m, const Curve *curve, const Point *to);

/* The first event on the curve until the given point: its place, and which function's it is; a
 * negative number if there is none. */
double stickslip_first_event(const Model *m, const Curve *curve, const Point *to, int *which);

/* A real step from the start to the event that the curve has at a place; what the event's function
 * is still off then is made up for along a straight. Returns the time from the start, s. */
double stickslip_land(const Model *m, const Curve *curve, int which, double at, Point *end);

STICKSLIP_INTERNAL_END

#endif
