"""Error-controlled macro steps, with an audit of energy.

After Schierz, Arnold and Clauß, "Co-simulation with communication step size control in an FMI
compatible master algorithm", 9th Modelica Conference 2012, doi 10.3384/ecp12076205. Two estimates
of a step's local error in the outputs, for a method whose inputs are extrapolated with degree k:

``"richardson"``  two steps of H against one of 2H from the same start; their difference over
                  2^(k+1) - 1 is the error of the two;
``"predictor"``   what the step ends with against what was extrapolated to there, which costs no
                  step more.

The next step is H (tolerance / error)^(1 / (k + 2)), within bounds. The audit compares the power
that one side believes to have given with what the other took (Sadjina et al., "Energy conservation
and power bonds in co-simulations", Eng. Comput. 33 (2017) 607, doi 10.1007/s00366-016-0492-8) and
rejects a step whose residual is too large a share of the greatest power so far.

Known limits: needs participants that can repeat a step, so ngspice cannot take part; at an event
the step shrinks to what the jump allows, so wrap no more than is smooth, or cut at events first.
"""

from typing import Literal

import numpy as np

from cosim.coupling.polynomials import Array, value
from cosim.coupling.rewind.joint import Joint
from cosim.errors import SimulationFailed

Estimate = Literal["richardson", "predictor"]


class ErrorControlled:
    """Chooses the macro steps of a method."""

    def __init__(
        self,
        method: Joint,
        order: int,
        step: float,
        relative: float,
        absolute: float | Array,
        estimate: Estimate = "richardson",
        energy_share: float | None = None,
        safety: float = 0.8,
        growth: tuple[float, float] = (0.2, 2.0),
        longest: float = np.inf,
        shortest: float = 1e-12,
    ) -> None:
        """``order`` is the method's degree k of extrapolation, ``step`` (s) the first to try.

        The error of each output counts against ``absolute + relative |y|``; an infinite entry of an
        array ``absolute`` leaves that output out. With ``energy_share`` the audit is on.
        """
        self.method = method
        self._order = order
        self._h = step
        self._relative, self._absolute = relative, absolute
        self._estimate = estimate
        self._energy_share = energy_share
        self._safety, self._growth = safety, growth
        self._longest, self._shortest = longest, shortest
        self._power = 0.0
        self.accepted = 0
        """Macro steps that were kept."""
        self.rejected = 0
        """Attempts that were put back, for the error or the audit."""
        self.rejected_by_audit = 0

    def run(self, end: float) -> None:
        """Go on to ``end`` (s, the method's own time)."""
        while (left := end - self.method.time) > 1e-12 * end:
            n = 2 if self._estimate == "richardson" else 1
            # The last step is shortened, not the choice for those after it.
            h = min(self._h, left / n)
            if self.try_step(h) and h < self._h:
                continue

    def try_step(self, h: float) -> bool:
        """Try to go on by ``h`` (twice, with Richardson's estimate); whether it was kept."""
        saved, known = self.method.save(), self._power
        attempt = self._doubled if self._estimate == "richardson" else self._predicted
        error, residual = attempt(h, saved)
        # The first step from rest has nothing to be compared with: all of its power is residual.
        honest = not self._energy_share or not known or residual <= self._energy_share * self._power
        power = 1.0 / (self._order + 2)
        low, high = self._growth
        factor = high if error == 0.0 else self._safety * error**-power
        next_h = h * min(high, max(low, factor))
        if error <= 1.0 and honest:
            self.accepted += 2 if self._estimate == "richardson" else 1
            self._h = min(next_h, self._longest)
            return True
        self.method.restore(saved)
        self.rejected += 1
        if error <= 1.0:
            self.rejected_by_audit += 1
            next_h = 0.5 * h
        self._h = next_h
        if not self._h >= self._shortest:
            raise SimulationFailed(
                f"The error control asks for macro steps below {self._shortest:g} s at "
                f"t = {self.method.time:.6g} s; something jumps there."
            )
        return False

    def _doubled(self, h: float, saved: object) -> tuple[float, float]:
        method = self.method
        method.step(2.0 * h)
        once = self._outputs()
        method.restore(saved)
        method.step(h)
        residual = self._residual(h)
        method.step(h)
        residual = max(residual, self._residual(h))
        twice = self._outputs()
        return self._weighed((twice - once) / (2.0 ** (self._order + 1) - 1.0), twice), residual

    def _predicted(self, h: float, saved: object) -> tuple[float, float]:
        method = self.method
        signals = (method.past.current, method.past.emf)
        guess = [value(signal.polynomial(self._order), h) for signal in signals]
        method.step(h)
        found = self._outputs()
        off = found - np.concatenate([np.ravel(g) for g in guess])
        return self._weighed(off / (self._order + 2.0), found), self._residual(h)

    def _outputs(self) -> Array:
        return np.concatenate([self.method.past.current.value, self.method.past.emf.value]).ravel()

    def _weighed(self, error: Array, reference: Array) -> float:
        share = error / (self._absolute + self._relative * np.abs(reference))
        return float(np.sqrt(np.mean(share**2)))

    def _residual(self, h: float) -> float:
        """Power (W) that one side gave and the other did not take, in the mean over the step."""
        first, second = self.method.first.mean, self.method.second.mean
        if first.shape != second.shape:
            return 0.0
        believed = np.sum(_mean(self.method.for_first, h) * first)
        taken = np.sum(second * _mean(self.method.for_second, h))
        self._power = max(self._power, abs(float(believed)), abs(float(taken)))
        return abs(float(believed - taken))


def _mean(coefficients: Array, h: float) -> Array:
    return sum(c * (h**k / (k + 1)) for k, c in enumerate(coefficients))  # type: ignore[return-value]
