/* The rows of a coil whose current is prescribed, for cosim/simulation/rungs/ideal.py. */

#include <math.h>
#include <stdint.h>

#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

static const double SAME_TIME = 1e-12; /* s; as in the recorder */

/* Write the current (A) and the voltage without back-EMF (V) to `waves`, at the times `step` k (s), k from
   `first` to before `beyond`. These lie within the `n` intervals between `edges` (s), in which the current
   goes linearly from `start` to `end` (A); a time on an edge belongs to the interval before it.
   `branch` has the current of the LR2 branch at the begin of each interval, or is NULL;
   resistances in Ohm, inductance in H, the branch's time constant `tau` in s. */
EXPORT void coil_rows(int64_t n, const double *edges, const double *start, const double *end,
                      const double *branch, double resistance, double inductance,
                      double eddy_resistance, double tau, double step, int64_t first, int64_t beyond,
                      double *waves)
{
    int64_t k = 0;
    for (int64_t row = first; k < n; k++) {
        const double slope = (end[k] - start[k]) / (edges[k + 1] - edges[k]);
        const double lag = slope * tau, rest = branch ? start[k] - branch[k] - lag : 0.0;
        for (; row < beyond; row++) {
            const double time = step * (double)row;
            if (k + 1 < n && time - SAME_TIME > edges[k + 1])
                break;
            const double since = time - edges[k], current = start[k] + slope * since;
            double voltage = resistance * current + inductance * slope;
            if (branch)
                voltage += eddy_resistance * (lag + rest * exp(-since / tau));
            *waves++ = current;
            *waves++ = voltage;
        }
    }
}
