"""Error-controlled macro steps, with an audit of energy.

After Schierz, Arnold and Clauß, "Co-simulation with communication step size control in an FMI
compatible master algorithm", 9th Modelica Conference 2012, doi 10.3384/ecp12076205. Two steps of H
are compared with one of 2H from the same start. If a method extrapolates inputs with degree k, the
difference of the results over 2^(k+1) - 1 estimates the error of the two steps (Richardson).

The next step is H (tolerance / error)^(1 / (k + 2)), within bounds. The audit compares the power
that one side gives, by its extrapolated input, with what the other side takes (Sadjina et al.,
"Energy conservation and power bonds in co-simulations", Eng. Comput. 33 (2017) 607, doi
10.1007/s00366-016-0492-8), and rejects a step whose residual is too large a share of the greatest
power so far.

Known limits: participants must be able to repeat a step, which ngspice cannot; at an event the step
shrinks until the jump is within the tolerance, so macro steps should be cut at events first.
"""

import numpy as np

from cosim.coupling.polynomials import Array, projected
from cosim.coupling.rewind.joint import Joint
from cosim.errors import SimulationFailed

_LEAST_CHANGE, _MOST_CHANGE = 0.2, 2.0  # of the step, as ratios


class ErrorControlled:
    """Chooses the macro steps of a method."""

    def __init__(
        self,
        method: Joint,
        step: float,
        relative: float,
        absolute: float | Array,
        energy_share: float | None = None,
        safety: float = 0.8,
        shortest: float = 1e-12,
    ) -> None:
        """``step`` (s) is the first macro step that is tried.

        The error of each output y is scaled by ``absolute + relative |y|``; an infinite entry of an
        array ``absolute`` leaves that output out. With ``energy_share`` the audit is on: the power
        residual may be this share of the greatest power so far.
        """
        self.method = method
        self._order = method.method.degree + 1
        self._h = step
        self._relative, self._absolute = relative, absolute
        self._energy_share = energy_share
        self._safety, self._shortest = safety, shortest
        self._power = 0.0
        self.accepted = 0
        """Macro steps that were accepted."""
        self.rejected = 0
        """Attempts that were undone, for the error or the audit."""
        self.rejected_by_audit = 0

    def run(self, end: float) -> None:
        """Advance to the time ``end`` of the method, s."""
        while (left := end - self.method.time) > 1e-12 * end:
            self._try(min(self._h, left / 2.0))

    def _try(self, h: float) -> None:
        """Try two steps of ``h``; undo them if they fail. Chooses the next step either way."""
        method, known = self.method, self._power
        saved = method.save()
        method.step(2.0 * h)
        once = self._outputs()
        method.restore(saved)
        method.step(h)
        residual = self._residual(h)
        method.step(h)
        residual = max(residual, self._residual(h))
        twice = self._outputs()
        off = (twice - once) / (2.0**self._order - 1.0)
        share = off / (self._absolute + self._relative * np.abs(twice))
        error = float(np.sqrt(np.mean(share**2)))
        # The first step from rest is not audited: with no power before it, all is residual.
        honest = not self._energy_share or not known or residual <= self._energy_share * self._power
        factor = self._safety * error ** (-1.0 / (self._order + 1)) if error else _MOST_CHANGE
        self._h = h * min(_MOST_CHANGE, max(_LEAST_CHANGE, factor))
        if error <= 1.0 and honest:
            self.accepted += 2
            return
        method.restore(saved)
        self.rejected += 1
        if error <= 1.0:
            self.rejected_by_audit += 1
            self._h = 0.5 * h
        if not self._h >= self._shortest:
            raise SimulationFailed(
                f"The error control asks for macro steps below {self._shortest:g} s at "
                f"t = {method.time:.6g} s; something jumps there."
            )

    def _outputs(self) -> Array:
        return np.concatenate([self.method.past.current.value, self.method.past.emf.value]).ravel()

    def _residual(self, h: float) -> float:
        """Magnitude of the mean power (W) over the step that the circuit delivered by its own input
        and the mechanics did not receive by theirs."""
        first, second = self.method.first.mean, self.method.second.mean
        if first.shape != second.shape:
            return 0.0
        believed = np.sum(projected(self.method.for_first, h, 0)[0] * first)
        taken = np.sum(second * projected(self.method.for_second, h, 0)[0])
        self._power = max(self._power, abs(float(believed)), abs(float(taken)))
        return abs(float(believed - taken))
