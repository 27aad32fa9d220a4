"""Step-locked, the default: the mechanics follow each accepted step of the circuit.

The circuit solves [t_n, t_n+1] against the back-EMF extrapolated from t_n with its true slope (the
FMU knows the ram's acceleration); then the mechanics take the same interval with the current
linear between its two ends, which carries the circuit's charge exactly. Both sides are of second
order where nothing jumps. The extrapolation uses nothing older than t_n, so a jump of the source or
an event in the mechanics is forgotten at the next step. Two things are done about the step that
holds the event:

- That the ram meets a wall, where the back-EMF jumps or soon turns, is expected by the mechanics;
  the circuit's step is cut to end just after it, and the next one is short.
- The flux that the circuit was given, the integral of its back-EMF, falls behind that of the
  mechanics, which their displacement alone tells. What is owed is paid back over the next steps, so
  that no event leaves an error that lasts.

Explicit and sequential (Gauss-Seidel) in the sense of Busch, "Continuous approximation techniques
for co-simulation methods", ZAMM 96 (2016) 1061; the step sizes are those of ngspice. There
``macro_point_step_locked`` (``lead.c``) does the same without Python.
"""

from cosim.coupling.methods.gauss_seidel import GaussSeidel


class StepLocked(GaussSeidel):
    """Every accepted step of the circuit ends on a communication point."""

    name = "step-locked"


StepLocked.variants = {"EMF's slope, linear current": StepLocked}
